// Bottom-up refit whose leaves have a slab beside the box: two parallel planes, across the mean normal of the
// leaf's triangles, between which the leaf lies (the slabs of Kay & Kajiya 1986, in one direction of the
// leaf's own). Where the boxes of two leaves overlap, the triangles of each are compared with the slab of the
// other, many at a time, before any two triangles are. A leaf of a smooth surface is flat, so its slab is
// thin: of surfaces that lie on each other, as cloth does on a body, hardly a pair is left, and of surfaces
// that cross, those near the curve of intersection. Slabs are made where a query needs them, which costs two
// thirds as much as the boxes of a leaf's triangles. Needs no foresight; bodies that are not made of
// triangles are queried by boxes. It is a declared baseline: it refits, and knows nothing of the future.
//
// When it wins: with exact tests and without interpolation (l = 1). By plan `motion` (e1bc2ef, Intel Xeon,
// float) it is 0.9 to 2.3 times as fast as `bottom_up`: most on a dancer's skirt and a recorded tablecloth,
// least on a morph stress test, whose leaves are rough.
#include "core/contract/registry.hpp"
#include "core/families/slabs/slab_query.hpp"
#include "core/families/wide/stored_hierarchy.hpp"

namespace kbvh {
namespace {

template <class S>
class LeafSlabs final : public StoredHierarchyStrategy<S>,
                        public AnswersSelfPairs,
                        public AnswersSweeps<S>,
                        public TakesGeometryChanges<S> {
  using Base = StoredHierarchyStrategy<S>;

 public:
  static constexpr Foresight foresight = Foresight::none;
  LeafSlabs(const SceneView<S>& scene, const SampledMotion<S>& motion, Topologies topologies,
            const Params& params)
      : Base(scene, motion, std::move(topologies), params), blocks_(scene.body_count()), slabs_(scene) {
    find_accepted();
  }

  void reset_to(double t) override {
    for (SlabBlocks<S>& blocks : blocks_) blocks.positions_changed();
    Base::reset_to(t);
  }
  void advance_to(double t) override {
    for (std::uint32_t body = 0; body < blocks_.size(); ++body)
      if (this->scene_.moving(body) || this->plans_changed_) blocks_[body].positions_changed();
    Base::advance_to(t);
  }
  void follow_geometry(double /*t*/, const GeometryChange<S>& change) override {
    for (SlabBlocks<S>& blocks : blocks_) blocks.positions_changed();
    this->edit_geometry(change);
    find_accepted();
  }
  void find_swept_pairs(double /*t0*/, double /*t1*/, std::span<const S* const> before,
                        PairBuffer& out) override {
    this->sweep(before, out);
  }

  QueryStatus find_candidates(double /*t*/, PairBuffer& out, const Budget& budget) override {
    QueryStatus status;
    std::uint64_t tests = 0;
    this->for_near_bodies(tests, [&](const BodyPair& pair) {
      if (tests >= budget.box_tests) {
        ++status.pending;
      } else if (accepted_[pair.first] != 0 && accepted_[pair.second] != 0) {
        status.pending +=
            slabs_.run(slab_side(pair.first), slab_side(pair.second), out, tests, rest_of(budget, tests))
                .pending;
      } else {
        status.pending +=
            this->query_
                .run(this->side(pair.first), this->side(pair.second), out, tests, rest_of(budget, tests))
                .pending;
      }
    });
    this->count_.add(Counter::box_tests, tests);
    this->last_box_tests_ = tests;
    return status;
  }

  std::size_t bytes() const override {
    std::size_t total = Base::bytes() + slabs_.bytes();
    for (const SlabBlocks<S>& blocks : blocks_) total += blocks.bytes();
    return total;
  }

 private:
  void update(std::uint32_t body) override { this->refit_counted(body); }
  void counts_cleared() override { slabs_.clear_counts(); }
  void add_counts(Counters& table) const override {
    table.add("leaf_pairs", slabs_.leaf_pairs());
    table.add("leaf_pairs_separated", slabs_.separated());
  }
  typename SlabQuery<S>::Side slab_side(std::uint32_t body) {
    return {&this->hierarchies_[body], body, &blocks_[body], this->sampled_.positions(body)};
  }
  /// Finds the bodies of triangles; where a leaf is one triangle, its box is the triangle's.
  void find_accepted() {
    accepted_.clear();
    for (std::uint32_t body = 0; body < this->scene_.body_count(); ++body)
      accepted_.push_back(
          SlabQuery<S>::accepts(this->scene_.primitives(body)) &&
          (this->hierarchies_[body].empty() || this->hierarchies_[body].padded_leaf_size() > 1));
  }
  std::vector<SlabBlocks<S>> blocks_;   ///< [body]
  std::vector<std::uint8_t> accepted_;  ///< [body]
  SlabQuery<S> slabs_;
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
