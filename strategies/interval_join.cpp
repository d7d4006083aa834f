// One time-parametrised traversal for each segment of the flight plans, over boxes that are linear in time,
// gives the pairs of primitives that come near each other in it and when; frames are read from that.

#include "core/hierarchy/interval_join.hpp"
#include "core/registry.hpp"

namespace kbvh {
namespace {

template <class S, class Count>
class IntervalJoinStrategy final : public Strategy<S> {
 public:
  static constexpr Foresight foresight = Foresight::next_keyframe;

  IntervalJoinStrategy(const SceneView<S>& scene, const SegmentMotion<S>& motion, Topologies topologies,
                       const Params& params)
      : Strategy<S>(scene, motion),
        bounds_(scene, motion, std::move(topologies), active_kernel_set(), segment_pieces(params)),
        joins_(scene.pairs().size()) {}

  void reset(double t) override {
    this->start_at(t);
    count_.table = {};
    first_fetch_ = this->sampled_.fetched();
    bounds_.start();
    new_segment();
  }

  void advance(double t) override {
    this->move_to(t);
    if (bounds_.advance()) new_segment();
  }

  QueryStatus candidates_at(double t, PairBuffer& out, const Budget& /*budget*/) override {
    if (!joined_) join();
    const float fraction = float(bounds_.fraction(t));
    for (IntervalJoin<S>& join : joins_) join.read(fraction, out);
    return {};
  }

  void flight_plans_changed(double t, std::span<const PlanChange<S>> /*changes*/) override {
    this->stand_at(t);
    bounds_.plans_changed();
    new_segment();
  }

  std::optional<AuditView> audit_view(std::uint32_t body) const override {
    return AuditView{bounds_.side(body).hierarchy.topology(), bounds_.boxes_at(body, this->time()), {}};
  }

  std::size_t bytes() const override {
    std::size_t total = bounds_.bytes();
    for (const auto& join : joins_) total += join.bytes();
    return total;
  }

 protected:
  Counters counted() const override {
    Counters table = count_.table;
    if constexpr (Count::enabled) table[Counter::positions_fetched] = this->sampled_.fetched() - first_fetch_;
    return table;
  }

 private:
  void new_segment() {
    if constexpr (Count::enabled) count_linear_update(bounds_, count_);
    joined_ = false;
  }
  void join() {
    std::uint64_t tests = 0;
    for (std::size_t i = 0; i < joins_.size(); ++i)
      joins_[i].join(bounds_, this->scene_.pairs()[i].first, this->scene_.pairs()[i].second, tests);
    count_.add(Counter::box_tests, tests);
    joined_ = true;
  }

  LinearBounds<S> bounds_;
  std::vector<IntervalJoin<S>> joins_;  ///< one for each pair of bodies
  bool joined_ = false;
  Count count_;
  std::uint64_t first_fetch_ = 0;
};

}  // namespace
}  // namespace kbvh

KBVH_STRATEGY(interval_join) {
  using namespace kbvh;
  return {make_entry<IntervalJoinStrategy>({
      .id = "interval_join",
      .title = "interval join",
      .family = "linear",
      .citation = "kbvh",
      .tightness = Tightness::conservative,
      .positions = PositionUse::fetched,
      .can = {.continuous = true, .plan_changes = true},
      .topology = {.preferred = {.method = BuildMethod::median, .width = 8, .leaf_size = 16}},
      .parameters = {segment_pieces_parameter()},
  })};
}
