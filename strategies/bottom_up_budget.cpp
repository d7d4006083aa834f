// Bottom-up refit with a query that stops when it has used up its work for the frame: what it has found by
// then is the answer (the idea of time-critical collision detection; Klein & Zachmann 2003).

#include <cmath>

#include "core/contract/registry.hpp"
#include "core/families/wide/stored_hierarchy.hpp"

namespace kbvh {
namespace {

/// The parameter box_tests. Throws ConfigError unless it is a whole number that a counter can reach.
std::uint64_t chosen_box_tests(const Params& params) {
  const double wanted = params.number("box_tests");
  if (!(wanted <= 1e15) || wanted != std::floor(wanted))
    throw ConfigError("bottom_up_budget: box_tests must be a whole number from 1 to 1e15, got " +
                      params.word("box_tests"));
  return std::uint64_t(wanted);
}

template <class S, class Count>
class BottomUpBudget final : public StoredHierarchyStrategy<S, Count> {
  using Base = StoredHierarchyStrategy<S, Count>;

 public:
  static constexpr Foresight foresight = Foresight::none;
  BottomUpBudget(const SceneView<S>& scene, const SampledMotion<S>& motion, Topologies topologies,
                 const Params& params)
      : Base(scene, motion, std::move(topologies), params), box_tests_(chosen_box_tests(params)) {}

  /// What the budget leaves undone is counted in the status.
  QueryStatus candidates_at(double t, PairBuffer& out, const Budget& budget) override {
    return Base::candidates_at(t, out, {std::min(box_tests_, budget.box_tests)});
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
      .can = {.plan_changes = true, .time_budget = true},
      .topology = {.preferred = {.method = BuildMethod::median, .width = 8, .leaf_size = 16}},
      .parameters = {{"box_tests", "1000", {}, "box tests that the query of a frame may take", 1}},
  })};
}
