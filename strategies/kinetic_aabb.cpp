// The kinetic AABB tree (Z&W 2006, s.4), with the errata of the reproduction: tight at every time, updated at
// events only.

#include "core/contract/registry.hpp"
#include "core/families/events/kinetic_aabb_strategy.hpp"

namespace kbvh {
namespace {

template <class S, class Count>
class KineticAabb final : public ExactKineticAabbStrategy<S, Count, AvlQueue<S>, BinaryHeapQueue<S>> {
 public:
  KineticAabb(const SceneView<S>& scene, const ClipMotion<S>& motion, Topologies topologies,
              const Params& params)
      : ExactKineticAabbStrategy<S, Count, AvlQueue<S>, BinaryHeapQueue<S>>(
            scene, motion, std::move(topologies), params.word("queue") == AvlQueue<S>::name ? 0 : 1) {}
};

}  // namespace
}  // namespace kbvh

KBVH_STRATEGY(kinetic_aabb) {
  using namespace kbvh;
  return {make_entry<KineticAabb>({
      .id = "kinetic_aabb",
      .title = "kinetic AABB tree",
      .family = "kinetic",
      .citation = "Zachmann & Weller 2006, s.4",
      .positions = PositionUse::fetched,
      .declares = {.continuous = true, .time_budget = true},
      .topology = {.preferred = {.method = BuildMethod::median, .width = 2, .leaf_size = 1}},
      .parameters = {{"queue",
                      "avl",
                      {"avl", "binary_heap"},
                      "event queue: the paper's AVL tree, or an indexed binary heap"}},
  })};
}
