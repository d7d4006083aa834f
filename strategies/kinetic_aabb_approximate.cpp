// The kinetic AABB tree without exact arithmetic: event times are floats or doubles, and a certificate fails
// where two lines cross. It shows the benefit of the exact decisions of kinetic_aabb.

#include "core/contract/registry.hpp"
#include "core/families/events/kinetic_tree_strategy.hpp"
#include "core/families/events/rounded_clock.hpp"

namespace kbvh {
namespace {

template <class S>
using Approximate = KineticAabbStrategy<S, AvlEventQueue<RoundedClock<S>>>;

template <class S>
class KineticAabbApproximate final : public Approximate<S> {
 public:
  KineticAabbApproximate(const SceneView<S>& scene, const ClipMotion<S>& motion, Topologies topologies,
                         const Params& params)
      : Approximate<S>(scene, motion, std::move(topologies), 0, KineticQuery::wide_rows) {
    this->on_forest([&](auto& forest) {
      forest.clock().choose(
          params.word("event_times") == "float" ? EventTimes::in_float : EventTimes::in_double,
          params.word("formula") == "textbook" ? FailureRule::textbook : FailureRule::end_point_rule);
    });
  }
};

}  // namespace
}  // namespace kbvh

KBVH_STRATEGY(kinetic_aabb_approximate) {
  using namespace kbvh;
  return {make_entry<KineticAabbApproximate>({
      .id = "kinetic_aabb_approximate",
      .title = "kinetic AABB tree, rounded times",
      .family = "approximate",
      .citation = "Zachmann & Weller 2006, s.4, Algorithm 3",
      .tightness = Tightness::none,
      .guarantee = Guarantee::approximate,
      .rays_guarantee = Guarantee::approximate,
      .positions = PositionUse::fetched,
      .declares = {.event_driven = true, .continuous = true, .time_budget = true},
      .topology = {.preferred = {.method = BuildMethod::median, .width = 2, .leaf_size = 1}},
      .parameters = {{"event_times",
                      "double",
                      {"double", "float"},
                      "arithmetic of event times and their comparisons (kinetic_aabb: exact)"},
                     {"formula",
                      "textbook",
                      {"textbook", "end_point_rule"},
                      "failure test: by the crossing of two lines, or by the values at the end of the "
                      "segment (as in kinetic_aabb)"}},
  })};
}
