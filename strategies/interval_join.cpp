// One time-parametrised traversal per segment of the flight plans, over boxes that are linear in time, yields
// the pairs of primitives that come near each other in the segment, with their times; frames are read from
// these. Prior art, and how this differs from it: core/adr/0010-prior-art-of-answering-intervals.md. Bodies
// of triangles are first compared by slabs of leaves (core/adr/0014-slabs-of-leaves.md): what a slab
// separates throughout the segment is no pair.
//
// Where plans change at run time, the segment is kept: leaves with a changed vertex, the boxes above them,
// and the pairs of changed primitives are computed again. The length of segments follows the rate of changes.
// This pays while few leaves change: with 420 changed vertices per frame at the corner of a cloth of 65k
// triangles (1 % of all leaves), candidates take half the time of the best refit, and twice its time with a
// new segment at each change. It does not pay where the changes occur at the contacts: with 163 changes per
// frame on two spheres of 40k triangles, a quarter of all pairs are joined again at each frame, and the refit
// is twice as fast.
//
// Boxes linear in time exceed those of a refit by a few roundings of their coordinates. Where gaps and
// triangles are no larger than these roundings, the join lists far more pairs than a refit finds: nearly all
// pairs where two sheets of unit size lie 0.1 apart at 1e6 in float, whose numbers are 0.06 apart there.
// `auto` gives up such a join. The same holds for scenes about as small as the smallest normal number (1e-38
// in float), by which all margins are larger.

#include <algorithm>
#include <limits>

#include "core/base/cost_constants.hpp"
#include "core/contract/registry.hpp"
#include "core/contract/reports_work.hpp"
#include "core/families/linear/interval_join.hpp"
#include "core/families/linear/join_changes.hpp"
#include "core/families/linear/linear_bounds.hpp"
#include "core/families/linear/linear_probes.hpp"
#include "core/families/linear/segment_joins.hpp"
#include "core/families/wide/count_boxes.hpp"
#include "core/families/wide/swept_hierarchies.hpp"

namespace kbvh {
namespace {

/// With foresight of the whole clip the next segment's answer is computed during the current one, a part at
/// each frame; otherwise all of it at the first frame of the segment.
template <class S, Foresight F>
class IntervalJoinStrategy final : public CountedStrategy<S>,
                                   public AnswersSelfPairs,
                                   public AnswersChanges<S>,
                                   public AnswersSweeps<S>,
                                   public AnswersProbes<S>,
                                   public TakesPlanChanges<S>,
                                   public ReportsWork {
  static constexpr bool works_ahead = F == Foresight::whole_clip;
  using Motion = MotionView<F, S>;

 public:
  static constexpr Foresight foresight = F;

  IntervalJoinStrategy(const SceneView<S>& scene, const Motion& motion, Topologies topologies,
                       const Params& params)
      : CountedStrategy<S>(scene, motion),
        motion_(motion),
        bounds_(scene, motion, std::move(topologies), active_kernel_set(), linear_settings(params)),
        together_(scene.pairs().size() > most_joins),
        now_(together_ ? 2 : scene.pairs().size()),
        next_(now_.joins.size()),
        by_spans_(now_.joins.size(), false),
        changes_(now_.joins.size()),
        updates_(scene.body_count()) {
    const bool spans = params.word("triangle_tests") == "spans";
    repairs_ = params.word("plan_changes") == "repaired";
    for (std::uint32_t body = 0; body < scene.body_count(); ++body)
      decidable_.push_back(spans && all_triangles(scene.primitives(body)));
    if (together_)
      by_spans_[0] = spans;
    else
      for (std::size_t i = 0; i < scene.pairs().size(); ++i) by_spans_[i] = is_decidable(scene.pairs()[i]);
    if (params.word("slabs") == "on")
      for (std::size_t i = 0; i < now_.joins.size(); ++i)
        for (Joins<S>* one : {&now_, &next_})
          if (by_spans_[i]) one->joins[i].use_slabs();
    any_by_spans_ = std::find(by_spans_.begin(), by_spans_.end(), true) != by_spans_.end();
    all_by_spans_ = std::find(by_spans_.begin(), by_spans_.end(), false) == by_spans_.end();
    for (Joins<S>* one : {&now_, &next_})
      for (auto& answers : one->answers) answers.use(this->sampled_.workers());
  }

  void reset_to(double t) override {
    for (Joins<S>* one : {&now_, &next_})
      for (auto& answers : one->answers) answers.start_over();
    bounds_.start();
    probe_boxes_are_old_ = true;
    changes_.start_over();
    new_segment();
    before_ = t;
    plans_changed_ = false;
    pairs_removed_ = pairs_added_ = 0;
  }

  void advance_to(double /*t*/) override {
    before_ = this->previous_time();
    probe_boxes_are_old_ = true;
    if (bounds_.advance()) new_segment();
    if constexpr (works_ahead) make_bounds_ahead();
  }

  /// With span tests the candidates exclude pairs that are certainly apart, and start with those that
  /// certainly intersect.
  QueryStatus find_candidates(double t, PairBuffer& out, const Budget& /*budget*/) override {
    const float fraction = float(bounds_.fraction(t));
    bring_joins_to(fraction);
    const std::size_t before = out.size();
    blocks_.clear();
    for (std::size_t i = 0; i < now_.joins.size(); ++i) {
      const std::size_t begin = out.size();
      std::size_t open = 0;
      if (by_spans_[i]) {
        open = now_.answers[i].read(bounds_.segment(), this->scene_, now_.joins[i], fraction, out);
      } else {
        now_.joins[i].read(fraction, out);
        open = out.size() - begin;
      }
      blocks_.push_back({out.size() - begin - open, open});
    }
    if (any_by_spans_) answered_.assign(out.begin() + std::ptrdiff_t(before), out.end());
    if constexpr (works_ahead) join_ahead(bounds_.ahead(), share_due());
    return {};
  }

  /// Without span tests the triangles of all candidates are tested at every frame; compared with these tests,
  /// a comparison costs little.
  void find_changes(double t, Answer answer, PairBuffer& begun, PairBuffer& ended) override {
    if (answer == Answer::pairs && !all_by_spans_) return this->compare_answers(t, answer, begun, ended);
    const float fraction = float(bounds_.fraction(t));
    bring_joins_to(fraction);
    for (std::size_t i = 0; i < now_.joins.size(); ++i) {
      if (by_spans_[i])
        now_.answers[i].move_to(bounds_.segment(), this->scene_, now_.joins[i], fraction);
      else
        now_.joins[i].move_to(fraction);
    }
    const auto confirm = [this](PairBuffer& pairs) { confirm_all(pairs); };
    changes_.find(answer, parts(), confirm, begun, ended);
    if constexpr (works_ahead) join_ahead(bounds_.ahead(), share_due());
  }

  /// Undecided pairs are tested at the frame's positions.
  void confirm_candidates(double /*t*/, PairBuffer& pairs) override {
    if (!any_by_spans_ || pairs != answered_) return confirm_all(pairs);
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
    confirm_all(to_test_);
    pairs.resize(kept);
    pairs.insert(pairs.end(), to_test_.begin(), to_test_.end());
  }

  /// Follows rays through the boxes of the segment, interpolated at t where rays read them.
  void answer_probes(double t, const Probes<S>& probes) override {
    if (std::exchange(probe_boxes_are_old_, false)) {
      probe_stale_.resize(bounds_.body_count());
      for (std::uint32_t body = 0; body < bounds_.body_count(); ++body)
        probe_stale_[body].assign(bounds_.hierarchy(body).node_count(), 1);
    }
    std::uint64_t tests = 0;
    probes_.answer(bounds_, t, probe_stale_, probes, this->triangle_stats_, tests, this->ray_bodies());
    this->count_.add(Counter::box_tests, tests);
  }

  void prepare_sweep(double /*t*/) override {
    probe_boxes_are_old_ = true;
    if (plans_changed_) return;  // lines may have no end; the sweep's end is known only afterwards
    bounds_.enter();
    changes_.leave_segment(parts());
    ahead_ = {};
    joined_ = false;
    if (!sweeps_.empty()) return;
    sweeps_.resize(now_.joins.size());
    for (auto& sweep : sweeps_) sweep.keep_neighbours();
  }

  /// Appends all pairs of the segment, at any time of overlap.
  void find_swept_pairs(double t0, double t1, std::span<const S* const> before, PairBuffer& out) override {
    if (plans_changed_) return sweep_both_ends(before, out);
    if (!(bounds_.begin() <= t0 && t1 <= bounds_.end()))
      throw std::invalid_argument("contacts were requested across a knot of a plan");
    for (std::size_t i = 0; i < sweeps_.size(); ++i) {
      sweeps_[i].join(bounds_.segment(), this->scene_, bodies_of_join(bounds_.segment(), i));
      this->count_.add(Counter::box_tests, sweeps_[i].tests());
      const auto pairs = sweeps_[i].pairs();
      for (std::size_t k = 0; k < pairs.size(); ++k) {
        const BodyPair bodies = sweeps_[i].bodies_of(k);
        out.push_back({bodies.first, pairs[k].primitive_a, bodies.second, pairs[k].primitive_b});
      }
    }
  }

  /// Keeps the segment if possible; the next read repairs its joins.
  void follow_plans(double /*t*/, std::span<const PlanChange<S>> changes) override {
    plans_changed_ = probe_boxes_are_old_ = true;
    ahead_ = {};
    if (repairs_ && bounds_.repair(changes)) return;
    bounds_.plans_changed();
    new_segment();
  }

  std::optional<AuditView> audit_view(std::uint32_t body) const override {
    return bounds_.audit_view(body, this->time());
  }

  /// Counts the joins of the current segment, for all its frames.
  std::uint64_t last_box_tests() const override {
    std::uint64_t tests = 0;
    for (const IntervalJoin<S>& one : now_.joins) tests += joined_ ? one.tests() : 0;
    return tests;
  }

  bool searches_within(std::uint64_t most) override {
    for (std::size_t i = 0; !joined_ && i < now_.joins.size(); ++i) {
      IntervalJoin<S>& one = now_.joins[i];
      one.start(bounds_.segment(), this->scene_, bodies_of_join(bounds_.segment(), i), leaf_pairs_in_part);
      const bool whole = one.step(most);
      this->count_.add(Counter::box_tests, one.tests());
      if (!whole) return false;
      most -= std::min(most, one.tests());
    }
    if (!joined_) start_reading();
    return true;
  }
  std::uint64_t frame_tests() const override { return this->triangle_stats_.tests; }
  std::uint64_t span_tests() const override {
    std::uint64_t tests = 0;
    for (const Joins<S>* one : {&now_, &next_})
      for (const auto& answers : one->answers) tests += answers.attempts();
    return tests;
  }

  std::size_t bytes() const override {
    std::size_t total = bounds_.bytes() + now_.bytes() + next_.bytes() + query_.bytes() + changes_.bytes() +
                        probes_.bytes() + shared_confirmation_.bytes() +
                        parts_.capacity() * sizeof(parts_[0]) +
                        (answered_.capacity() + to_test_.capacity()) * sizeof(PrimitivePair) +
                        blocks_.capacity() * sizeof(Block) + joined_bodies_.capacity() * sizeof(BodyPair);
    for (const auto& sweep : sweeps_) total += sweep.bytes();
    for (const auto& marks : probe_stale_) total += marks.capacity();
    return total + (swept_ ? swept_->bytes() : 0);
  }

 protected:
  void counts_cleared() override { updates_.skip(bounds_); }
  void add_counts(Counters& table) const override {
    updates_.add_to(table, bounds_);
    table[Counter::span_tests] += span_tests();
    for (const Joins<S>* one : {&now_, &next_})
      for (const auto& answers : one->answers) table[Counter::span_verdicts] += answers.decided();
    const auto& repairs = bounds_.repairs();
    if (repairs.kept + repairs.restarted == 0) return;
    table.add("segments_kept", repairs.kept);
    table.add("segments_restarted", repairs.restarted);
    table.add("leaves_remade", repairs.leaves);
    table.add("pairs_removed", pairs_removed_);
    table.add("pairs_added", pairs_added_);
  }

 private:
  using Stage = WorkAhead::Stage;
  using Cost = costs::JoinAhead;

  /// With more pairs of bodies than this, they are joined together: a separate join takes some kilobytes.
  static constexpr std::size_t most_joins = 16;
  /// A join that is made in parts may stop after so many pairs of leaves.
  static constexpr std::size_t leaf_pairs_in_part = 128;

  /// Keeps the pairs that intersect at the frame.
  void confirm_all(PairBuffer& pairs) {
    shared_confirmation_.confirm(this->scene_, this->sampled_, pairs, this->triangle_stats_);
  }
  bool is_decidable(const BodyPair& pair) const { return decidable_[pair.first] && decidable_[pair.second]; }
  /// Returns the pairs of bodies of one join, among those that meet within the segment. Valid until the next
  /// call.
  std::span<const BodyPair> bodies_of_join(const LinearSegment<S>& segment, std::size_t join) {
    const auto all = this->scene_.pairs();
    if (!together_) return all.subspan(join, 1);
    joined_bodies_.clear();
    for (const std::uint32_t i : segment.near_pairs)
      if ((join == 0) == is_decidable(all[i])) joined_bodies_.push_back(all[i]);
    return joined_bodies_;
  }

  /// Used after plans have changed: boxes around both ends, as a refit computes them.
  void sweep_both_ends(std::span<const S* const> before, PairBuffer& out) {
    if (!swept_)
      swept_.emplace(
          this->scene_, [&](std::uint32_t body) -> const auto& { return bounds_.hierarchy(body); });
    swept_->refit(before, this->sampled_);
    std::uint64_t tests = 0;
    swept_->pairs(query_, out, tests);
    this->count_.add(Counter::box_tests, tests);
    for (std::uint32_t body = 0; body < bounds_.body_count(); ++body) {
      const WideHierarchy<S>& hierarchy = bounds_.hierarchy(body);
      count_boxes(this->count_, hierarchy.topology().size(), 2 * hierarchy.leaf_vertex_count());
    }
  }

  void new_segment() {
    changes_.leave_segment(parts());
    joined_ = false;
    if (bounds_.came_ahead() && ahead_.joins_begun) {
      join_ahead(bounds_.segment(), 1);
      std::swap(now_, next_);
      joined_ = true;
    }
    ahead_ = {};
    ahead_.pacer = {this->time(), bounds_.end()};
    if constexpr (works_ahead)
      if (bounds_.start_ahead(motion_.from(bounds_.end()))) ahead_.stage = Stage::bounds;
  }
  /// Returns the joins of the current segment. Valid until the next call.
  std::span<const typename JoinChanges<S>::Part> parts() {
    parts_.clear();
    for (std::size_t i = 0; i < now_.joins.size(); ++i)
      parts_.push_back({&now_.joins[i], by_spans_[i] ? &now_.answers[i] : nullptr});
    return parts_;
  }
  void join() {
    for (std::size_t i = 0; i < now_.joins.size(); ++i) {
      now_.joins[i].join(bounds_.segment(), this->scene_, bodies_of_join(bounds_.segment(), i),
                         this->sampled_.workers());
      this->count_.add(Counter::box_tests, now_.joins[i].tests());
    }
    start_reading();
  }
  void start_reading() {
    for (std::size_t i = 0; i < now_.joins.size(); ++i)
      if (by_spans_[i]) now_.answers[i].start(now_.joins[i]);
    joined_ = true;
    bounds_.clear_changed();
  }
  /// Makes the joins of the segment if they do not exist, or repairs them where plans changed.
  void bring_joins_to(float fraction) {
    if (!joined_) return join();
    if (!bounds_.any_changed()) return;
    for (std::size_t i = 0; i < now_.joins.size(); ++i) {
      IntervalJoin<S>& one = now_.joins[i];
      using Reader = typename IntervalJoin<S>::Reader;
      this->count_.add(Counter::box_tests,
                       one.repair(bounds_.changed(), fraction, by_spans_[i] ? Reader::filter : Reader::join));
      if (by_spans_[i]) now_.answers[i].repair(one);
      pairs_removed_ += one.removed().size();
      pairs_added_ += one.pairs().size() - one.first_added();
    }
    changes_.repaired();
    bounds_.clear_changed();
  }

  /// Returns the share of the work ahead that must be done by now: all of it at the last frame before the
  /// next segment, if the step between the last two frames repeats.
  double share_due() const { return ahead_.pacer.share_due(this->time(), this->time() - before_); }
  /// Estimates the work as if the next segment resembled the current one, or, if that one has little work,
  /// many others.
  double all_work() const {
    const double boxes = Cost::node * double(bounds_.nodes_of_segment());
    double known = 0;
    for (std::size_t i = 0; joined_ && i < now_.joins.size(); ++i) {
      known += double(now_.joins[i].tests());
      if (by_spans_[i]) known += Cost::answer * double(now_.joins[i].from_begin());
    }
    return boxes + std::max(2 * boxes, known);
  }
  void make_bounds_ahead() {
    if (ahead_.stage != Stage::bounds) return;
    const double share = share_due(), wanted = share * all_work() - ahead_.done;
    if (share < 1 && !(wanted > 0)) return;
    const double most = share < 1 ? wanted / Cost::node : 1e15;
    if (bounds_.step_ahead(std::uint64_t(most) + 1))
      ahead_.stage = Stage::joins;
    else if (!bounds_.has_ahead())
      ahead_.stage = Stage::nothing;
    ahead_.done += std::clamp(wanted, 0.0, Cost::node * double(bounds_.nodes_of_segment()));
  }
  /// Brings the work on joins and answers ahead to a share of the whole; a share of 1 or more completes it.
  void join_ahead(const LinearSegment<S>& segment, double share) {
    constexpr std::size_t tests_at_once = 4096, answers_at_once = 256;
    const double wanted = share >= 1 ? std::numeric_limits<double>::infinity() : share * all_work();
    while (ahead_.done < wanted && (ahead_.stage == Stage::joins || ahead_.stage == Stage::answers)) {
      if (ahead_.join == next_.joins.size()) {
        ahead_.join = 0;
        ahead_.stage = ahead_.stage == Stage::joins ? Stage::answers : Stage::done;
        continue;
      }
      const std::size_t i = ahead_.join;
      IntervalJoin<S>& join = next_.joins[i];
      if (ahead_.stage == Stage::joins) {
        ahead_.joins_begun = true;
        if (!ahead_.begun) join.start(segment, this->scene_, bodies_of_join(segment, i), leaf_pairs_in_part);
        const std::uint64_t before = ahead_.begun ? join.tests() : 0;
        ahead_.begun = !join.step(tests_at_once);
        ahead_.done += double(join.tests() - before);
        this->count_.add(Counter::box_tests, join.tests() - before);
      } else {
        if (by_spans_[i] && !ahead_.begun) next_.answers[i].start_ahead(join);
        ahead_.begun = by_spans_[i] && !next_.answers[i].step(segment, this->scene_, join, answers_at_once);
        if (by_spans_[i]) ahead_.done += Cost::answer * answers_at_once;
      }
      if (!ahead_.begun) ++ahead_.join;
    }
  }

  Motion motion_;
  LinearBounds<S> bounds_;
  bool together_;  ///< pairs of bodies: by_spans_[0]: the decidable ones, [1]: the others
  Joins<S> now_, next_;
  WorkAhead ahead_;
  double before_ = 0;                         ///< time of the preceding frame
  std::vector<IntervalJoin<S>> sweeps_;       ///< for contacts, after the first request
  std::optional<SweptHierarchies<S>> swept_;  ///< for contacts after changes of plans
  WideQuery<S> query_;
  LinearProbes<S> probes_{this->scene_, this->sampled_};
  std::vector<std::vector<std::uint8_t>> probe_stale_;  ///< [body][wide node], from the first rays on
  bool probe_boxes_are_old_ = true;
  bool plans_changed_ = false, repairs_ = true;
  std::uint64_t pairs_removed_ = 0, pairs_added_ = 0;
  std::vector<bool> by_spans_;   ///< by join
  std::vector<bool> decidable_;  ///< by body: triangles only, and the parameter asks for spans
  std::vector<BodyPair> joined_bodies_;
  bool any_by_spans_ = false, all_by_spans_ = false, joined_ = false;
  /// The range of pairs read from one join.
  struct Block {
    std::size_t certain, open;
  };
  std::vector<Block> blocks_;
  PairBuffer answered_, to_test_;
  SharedConfirmation<S> shared_confirmation_;
  JoinChanges<S> changes_;
  std::vector<typename JoinChanges<S>::Part> parts_;
  LinearCounts<S> updates_;
};

template <class S>
using AtOnce = IntervalJoinStrategy<S, Foresight::next_keyframe>;
template <class S>
using MadeAhead = IntervalJoinStrategy<S, Foresight::whole_clip>;

std::vector<Parameter> join_parameters() {
  std::vector<Parameter> list = linear_parameters();
  list.push_back({"triangle_tests",
                  "spans",
                  {"spans", "frames"},
                  "decide pairs of triangles for spans of time where a proof exists, or at every frame"});
  list.push_back({"slabs",
                  "on",
                  {"on", "off"},
                  "with triangle_tests=spans: leave out triangles that the slab of a leaf separates "
                  "throughout the segment"});
  list.push_back(threads_parameter(
      "positions, boxes, joins, span tests and triangle tests (work that is done ahead takes one thread)"));
  list.push_back({"plan_changes",
                  "repaired",
                  {"repaired", "restarted"},
                  "repair a segment where plans change within it, or begin a new one"});
  return list;
}

}  // namespace
}  // namespace kbvh

KBVH_STRATEGY(interval_join) {
  using namespace kbvh;
  const auto info = [](const char* id, const char* title) {
    return Info{
        .id = id,
        .title = title,
        .family = "linear",
        .citation =
            "kbvh; joins of boxes linear in time as in Saltenis et al. 2000, Tao & Papadias 2002 and Zhang "
            "et al. 2008 (core/adr/0010)",
        .tightness = Tightness::conservative,
        .positions = PositionUse::fetched,
        .declares = {.continuous = true},
        .topology = {.preferred = {.method = BuildMethod::median, .width = 8, .leaf_size = 16}},
        .parameters = join_parameters(),
    };
  };
  return {make_entry<AtOnce>(info("interval_join", "interval join")),
          make_entry<MadeAhead>(info("interval_join_ahead", "interval join, computed ahead"))};
}
