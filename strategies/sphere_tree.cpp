// Sphere tree on eight-wide nodes, refit and query by SIMD.
#include "core/contract/registry.hpp"
#include "core/families/volumes/sphere_hierarchy.hpp"
#include "core/families/volumes/volume_strategy.hpp"

namespace kbvh {
namespace {

template <class S, class Count>
class SphereTree final : public HierarchyStrategy<S, Count, SphereHierarchy<S, SphereBounds::wrapped>,
                                                  SphereHierarchy<S, SphereBounds::layered>> {
  using Base = HierarchyStrategy<S, Count, SphereHierarchy<S, SphereBounds::wrapped>,
                                 SphereHierarchy<S, SphereBounds::layered>>;

 public:
  SphereTree(const SceneView<S>& scene, const SampledMotion<S>& motion, Topologies topologies,
             const Params& params)
      : Base(scene, motion, std::move(topologies), params.word("bounds") == "wrapped" ? 0 : 1) {}
};

}  // namespace
}  // namespace kbvh

KBVH_STRATEGY(sphere_tree) {
  using namespace kbvh;
  return {make_entry<SphereTree>({
      .id = "sphere_tree",
      .title = "sphere tree",
      .family = "volumes",
      .citation =
          "Hubbard 1996; Bradshaw & O'Sullivan 2004; wrapped and layered: Agarwal, Guibas et al. 2004",
      .tightness = Tightness::conservative,
      .declares = {.time_budget = true},
      .topology = {.widths = {8}, .preferred = {.method = BuildMethod::median, .width = 8, .leaf_size = 4}},
      .parameters = {{"bounds",
                      "wrapped",
                      {"wrapped", "layered"},
                      "what a node's sphere contains: the points below, or the spheres of its children"}},
  })};
}
