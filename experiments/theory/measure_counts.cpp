#include "experiments/theory/measure_counts.hpp"

#include <algorithm>

#include "core/families/events/kinetic_forest.hpp"
#include "experiments/scenes/shapes.hpp"
#include "experiments/theory/kinetic_log.hpp"

namespace kbvh::theory {

namespace {

struct CountNotices {
  std::uint64_t* notices;
  template <class S>
  void realiser_changed(std::uint32_t, std::uint32_t, Side, std::uint32_t, std::uint32_t, const Instant<S>&) {
    ++*notices;
  }
  void realiser_plan_changed(std::uint32_t /*body*/, std::uint32_t /*node*/) {}
};

using Forest = KineticForest<float, AvlQueue<float>, Counting, CountNotices>;
using Tree = Forest::Tree;

/// The sum and the maximum of the increments of a growing counter.
class Difference {
 public:
  void start(std::uint64_t value) { last_ = value; }
  void stop(std::uint64_t value) {
    sum += value - last_;
    most = std::max(most, value - last_);
  }
  std::uint64_t sum = 0, most = 0;

 private:
  std::uint64_t last_ = 0;
};

/// Calls `part(node, side, vertex)` for every vertex of every certificate: the winner and all candidates.
template <class Part>
void for_all_certificates(const Tree& tree, Part part) {
  const Topology& topology = tree.topology();
  std::vector<std::uint32_t> members;
  for (std::uint32_t node = 0; node < topology.size(); ++node)
    for (Side side = 0; side < 6; ++side) {
      members.clear();
      const TopologyNode n = topology.nodes[node];
      if (n.is_leaf())
        members.assign(tree.leaf_vertices(node).begin(), tree.leaf_vertices(node).end());
      else
        for (std::uint32_t child = n.first(); child < n.first() + n.count(); ++child)
          members.push_back(tree.realiser(child, side));
      std::sort(members.begin(), members.end());
      members.erase(std::unique(members.begin(), members.end()), members.end());
      for (const std::uint32_t v : members) part(v);
    }
}

void count_vertex_certificates(const Forest& forest, std::uint32_t bodies, const SceneView<float>& view,
                               CountRun& run) {
  std::uint64_t total = 0;
  for (std::uint32_t body = 0; body < bodies; ++body) {
    std::vector<std::uint64_t> certificates(view.vertex_count(body), 0);
    for_all_certificates(forest.tree(body), [&](std::uint32_t v) { ++certificates[v]; });
    for (const std::uint64_t n : certificates) {
      total += n;
      run.max_vertex_certificates = std::max(run.max_vertex_certificates, n);
    }
  }
  run.mean_vertex_certificates = double(total) / double(run.vertices);
}

std::uint64_t most_events_of_a_node(const Forest& forest, std::uint32_t bodies) {
  std::uint64_t most = 0;
  for (std::uint32_t body = 0; body < bodies; ++body) {
    const Tree& tree = forest.tree(body);
    for (std::uint32_t node = 0; node < tree.topology().size(); ++node) {
      std::uint64_t scheduled = 0;
      for (Side side = 0; side < 6; ++side) scheduled += forest.queue().scheduled(tree.slot(node, side));
      most = std::max(most, scheduled);
    }
  }
  return most;
}

/// Returns the leaves of each vertex, from connectivity alone.
std::vector<std::vector<std::uint32_t>> leaves_of_vertices(const Topology& topology,
                                                           const Primitives& primitives,
                                                           std::uint32_t vertices) {
  std::vector<std::vector<std::uint32_t>> leaves(vertices);
  for (std::uint32_t node = 0; node < topology.size(); ++node) {
    const TopologyNode n = topology.nodes[node];
    if (!n.is_leaf()) continue;
    for (std::uint32_t i = n.first(); i < n.first() + n.count(); ++i)
      for (const std::uint32_t v : primitives[topology.primitives[i]])
        if (leaves[v].empty() || leaves[v].back() != node) leaves[v].push_back(node);
  }
  return leaves;
}

/// Changes one plan after the other at the first keyframe: 200 random vertices and the one with the most
/// leaves.
void measure_updates(const Scene<float>& scene, const Topologies& topologies, CountRun& run) {
  const SceneView<float> view(scene);
  Playback<float> playback(scene);
  const double first = overlaid_keyframes(scene).front();
  playback.seek(first);
  Counting count;
  std::uint64_t notices = 0;
  Forest forest(view, ClipMotion<float>(playback), topologies, count, CountNotices{&notices});
  forest.reset(first);
  const scenes::SeededNoise noise(4);
  std::uint64_t index = 0;
  Difference certificates, steps;
  for (std::uint32_t body = 0; body < view.body_count(); ++body) {
    const Topology& topology = topologies[body];
    const auto leaves = leaves_of_vertices(topology, view.primitives(body), view.vertex_count(body));
    std::vector<std::uint32_t> chosen;
    std::uint32_t hub = 0;
    for (std::uint32_t v = 0; v < leaves.size(); ++v)
      if (leaves[v].size() > leaves[hub].size()) hub = v;
    run.max_leaves_of_vertex = std::max<std::uint64_t>(run.max_leaves_of_vertex, leaves[hub].size());
    chosen.push_back(hub);
    for (int i = 0; i < 200; ++i) chosen.push_back(std::uint32_t(noise.bits(index++) % leaves.size()));
    for (const std::uint32_t v : chosen) {
      if (leaves[v].empty()) continue;
      // The largest set that an update may visit, from the tree alone: the candidates of every node above the
      // vertex.
      std::vector<std::uint32_t> above;
      for (std::uint32_t node : leaves[v])
        for (;; node = topology.parents[node]) {
          above.push_back(node);
          if (node == 0) break;
        }
      std::sort(above.begin(), above.end());
      above.erase(std::unique(above.begin(), above.end()), above.end());
      double candidates = 0;
      for (const std::uint32_t node : above)
        candidates += topology.nodes[node].is_leaf() ? double(forest.tree(body).leaf_vertices(node).size())
                                                     : double(topology.nodes[node].count());
      PlanChange<float> change;
      change.body = body;
      change.vertex = v;
      for (float& x : change.velocity) x = float(noise.signed_unit(index++));
      playback.change_plans(first, {&change, 1});
      const std::uint64_t before = count.table[Counter::certificates_made];
      certificates.start(before);
      steps.start(forest.queue().steps());
      forest.tree(body).plans_changed(first, {&v, 1});
      certificates.stop(count.table[Counter::certificates_made]);
      steps.stop(forest.queue().steps());
      run.update_share = std::max(
          run.update_share, double(count.table[Counter::certificates_made] - before) / (6 * candidates));
      ++run.updates;
    }
  }
  run.sum_update_certificates = certificates.sum;
  run.max_update_certificates = certificates.most;
  run.max_update_steps = steps.most;
}

}  // namespace

CountRun measure_counts(const Scene<float>& scene) {
  const SceneView<float> view(scene);
  const std::vector<double> keyframes = overlaid_keyframes(scene);
  Playback<float> playback(scene);
  playback.seek(keyframes.front());
  playback.evaluate_all();
  const Topologies topologies = build_topologies(view, playback, paper_builder);

  CountRun run;
  run.scene = scene.name;
  run.triangles = scene.primitive_count();
  run.vertices = scene.vertex_count();
  run.segments = keyframes.size() - 1;
  for (std::uint32_t body = 0; body < view.body_count(); ++body) {
    const Topology& topology = topologies[body];
    run.nodes += topology.size();
    for (const std::uint8_t depth : topology.depths) run.depth = std::max<std::uint64_t>(run.depth, depth);
    const double segments = double(scene.bodies[body].plans.keyframe_count() - 1);
    for (const auto& below : vertices_below(topology, view.primitives(body)))
      run.breakpoint_bound += segments * 6 * (double(below.size()) - 1);
  }
  measure_updates(scene, topologies, run);

  Counting count;
  std::uint64_t notices = 0;
  Forest forest(view, ClipMotion<float>(playback), topologies, count, CountNotices{&notices});
  forest.reset(keyframes.front());
  count.table = {};
  run.queue_peak = forest.queue().size();
  Difference visited, steps, operations, certificates;
  for (std::size_t k = 0; k < keyframes.size(); ++k) {
    while (forest.due(keyframes[k])) {
      visited.start(count.table[Counter::nodes_visited]);
      operations.start(count.table[Counter::queue_operations]);
      certificates.start(count.table[Counter::certificates_made]);
      steps.start(forest.queue().steps());
      const std::uint64_t before = notices;
      forest.handle_next();
      visited.stop(count.table[Counter::nodes_visited]);
      operations.stop(count.table[Counter::queue_operations]);
      certificates.stop(count.table[Counter::certificates_made]);
      steps.stop(forest.queue().steps());
      run.silent_events += notices == before;
      run.queue_peak = std::max<std::uint64_t>(run.queue_peak, forest.queue().size());
      ++run.events;
    }
    if (k == 0 || k == keyframes.size() / 2 || k + 1 == keyframes.size()) {
      count_vertex_certificates(forest, view.body_count(), view, run);
      run.most_of_node = std::max(run.most_of_node, most_events_of_a_node(forest, view.body_count()));
    }
  }
  run.values = notices;
  run.bytes = forest.bytes();
  run.sum_visited = visited.sum, run.max_visited = visited.most;
  run.sum_steps = steps.sum, run.max_steps = steps.most;
  run.sum_operations = operations.sum, run.max_operations = operations.most;
  run.sum_certificates = certificates.sum, run.max_certificates = certificates.most;
  return run;
}

}  // namespace kbvh::theory
