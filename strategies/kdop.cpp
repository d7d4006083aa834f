// Bottom-up refit of k-DOPs with 14, 18 or 26 sides, by SIMD: the lanes of a vector are the sides of one
// node. They lie next to each other, so a node takes a few instructions in the refit and in the query.
#include "core/contract/registry.hpp"
#include "core/families/volumes/dop_hierarchy.hpp"
#include "core/families/volumes/volume_strategy.hpp"

namespace kbvh {
namespace {

template <class S>
class Kdop final
    : public HierarchyStrategy<S, DopHierarchy<S, 14>, DopHierarchy<S, 18>, DopHierarchy<S, 26>> {
  using Base = HierarchyStrategy<S, DopHierarchy<S, 14>, DopHierarchy<S, 18>, DopHierarchy<S, 26>>;

 public:
  Kdop(const SceneView<S>& scene, const SampledMotion<S>& motion, Topologies topologies, const Params& params)
      : Base(scene, motion, std::move(topologies),
             params.word("sides") == "14"   ? 0
             : params.word("sides") == "18" ? 1
                                            : 2) {}
};

}  // namespace
}  // namespace kbvh

KBVH_STRATEGY(kdop) {
  using namespace kbvh;
  return {make_entry<Kdop>({
      .id = "kdop",
      .title = "k-DOP refit",
      .family = "volumes",
      .citation = "Klosowski et al. 1998",
      .tightness = Tightness::conservative,  // because of the margins for roundings
      .declares = {.time_budget = true},
      .topology = {.preferred = {.method = BuildMethod::median, .width = 8, .leaf_size = 4}},
      .parameters = {{"sides", "18", {"14", "18", "26"}, "sides of every node's k-DOP"}},
  })};
}
