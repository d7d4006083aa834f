// One time-parametrised traversal for each segment of the flight plans, over boxes that are linear in time,
// gives the pairs of primitives that come near each other in it and when; frames are read from that.

#include <algorithm>

#include "core/hierarchy/interval_join.hpp"
#include "core/hierarchy/span_answers.hpp"
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
        bounds_(scene, motion, std::move(topologies), active_kernel_set(), segment_cuts(params)),
        joins_(scene.pairs().size()),
        answers_(scene.pairs().size()),
        by_spans_(scene.pairs().size(), params.word("triangle_tests") == "spans") {
    for (std::size_t i = 0; i < scene.pairs().size(); ++i)
      for (const std::uint32_t body : {scene.pairs()[i].first, scene.pairs()[i].second})
        if (!all_triangles(scene.primitives(body))) by_spans_[i] = false;
    any_by_spans_ = std::find(by_spans_.begin(), by_spans_.end(), true) != by_spans_.end();
  }

  void reset(double t) override {
    this->start_at(t);
    count_.table = {};
    first_fetch_ = this->sampled_.fetched();
    for (auto& answers : answers_) answers.clear_counts();
    bounds_.start();
    new_segment();
  }

  void advance(double t) override {
    this->move_to(t);
    if (bounds_.advance()) new_segment();
  }

  /// With span tests these are no candidates that are apart for certain, and first those that intersect.
  QueryStatus candidates_at(double t, PairBuffer& out, const Budget& /*budget*/) override {
    if (!joined_) join();
    const float fraction = float(bounds_.fraction(t));
    const std::size_t before = out.size();
    blocks_.clear();
    for (std::size_t i = 0; i < joins_.size(); ++i) {
      const std::size_t begin = out.size();
      std::size_t open = 0;
      if (by_spans_[i]) {
        open = answers_[i].read(bounds_, this->scene_, joins_[i], fraction, out);
      } else {
        joins_[i].read(fraction, out);
        open = out.size() - begin;
      }
      blocks_.push_back({out.size() - begin - open, open});
    }
    if (any_by_spans_) answered_.assign(out.begin() + std::ptrdiff_t(before), out.end());
    return {};
  }

  /// What is not certain is tested at the frame's positions.
  void confirm(double t, PairBuffer& pairs) override {
    if (!any_by_spans_ || pairs != answered_) return Strategy<S>::confirm(t, pairs);
    to_test_.clear();
    std::size_t kept = 0, at = 0;
    for (const Block& block : blocks_) {
      std::copy_n(pairs.begin() + std::ptrdiff_t(at), block.certain, pairs.begin() + std::ptrdiff_t(kept));
      kept += block.certain;
      at += block.certain;
      to_test_.insert(to_test_.end(), pairs.begin() + std::ptrdiff_t(at),
                      pairs.begin() + std::ptrdiff_t(at + block.open));
      at += block.open;
    }
    confirm_pairs(this->scene_, this->sampled_, to_test_, this->triangle_stats_);
    pairs.resize(kept);
    pairs.insert(pairs.end(), to_test_.begin(), to_test_.end());
  }

  void start_sweep(double t) override {
    this->stand_at(t);
    bounds_.enter();
    joined_ = false;
    if (!sweeps_.empty()) return;
    sweeps_.resize(joins_.size());
    for (auto& sweep : sweeps_) sweep.keep_neighbours();
  }

  /// All pairs of the segment, whenever their boxes overlap in it.
  void swept_pairs(double t0, double t1, std::span<const S* const> /*before*/, PairBuffer& out) override {
    this->stand_at(t0);
    this->move_to(t1);
    if (!(bounds_.begin() <= t0 && t1 <= bounds_.end()))
      throw std::invalid_argument("contacts are asked for across a knot of a plan");
    std::uint64_t tests = 0;
    for (std::size_t i = 0; i < sweeps_.size(); ++i) {
      const BodyPair& pair = this->scene_.pairs()[i];
      sweeps_[i].join(bounds_, pair.first, pair.second, tests);
      for (const JoinedPair& found : sweeps_[i].pairs())
        out.push_back({pair.first, found.primitive_a, pair.second, found.primitive_b});
    }
    count_.add(Counter::box_tests, tests);
  }

  void flight_plans_changed(double t, std::span<const PlanChange<S>> /*changes*/) override {
    this->stand_at(t);
    bounds_.plans_changed();
    new_segment();
  }

  std::optional<AuditView> audit_view(std::uint32_t body) const override {
    return bounds_.audit_view(body, this->time());
  }

  std::size_t bytes() const override {
    std::size_t total = bounds_.bytes();
    for (const auto& join : joins_) total += join.bytes();
    for (const auto& answers : answers_) total += answers.bytes();
    for (const auto& sweep : sweeps_) total += sweep.bytes();
    return total;
  }

 protected:
  Counters counted() const override {
    Counters table = count_.table;
    if constexpr (Count::enabled) table[Counter::positions_fetched] = this->sampled_.fetched() - first_fetch_;
    for (const auto& answers : answers_) {
      table[Counter::span_tests] += answers.attempts();
      table[Counter::span_verdicts] += answers.decided();
    }
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
    for (std::size_t i = 0; i < joins_.size(); ++i)
      if (by_spans_[i]) answers_[i].start(joins_[i]);
    count_.add(Counter::box_tests, tests);
    joined_ = true;
  }

  LinearBounds<S> bounds_;
  std::vector<IntervalJoin<S>> joins_;  ///< one for each pair of bodies
  std::vector<SpanAnswers<S>> answers_;
  std::vector<IntervalJoin<S>> sweeps_;  ///< the same for contacts, once they are asked for
  std::vector<bool> by_spans_;
  bool any_by_spans_ = false, joined_ = false;
  /// What was read for one pair of bodies.
  struct Block {
    std::size_t certain, open;
  };
  std::vector<Block> blocks_;
  PairBuffer answered_, to_test_;
  Count count_;
  std::uint64_t first_fetch_ = 0;
};

std::vector<Parameter> join_parameters() {
  std::vector<Parameter> list = segment_cut_parameters();
  list.push_back({"triangle_tests",
                  "spans",
                  {"spans", "frames"},
                  "decide pairs of triangles for spans of time where that can be proved, or at every frame"});
  return list;
}

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
      .can = {.continuous = true, .plan_changes = true, .self_pairs = true, .contacts = true},
      .topology = {.preferred = {.method = BuildMethod::median, .width = 8, .leaf_size = 16}},
      .parameters = join_parameters(),
  })};
}
