// Oriented boxes on eight-wide nodes, refit and query by SIMD.
#include "core/contract/registry.hpp"
#include "core/families/volumes/obb_hierarchy.hpp"
#include "core/families/volumes/volume_strategy.hpp"

namespace kbvh {
namespace {

template <class S, class Count>
class OrientedBoxes final : public HierarchyStrategy<S, Count, ObbHierarchy<S>> {
  using Base = HierarchyStrategy<S, Count, ObbHierarchy<S>>;

 public:
  OrientedBoxes(const SceneView<S>& scene, const SampledMotion<S>& motion, Topologies topologies,
                const Params& params)
      : Base(scene, motion, std::move(topologies), 0) {
    const ObbFrameRule rule{params.word("frames") == "followed", std::uint32_t(params.number("every"))};
    this->on_bodies([&](auto& bodies) {
      for (auto& body : bodies) body.set_rule(rule);
    });
  }
};

}  // namespace
}  // namespace kbvh

KBVH_STRATEGY(oriented_boxes) {
  using namespace kbvh;
  return {make_entry<OrientedBoxes>({
      .id = "oriented_boxes",
      .title = "oriented boxes",
      .family = "volumes",
      .citation = "Gottschalk, Lin & Manocha 1996; frames after Larsson & Källberg 2011",
      .tightness = Tightness::conservative,
      .declares = {.time_budget = true},
      .topology = {.widths = {8}, .preferred = {.method = BuildMethod::median, .width = 8, .leaf_size = 4}},
      .parameters =
          {{"frames",
            "followed",
            {"followed", "fixed"},
            "followed: the axes of a box turn with three of the vertices below; fixed: they stay as "
            "chosen"},
           {"every",
            "0",
            {},
            "refits until all axes, or triples of vertices, are chosen anew; 0: only at the start",
            0,
            1e6,
            Numbers::whole}},
  })};
}
