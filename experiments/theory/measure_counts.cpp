#include "experiments/theory/measure_counts.hpp"

#include <algorithm>

#include "experiments/scenes/shapes.hpp"
#include "experiments/theory/kinetic_log.hpp"
#include "experiments/theory/stepped_strategy.hpp"

namespace kbvh::theory {

namespace {

/// The paper's kinetic AABB tree on its own queue.
struct PaperTree : SteppedStrategy {
  PaperTree(const SceneView<float>& view, Playback<float>& playback, const Topologies& topologies, double t)
      : SteppedStrategy("kinetic_aabb", {{"queue", "avl"}, {"query", "nodes"}}, view, playback, topologies,
                        t) {}
};

/// A sum and a maximum of differences of a counter that only grows.
struct Difference {
  std::uint64_t sum = 0, most = 0;
  void add(const Counters& before, const Counters& after, Counter counter) {
    const std::uint64_t grown = after[counter] - before[counter];
    sum += grown;
    most = std::max(most, grown);
  }
};

/// Calls `part(vertex)` for every vertex of every certificate of a body: the winner and all candidates.
template <class Part>
void for_all_certificates(const EventSource<float>& source, const LeafVertices& leaves, std::uint32_t body,
                          Part part) {
  const Topology& topology = source.tree(body);
  std::vector<std::uint32_t> members;
  for (std::uint32_t node = 0; node < topology.size(); ++node)
    for (std::uint32_t side = 0; side < 6; ++side) {
      members.clear();
      const TopologyNode n = topology.nodes[node];
      if (n.is_leaf())
        members.assign(leaves[node].begin(), leaves[node].end());
      else
        for (std::uint32_t child = n.first(); child < n.first() + n.count(); ++child)
          members.push_back(source.realiser(body, child, side));
      std::sort(members.begin(), members.end());
      members.erase(std::unique(members.begin(), members.end()), members.end());
      for (const std::uint32_t v : members) part(v);
    }
}

void count_vertex_certificates(const EventSource<float>& source, const SceneView<float>& view,
                               CountRun& run) {
  std::uint64_t total = 0;
  for (std::uint32_t body = 0; body < view.body_count(); ++body) {
    std::vector<std::uint64_t> certificates(view.vertex_count(body), 0);
    const LeafVertices leaves = unique_leaf_vertices(source.tree(body), view.primitives(body));
    for_all_certificates(source, leaves, body, [&](std::uint32_t v) { ++certificates[v]; });
    for (const std::uint64_t n : certificates) {
      total += n;
      run.max_vertex_certificates = std::max(run.max_vertex_certificates, n);
    }
  }
  run.mean_vertex_certificates = double(total) / double(run.vertices);
}

std::uint64_t most_events_of_a_node(const EventSource<float>& source, std::uint32_t bodies) {
  std::vector<ScheduledEvent<float>> events;
  source.scheduled_events(events);
  std::uint64_t most = 0;
  for (std::uint32_t body = 0; body < bodies; ++body) {
    std::vector<std::uint64_t> scheduled(source.tree(body).size(), 0);
    for (const ScheduledEvent<float>& event : events)
      if (event.body == body) most = std::max(most, ++scheduled[event.node]);
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
  PaperTree paper(view, playback, topologies, first);
  const scenes::SeededNoise noise(4);
  std::uint64_t index = 0;
  Difference certificates, steps;
  for (std::uint32_t body = 0; body < view.body_count(); ++body) {
    const Topology& topology = topologies[body];
    const LeafVertices vertices = unique_leaf_vertices(topology, view.primitives(body));
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
        candidates += topology.nodes[node].is_leaf() ? double(vertices[node].size())
                                                     : double(topology.nodes[node].count());
      PlanChange<float> change;
      change.body = body;
      change.vertex = v;
      for (float& x : change.velocity) x = float(noise.signed_unit(index++));
      playback.change_plans(first, {&change, 1});
      const Counters before = paper.strategy().counters();
      paper.strategy().flight_plans_changed(first, {&change, 1});
      const Counters after = paper.strategy().counters();
      Difference made;
      made.add(before, after, Counter::certificates_made);
      certificates.add(before, after, Counter::certificates_made);
      steps.add(before, after, Counter::queue_steps);
      run.update_share = std::max(run.update_share, double(made.sum) / (6 * candidates));
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

  CountRun run{.scene = scene.name, .triangles = scene.primitive_count()};
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

  PaperTree paper(view, playback, topologies, keyframes.front());
  Difference visited, steps, operations, certificates;
  for (std::size_t k = 0; k < keyframes.size(); ++k) {
    playback.seek(keyframes[k]);
    for (;;) {
      const Counters before = paper.strategy().counters();
      if (!paper.step(keyframes[k])) break;
      const Counters after = paper.strategy().counters();
      visited.add(before, after, Counter::nodes_visited);
      operations.add(before, after, Counter::queue_operations);
      certificates.add(before, after, Counter::certificates_made);
      steps.add(before, after, Counter::queue_steps);
      run.values += paper.touched().size();
      run.silent_events += paper.touched().empty();
      ++run.events;
    }
    paper.strategy().advance(keyframes[k]);
    if (k == 0 || k == keyframes.size() / 2 || k + 1 == keyframes.size()) {
      count_vertex_certificates(paper.source(), view, run);
      run.most_of_node = std::max(run.most_of_node, most_events_of_a_node(paper.source(), view.body_count()));
    }
  }
  run.queue_peak = paper.counted(Counter::queue_peak);
  run.bytes = paper.strategy().bytes();
  run.sum_visited = visited.sum, run.max_visited = visited.most;
  run.sum_steps = steps.sum, run.max_steps = steps.most;
  run.sum_operations = operations.sum, run.max_operations = operations.most;
  run.sum_certificates = certificates.sum, run.max_certificates = certificates.most;
  return run;
}

}  // namespace kbvh::theory
