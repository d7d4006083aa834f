#include <stdexcept>

#include "core/families/boxtree/kinetic_boxtree.hpp"
#include "experiments/theory/measure_boxtree.hpp"
#include "experiments/theory/measure_counts.hpp"
#include "experiments/theory/theory_scenes.hpp"

namespace kbvh::theory {

// The trees of this measurement are split on given axes. No registered strategy makes such trees, because
// they only show what a search can cost; so this file has its own forest.

namespace {

/// Points that wander on the first `dimensions` axes, and the axes on which their tree is split.
struct SplitTree {
  std::size_t dimensions;
  int root_axis, inner_axis;
};

SplitTree split_tree(const std::string& name) {
  if (name == "one axis") return {1, 0, 0};
  if (name == "root x, else y") return {2, 0, 1};
  if (name == "mixed") return {3, best_axis, best_axis};
  throw std::invalid_argument("no tree '" + name + "'");
}

}  // namespace

SearchRun measure_searches(const std::string& tree_name, std::uint32_t leaves) {
  const SplitTree split = split_tree(tree_name);
  const Scene<float> scene = wandering_points(leaves, split.dimensions);
  const SceneView<float> view(scene);
  Playback<float> playback(scene);
  const std::vector<double> keyframes = overlaid_keyframes(scene);
  playback.seek(keyframes.front());
  Counters count;
  KineticBoxForest<float, AvlQueue<float>> forest(view, ClipMotion<float>(playback),
                                                  build_topologies(view, playback, paper_builder), count);
  auto& tree = forest.tree(0);
  tree.construct_as({.root_axis = split.root_axis, .inner_axis = split.inner_axis});
  forest.reset(keyframes.front());
  tree.search_cost().forget();
  SearchRun run;
  run.tree = tree_name;
  run.leaves = scene.primitive_count();
  while (forest.due(keyframes.back())) {
    const std::uint64_t searched = tree.search_cost().nodes;
    const std::uint32_t node = tree.node_of(forest.queue().top().slot);
    forest.handle_next();
    ++run.events;
    if (node != 1 && node != 2) continue;
    ++run.events_of_root;
    run.searched_by_root += tree.search_cost().nodes - searched;
  }
  run.searches = tree.search_cost().searches;
  run.searched = tree.search_cost().nodes;
  run.most_searched = tree.search_cost().most_nodes;
  return run;
}

}  // namespace kbvh::theory
