// Oriented boxes on eight-wide nodes (Gottschalk, Lin and Manocha 1996), eight children at a time in refit
// and query, which tests 15 separating axes. Each box contains the points below its node, not its children's
// boxes. Its frame is the direction of an edge and a normal of three points that are chosen at the start, and
// turns with them. New frames at every frame of the clip make 1 % fewer tests and a refit 60 times as long;
// fixed axes make 1.6 times as many tests (cloth of 65k triangles that clings to a ball). Measured at 65k
// triangles, in all: oriented boxes take 1.7 times (leaves of 16) as long as aligned ones (`bottom_up`) on
// the built-in tablecloth, and 1.9 times (leaves of 8) on mixing swarms. Their queries are faster only where
// surfaces cling to each other: two thirds of the time on the cloth around a ball. Sides are products of
// directions and coordinates, and their rounding errors grow with the centre's coordinates along all axes.
// Far from the origin, where these errors exceed the gap between bodies, oriented boxes take more than 20
// times the box tests of `bottom_up`.
#include "core/contract/registry.hpp"
#include "core/families/volumes/obb_hierarchy.hpp"
#include "core/families/volumes/volume_strategy.hpp"

namespace kbvh {
namespace {

template <class S>
class OrientedBoxes final : public HierarchyStrategy<S, ObbHierarchy<S>> {
  using Base = HierarchyStrategy<S, ObbHierarchy<S>>;

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
      .topology = {.widths = {8}, .preferred = {.method = BuildMethod::median, .width = 8, .leaf_size = 8}},
      .parameters =
          {{"frames",
            "followed",
            {"followed", "fixed"},
            "followed: the axes of a box turn with three of the vertices below; fixed: they stay as "
            "chosen"},
           {"every",
            "0",
            {},
            "refits until all axes, or triples of vertices, are chosen again; 0: only at the start",
            0,
            1e6,
            Numbers::whole}},
  })};
}
