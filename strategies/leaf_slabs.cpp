// Bottom-up refit whose leaves have a slab as well as a box: two parallel planes, across the mean normal of
// the leaf's triangles, that enclose the leaf (the slabs of Kay & Kajiya 1986, in a single direction chosen
// for each leaf). Where the boxes of two leaves overlap, the triangles of each leaf are compared with the
// slab of the other, many at a time, before any two triangles are. A leaf of a smooth surface is flat, so its
// slab is thin. Where surfaces lie on each other, as cloth does on a body, hardly a pair is left; where they
// cross, only pairs near the curve of intersection are left. Slabs are made where a query needs them, which
// costs two thirds as much as the boxes of a leaf's triangles. Needs no foresight; bodies that are not made
// of triangles are queried by boxes. It is a declared baseline: it refits, and knows nothing of the future.
//
// When it wins: with exact tests. By plan `motion` (float, l = 1) it is 0.99 to 2.6 times (a0efb8c, AMD EPYC)
// and 0.88 to 2.2 times (b9393a5, Intel Xeon) as fast as the best refit by boxes alone: most on a dancer's
// skirt and a recorded tablecloth, least on a morph stress test, whose leaves are rough.
#include "core/contract/registry.hpp"
#include "core/families/slabs/slab_strategy.hpp"

namespace kbvh {
namespace {

template <class S>
class LeafSlabs final : public SlabStrategy<S, StoredHierarchyStrategy<S>>,
                        public AnswersSelfPairs,
                        public AnswersSweeps<S>,
                        public TakesGeometryChanges<S> {
 public:
  static constexpr Foresight foresight = Foresight::none;
  using SlabStrategy<S, StoredHierarchyStrategy<S>>::SlabStrategy;

  void follow_geometry(double /*t*/, const GeometryChange<S>& change) override {
    for (SlabBlocks<S>& blocks : this->blocks_) blocks.positions_changed();
    this->edit_geometry(change);
    this->find_accepted();
  }
  void find_swept_pairs(double /*t0*/, double /*t1*/, std::span<const S* const> before,
                        PairBuffer& out) override {
    this->sweep(before, out);
  }

 private:
  void update(std::uint32_t body) override { this->refit_counted(body); }
};

}  // namespace
}  // namespace kbvh

KBVH_STRATEGY(leaf_slabs) {
  using namespace kbvh;
  return {make_entry<LeafSlabs>({
      .id = "leaf_slabs",
      .title = "refit with slabs at the leaves",
      .family = "refit",
      .citation = "kbvh; slabs after Kay & Kajiya 1986",
      .baseline = true,
      .declares = {.time_budget = true},
      .topology = {.preferred = {.method = BuildMethod::median, .width = 8, .leaf_size = 16}},
  })};
}
