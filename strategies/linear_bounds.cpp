// Boxes that are linear in time: computed at both ends of each segment in which all flight plans are known to
// be straight, and interpolated by the query at the nodes that it visits: for pairs within a body, at all of
// its nodes. Frames update nothing. Where vertices move on curves, boxes grow by the most that a curve may
// leave its chord. Prior art: core/adr/0010-prior-art-of-answering-intervals.md.

#include "core/families/linear/linear_bounds.hpp"

#include "core/contract/registry.hpp"
#include "core/families/linear/linear_probes.hpp"

namespace kbvh {
namespace {

template <class S>
class LinearBoundsStrategy final : public CountedStrategy<S>,
                                   public AnswersSelfPairs,
                                   public AnswersProbes<S>,
                                   public TakesPlanChanges<S> {
 public:
  static constexpr Foresight foresight = Foresight::next_keyframe;

  LinearBoundsStrategy(const SceneView<S>& scene, const SegmentMotion<S>& motion, Topologies topologies,
                       const Params& params)
      : CountedStrategy<S>(scene, motion),
        bounds_(scene, motion, std::move(topologies), active_kernel_set(), linear_settings(params)),
        stale_(scene.body_count()),
        updates_(scene.body_count()) {
    for (std::uint32_t body = 0; body < scene.body_count(); ++body)
      stale_[body].resize(bounds_.hierarchy(body).node_count());
  }

  void reset_to(double /*t*/) override {
    bounds_.start();
    new_frame();
  }

  void advance_to(double /*t*/) override {
    bounds_.advance();
    new_frame();
  }

  QueryStatus find_candidates(double t, PairBuffer& out, const Budget& budget) override {
    QueryStatus status;
    std::uint64_t tests = 0;
    for (const std::uint32_t i : bounds_.segment().near_pairs) {
      const BodyPair& pair = this->scene_.pairs()[i];
      if (tests >= budget.box_tests) {
        ++status.pending;
        continue;
      }
      const WideMoment<S> first = moment(pair.first, t), second = moment(pair.second, t);
      const bool self = pair.first == pair.second;
      if (self) make_boxes(first, pair.first);
      const WideSide<S> a = side(pair.first, self ? nullptr : &first);
      const WideSide<S> b = side(pair.second, self ? nullptr : &second);
      status.pending += query_.run(a, b, out, tests, rest_of(budget, tests)).pending;
    }
    this->count_.add(Counter::box_tests, tests);
    return status;
  }

  void answer_probes(double t, const Probes<S>& probes) override {
    std::uint64_t tests = 0;
    probes_.answer(bounds_, t, stale_, probes, this->triangle_stats_, tests, this->ray_bodies());
    this->count_.add(Counter::box_tests, tests);
  }

  void follow_plans(double /*t*/, std::span<const PlanChange<S>> changes) override {
    if (!bounds_.repair(changes)) bounds_.plans_changed();
    bounds_.clear_changed();
    new_frame();
  }

  std::optional<AuditView> audit_view(std::uint32_t body) const override {
    return bounds_.audit_view(body, this->time());
  }

  std::size_t bytes() const override {
    std::size_t total = bounds_.bytes() + query_.bytes() + probes_.bytes();
    for (const auto& marks : stale_) total += marks.size();
    return total;
  }

 protected:
  void counts_cleared() override { updates_.skip(bounds_); }
  void add_counts(Counters& table) const override { updates_.add_to(table, bounds_); }

 private:
  void new_frame() {
    for (std::uint32_t body = 0; body < bounds_.body_count(); ++body) {
      bounds_.hierarchy(body).positions_changed();
      std::fill(stale_[body].begin(), stale_[body].end(), 1);
    }
  }
  /// Computes the remaining boxes of a body at a moment.
  void make_boxes(const WideMoment<S>& moment, std::uint32_t body) {
    const auto& hierarchy = bounds_.hierarchy(body);
    const auto make = wide_linear_kernels<S>(hierarchy.kernels()).make(hierarchy.width());
    for (std::uint32_t node = 0; node < hierarchy.node_count(); ++node) {
      if (moment.stale[node] == 0) continue;
      make(moment, node);
      moment.stale[node] = 0;
    }
  }
  /// `moment`: null if all boxes of the body are those of the moment.
  WideSide<S> side(std::uint32_t body, const WideMoment<S>* moment) {
    return {.hierarchy = &bounds_.hierarchy(body), .body = body, .moment = moment};
  }
  WideMoment<S> moment(std::uint32_t body, double t) {
    return {bounds_.hierarchy(body).arrays(), bounds_.side(body).ends(), stale_[body].data(),
            bounds_.fraction(t)};
  }

  LinearBounds<S> bounds_;
  WideQuery<S> query_{this->scene_, this->sampled_};
  LinearProbes<S> probes_{this->scene_, this->sampled_};
  std::vector<std::vector<std::uint8_t>> stale_;  ///< [body][wide node]
  LinearCounts<S> updates_;
};

}  // namespace
}  // namespace kbvh

KBVH_STRATEGY(linear_bounds) {
  using namespace kbvh;
  return {make_entry<LinearBoundsStrategy>({
      .id = "linear_bounds",
      .title = "bounds linear in time",
      .family = "linear",
      .citation =
          "kbvh; linear boxes of moving triangles as in motion-blur hierarchies (Christensen et al. 2006)",
      .tightness = Tightness::conservative,
      .positions = PositionUse::fetched,
      .declares = {.continuous = true, .time_budget = true, .curves = true},
      .topology = {.preferred = {.method = BuildMethod::median, .width = 8, .leaf_size = 16}},
      .parameters = linear_parameters(),
  })};
}
