// Bottom-up refit with a query that stops when its work for the frame is used up, and answers with the pairs
// found so far (the idea of time-critical collision detection; Klein & Zachmann 2003).

#include "core/contract/registry.hpp"
#include "core/families/wide/stored_hierarchy.hpp"

namespace kbvh {
namespace {

template <class S>
class BottomUpBudget final : public StoredHierarchyStrategy<S> {
  using Base = StoredHierarchyStrategy<S>;

 public:
  static constexpr Foresight foresight = Foresight::none;
  BottomUpBudget(const SceneView<S>& scene, const SampledMotion<S>& motion, Topologies topologies,
                 const Params& params)
      : Base(scene, motion, std::move(topologies), params),
        box_tests_(std::uint64_t(params.number("box_tests"))) {}

  /// The status reports the work that the budget left undone.
  QueryStatus find_candidates(double t, PairBuffer& out, const Budget& budget) override {
    return Base::find_candidates(t, out, {std::min(box_tests_, budget.box_tests)});
  }

 private:
  void update(std::uint32_t body) override { this->refit(body); }
  std::uint64_t box_tests_;
};

}  // namespace
}  // namespace kbvh

KBVH_STRATEGY(bottom_up_budget) {
  using namespace kbvh;
  return {make_entry<BottomUpBudget>({
      .id = "bottom_up_budget",
      .title = "bottom-up refit, query on a budget",
      .family = "approximate",
      .citation = "after Klein & Zachmann 2003",
      .guarantee = Guarantee::approximate,
      .declares = {.time_budget = true},
      .topology = {.preferred = {.method = BuildMethod::median, .width = 8, .leaf_size = 16}},
      .parameters = {{"box_tests",
                      "1000",
                      {},
                      "maximum number of box tests in the query of a frame",
                      1,
                      1e15,
                      Numbers::whole}},
  })};
}
