#include "experiments/theory/measure_boxtree.hpp"

#include <algorithm>
#include <stdexcept>

#include "core/contract/registry.hpp"
#include "core/families/boxtree/kinetic_boxtree.hpp"
#include "experiments/theory/kinetic_log.hpp"
#include "experiments/theory/measure_counts.hpp"
#include "experiments/theory/theory_scenes.hpp"

namespace kbvh::theory {

namespace {

/// Counts notices, and keeps those that are to be proved.
struct BoxTreeObserver {
  std::uint64_t* notices;
  std::vector<Notice<float>>* log;
  template <class S>
  void realiser_changed(std::uint32_t body, std::uint32_t node, Side side, std::uint32_t old_vertex,
                        std::uint32_t new_vertex, const Instant<S>& now) {
    ++*notices;
    if (log != nullptr)
      log->push_back({{body, node, side, old_vertex, new_vertex, now.begin, now.exact != nullptr,
                       now.exact != nullptr ? *now.exact : Crossing<S>{}},
                      0});
  }
};

using Forest = KineticBoxForest<float, AvlQueue<float>, Counting, BoxTreeObserver>;

/// Returns the realisers of all bounds that a tree stores, [6 * node + side]; `no_bound` elsewhere.
std::vector<std::uint32_t> stored_bounds(const Forest::Tree& tree) {
  std::vector<std::uint32_t> bounds(std::size_t(6) * tree.topology().size(), no_bound);
  for (std::uint32_t node = 0; node < tree.topology().size(); ++node)
    for (Side side = 0; side < 6; ++side)
      if (node == 0 || tree.own_side(node) == side)
        bounds[std::size_t(6) * node + side] = tree.realiser(node, side);
  return bounds;
}

/// Counts upper bounds of the certificates of every vertex: per leaf it is a candidate of one certificate per
/// side; for each bound that it realises it is the winner of one, and a candidate of the one above.
void count_vertex_certificates(const Forest::Tree& tree, const Primitives& primitives, std::uint32_t vertices,
                               BoxTreeRun& run) {
  std::vector<std::uint64_t> certificates(vertices, 0), leaves(vertices, 0);
  for (const TopologyNode n : tree.topology().nodes) {
    if (!n.is_leaf()) continue;
    for (std::uint32_t i = n.first(); i < n.first() + n.count(); ++i)
      for (const std::uint32_t v : primitives[tree.topology().primitives[i]])
        ++leaves[v], certificates[v] += 6;
  }
  for (const std::uint32_t v : stored_bounds(tree))
    if (v != no_bound) certificates[v] += 2;
  for (std::uint32_t v = 0; v < vertices; ++v) {
    run.max_leaves_of_vertex = std::max(run.max_leaves_of_vertex, leaves[v]);
    run.max_vertex_certificates = std::max(run.max_vertex_certificates, certificates[v]);
  }
}

/// Returns the largest number of events scheduled for the two planes of an inner node.
std::uint64_t most_events_of_planes(const Forest& forest, const Forest::Tree& tree) {
  std::uint64_t most = 0;
  for (const TopologyNode n : tree.topology().nodes) {
    if (n.is_leaf()) continue;
    std::uint64_t scheduled = 0;
    for (std::uint32_t child = n.first(); child < n.first() + n.count(); ++child)
      scheduled += forest.queue().scheduled(tree.first_slot() + 5 + child);
    most = std::max(most, scheduled);
  }
  return most;
}

/// What the strategy holds, as its AABB tree's bytes are counted (CountRun).
std::uint64_t bytes_of_strategy(const SceneView<float>& view, Playback<float>& playback,
                                const Topologies& topologies, double t) {
  const StrategyEntry& entry = find_strategy("kinetic_boxtree");
  const auto strategy =
      create(entry, view, playback, topologies,
             Params(entry.info.id, entry.info.parameters, {{"queue", "avl"}}), CountingPolicy::silent);
  playback.seek(t);
  strategy->reset(t);
  return strategy->bytes();
}

std::vector<BoundChange> changes_of(const std::vector<Notice<float>>& log, const ExactMotion& motion,
                                    std::uint32_t body) {
  std::vector<BoundChange> result;
  for (const Notice<float>& notice : log)
    if (notice.body == body)
      result.push_back(
          {notice.node, notice.side, notice.old_vertex, notice.new_vertex, when_of(notice.crossing, motion)});
  return result;
}

}  // namespace

BoxTreeRun measure_boxtree(const Scene<float>& scene, const CountRun& counts, Proof proof) {
  const SceneView<float> view(scene);
  const std::vector<double> keyframes = overlaid_keyframes(scene);
  Playback<float> playback(scene);
  playback.seek(keyframes.front());
  const Topologies topologies = build_topologies(view, playback, paper_builder);
  BoxTreeRun run;
  run.scene = scene.name;
  run.triangles = scene.primitive_count();
  run.aabb_events = counts.events, run.aabb_values = counts.values, run.aabb_bytes = counts.bytes;
  run.depth = counts.depth;
  for (const Topology& topology : topologies) {
    run.nodes += topology.size();
    for (const TopologyNode n : topology.nodes) run.inner_nodes += !n.is_leaf();
    run.certificates += Forest::Tree::slot_count(topology);
    ++run.trees;
  }
  Counting count;
  std::uint64_t notices = 0;
  std::vector<Notice<float>> log;
  Forest forest(view, ClipMotion<float>(playback), topologies, count,
                BoxTreeObserver{&notices, proof == Proof::none ? nullptr : &log});
  forest.reset(keyframes.front());
  std::vector<std::vector<std::uint32_t>> start;
  for (std::uint32_t body = 0; body < view.body_count(); ++body) {
    if (proof != Proof::none) start.push_back(stored_bounds(forest.tree(body)));
    forest.tree(body).search_cost().forget();
  }
  run.queue_peak = forest.queue().size();
  for (const double t : keyframes) {
    while (forest.due(t)) {
      const std::uint64_t before = notices;
      forest.handle_next();
      run.silent_events += notices == before;
      run.queue_peak = std::max<std::uint64_t>(run.queue_peak, forest.queue().size());
      ++run.events;
    }
    for (std::uint32_t body = 0; body < view.body_count(); ++body)
      run.most_of_planes = std::max(run.most_of_planes, most_events_of_planes(forest, forest.tree(body)));
  }
  run.values = notices;
  run.bytes = bytes_of_strategy(view, playback, topologies, keyframes.front());
  for (std::uint32_t body = 0; body < view.body_count(); ++body) {
    const SearchCost& cost = forest.tree(body).search_cost();
    run.searches += cost.searches, run.searched += cost.nodes;
    run.most_searched = std::max(run.most_searched, cost.most_nodes);
    count_vertex_certificates(forest.tree(body), view.primitives(body), view.vertex_count(body), run);
    if (proof == Proof::none) continue;
    try {
      const ExactMotion motion(stored_plans(scene.bodies[body].plans), keyframes.front(), keyframes.back());
      const EnvelopeReport report =
          check_envelopes(motion, vertices_below(topologies[body], view.primitives(body)), start[body],
                          changes_of(log, motion, body), stored_bounds(forest.tree(body)));
      run.proved += report.bounds;
      if (run.violation.empty()) run.violation = report.violation;
    } catch (const std::logic_error& error) {
      run.violation = error.what();  // an event whose pieces do not meet, or not in the clip
    }
  }
  return run;
}

namespace {

/// All nodes are split on x.
struct OneAxis : BoxTreeRules {
  static int split_axis(int) { return 0; }
};
/// The root is split on x, all else on y.
struct Adversarial : BoxTreeRules {
  static int split_axis(int depth) { return depth == 0 ? 0 : 1; }
};

template <class Rules>
struct Ruled {
  template <class S, class Queue, class Count, class Observer>
  using Tree = KineticBoxTree<S, Queue, Count, Observer, Rules>;
};

template <class Rules>
SearchRun search(const Scene<float>& scene) {
  const SceneView<float> view(scene);
  Playback<float> playback(scene);
  const std::vector<double> keyframes = overlaid_keyframes(scene);
  playback.seek(keyframes.front());
  Counting count;
  KineticForest<float, AvlQueue<float>, Counting, NoObserver, Ruled<Rules>::template Tree> forest(
      view, ClipMotion<float>(playback), build_topologies(view, playback, paper_builder), count);
  forest.reset(keyframes.front());
  auto& tree = forest.tree(0);
  tree.search_cost().forget();
  SearchRun run;
  run.leaves = scene.primitive_count();
  while (forest.due(keyframes.back())) {
    const SearchCost before = tree.search_cost();
    const std::uint32_t slot = forest.queue().top().slot, node = slot < 6 ? 0 : slot - 5;
    forest.handle_next();
    ++run.events;
    if (node != 1 && node != 2) continue;
    ++run.events_of_root;
    run.searched_by_root += tree.search_cost().nodes - before.nodes;
  }
  run.searches = tree.search_cost().searches;
  run.searched = tree.search_cost().nodes;
  run.most_searched = tree.search_cost().most_nodes;
  return run;
}

}  // namespace

SearchRun measure_searches(const std::string& tree, std::uint32_t leaves) {
  SearchRun run;
  if (tree == "one axis")
    run = search<OneAxis>(wandering_points(leaves, 1));
  else if (tree == "root x, else y")
    run = search<Adversarial>(wandering_points(leaves, 2));
  else if (tree == "mixed")
    run = search<BoxTreeRules>(wandering_points(leaves, 3));
  else
    throw std::invalid_argument("no tree '" + tree + "'");
  run.tree = tree;
  return run;
}

}  // namespace kbvh::theory
