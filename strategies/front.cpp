// A front of the bounding volume test tree (Li & Chen 1998; Ehmann & Lin 2001; Tang et al. 2009), between
// hierarchies that are refitted at every frame: the pairs of nodes that overlapped at the last frame, from
// which the next one descends or climbs (core/families/front/pair_front.hpp). Needs no foresight. One sweep
// compares all children of a pair of wide nodes, including the disjoint ones, so the front saves no box
// tests; it saves the stack, and branches that depend on which boxes overlap.
//
// It is a declared baseline. It refits every box at every frame and knows nothing of the future. Its query
// remembers the last frame, but that is no foresight, and excluding a refit from the best refit would flatter
// the others.
//
// When it wins: by little. In the cells of analysis/reference/cells.json it is the best refit of a cloth with
// itself (1.03 times as fast as `leaf_slabs`), of a morph stress test (1.01), and by rays where bodies mix or
// a cloth lies on a table. Where few pairs of nodes change from frame to frame, the traversal is a small part
// of a query; the rest is pairs of leaves and triangles, which a front does not change.
#include "core/contract/registry.hpp"
#include "core/families/front/pair_front.hpp"
#include "core/families/wide/stored_hierarchy.hpp"

namespace kbvh {
namespace {

template <class S>
class FrontTracking final : public EditedHierarchyStrategy<S> {
  using Base = EditedHierarchyStrategy<S>;

 public:
  static constexpr Foresight foresight = Foresight::none;
  using Base::Base;

  void reset_to(double t) override {
    Base::reset_to(t);
    front_.clear();
  }
  QueryStatus find_candidates(double /*t*/, PairBuffer& out, const Budget& budget) override {
    QueryStatus status;
    std::uint64_t tests = 0;
    front_.start_frame();
    this->for_near_bodies(tests, [&](const BodyPair& pair) {
      const auto index = std::uint32_t(&pair - this->scene_.pairs().data());
      status.pending += front_
                            .run(index, this->side(pair.first), this->side(pair.second), this->query_, out,
                                 tests, rest_of(budget, tests))
                            .pending;
    });
    this->count_.add(Counter::box_tests, tests);
    entries_ += front_.entries().size();
    return status;
  }
  std::size_t bytes() const override { return Base::bytes() + front_.bytes(); }

 private:
  void update(std::uint32_t body) override { this->refit_counted(body); }
  void topology_changed(std::uint32_t /*body*/) override { front_.clear(); }
  void counts_cleared() override {
    entries_ = 0;
    descended_ = front_.descended();
    climbed_ = front_.climbed();
  }
  void add_counts(Counters& table) const override {
    table.add("front_pairs", entries_);
    table.add("front_descents", front_.descended() - descended_);
    table.add("front_climbs", front_.climbed() - climbed_);
  }

  PairFront<S> front_;
  std::uint64_t entries_ = 0;  // summed over frames
  std::uint64_t descended_ = 0, climbed_ = 0;
};

}  // namespace
}  // namespace kbvh

KBVH_STRATEGY(front) {
  using namespace kbvh;
  return {make_entry<FrontTracking>({
      .id = "front",
      .title = "front of the test tree",
      .family = "refit",
      .citation = "Li & Chen 1998; Ehmann & Lin 2001; Tang et al. 2009",
      .baseline = true,
      .declares = {.time_budget = true},
      .topology = {.preferred = {.method = BuildMethod::median, .width = 8, .leaf_size = 16}},
  })};
}
