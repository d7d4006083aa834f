// A strategy that chooses among other strategies by observed properties of the scene: frames per segment of
// the flight plans, vertex steps per frame, changes of plans, and candidates; the growth of boxes as trees
// age, and the box tests that new trees save; the work of the interval join over whole segments compared with
// a refit's, which decides after a trial whether the join stays; and the candidates that slabs at the leaves
// leave out. The choice depends on counts and plans only, never on a clock, so that a run can be repeated.
//
// Each candidate has one instance, with its own hierarchies, created with the strategy. This takes the memory
// of all candidates, but a change of strategy creates no instance. An instance starts when it is chosen.

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/contract/registry.hpp"
#include "core/contract/reports_work.hpp"
#include "core/families/choice/changes_of_many.hpp"
#include "core/families/choice/observed_ageing.hpp"
#include "core/families/choice/observed_join.hpp"
#include "core/families/choice/observed_motion.hpp"
#include "core/families/choice/observed_slabs.hpp"
#include "core/families/choice/observed_work.hpp"
#include "core/families/choice/predicted_costs.hpp"

namespace kbvh {
namespace {

/// A strategy to choose, its explicitly set parameters, and its predicted cost. To add a candidate, add a
/// line: any registered strategy is suitable that follows plan changes and needs no more foresight than the
/// next keyframe.
struct Candidate {
  const char* id;
  std::map<std::string, std::string> params;
  double (*cost)(const Observed&);
};
const std::vector<Candidate>& candidates() {
  static const std::vector<Candidate> list{
      {"leaf_slabs", {}, &refit_cost},  // first: it answers until observations exist
      {"bottom_up", {}, &plain_cost},
      {"lbvh_drift", {}, &rebuilt_cost},
      {"drift_rebuild", {{"start", "sorted"}}, &sorted_cost},
      {"drift_boxes", {}, &drift_cost},
      {"interval_join", {}, &join_cost},
  };
  return list;
}

/// Counts nothing itself: its counters are those of its instances, so it does not derive from
/// CountedStrategy.
template <class S>
class Auto final : public Strategy<S>,
                   public AnswersChanges<S>,
                   public AnswersProbes<S>,
                   public TakesPlanChanges<S> {
 public:
  static constexpr Foresight foresight = Foresight::next_keyframe;

  Auto(const SceneView<S>& scene, const SegmentMotion<S>& motion, Topologies topologies, const Params& params)
      : Strategy<S>(scene, motion),
        motion_(motion),
        steps_(scene, motion, topologies),
        gain_(params.number("gain")) {
    for (const Candidate& candidate : candidates()) {
      const auto found = std::find_if(registry().begin(), registry().end(), [&](const StrategyEntry& entry) {
        return entry.info.id == candidate.id;
      });
      if (found == registry().end() || !found->info.can.plan_changes || !found->info.can.rays) continue;
      const Params own(found->info.id, found->info.parameters, candidate.params);
      runners_.push_back({&candidate, found->info.positions == PositionUse::all,
                          NestedStrategies<S>::create(*found, scene, motion, topologies, own)});
      Runner& runner = runners_.back();
      runner.work = dynamic_cast<ReportsWork*>(runner.strategy.get());
    }
    if (runners_.empty()) throw ConfigError("auto has nothing to choose from");
  }

  void reset_to(double t) override {
    for (Runner& runner : runners_) {
      runner.started = false;
      runner.frames = 0;
      runner.factor = 1;
    }
    retired_ = {};
    changed_.clear();
    start(runners_[0], t);
    active_ = 0;
    frame_ = chosen_at_ = 0;
    stay_ = shortest_stay;
    step_ = 0;
    segment_end_ = t;
    changes_ = false;
    chosen_candidates_ = 0;
    chosen_near_ = false;
    touching_.clear();
    touching_of_ = nullptr;
    joined_candidates_ = 0;
    changes_of_many_.start_over();
    pairs_asked_ = pairs_in_frame_ = rays_asked_ = false;
    window_.close();
    body_changed_.assign(this->scene_.body_count(), 0);
    seen_ = {};
    seen_.reads = steps_.reads();
    seen_.primitives = steps_.primitives();
    seen_.bodies = steps_.moving_bodies();
    ageing_.start_over(runners_[0].work != nullptr ? runners_[0].work->surface() : 0);
    chosen_tests_ = 0;
    searches_.start_over();
    saved_ = 0;
    savings_counted_until_ = 0;
    tried_ = waits_ = refits_first_ = joins_first_ = false;
    join_.start_over(seen_);
    slabs_.start_over(runners_[0].candidate->cost == &refit_cost, seen_);
  }

  void advance_to(double t) override {
    const double before = this->previous_time();
    ++frame_;
    pairs_in_frame_ = false;
    seen_.changes_per_frame += ((changes_ ? 1.0 : 0.0) - seen_.changes_per_frame) / std::min(frame_, 16);
    changes_ = false;
    if (t > before) step_ = t - before;
    const std::size_t last = active_;
    const int stayed = frame_ - chosen_at_;
    const bool due = frame_ == 1 || stayed >= (t >= segment_end_ ? stay_ : longest_stay) ||
                     (seen_.changes_per_frame > 0 && !runners_[active_].all_positions) ||
                     seen_.near != chosen_near_ || seen_.candidates > 2 * chosen_candidates_ ||
                     2 * seen_.candidates < chosen_candidates_ || tried_ || (waits_ && t >= segment_end_) ||
                     (is_active(&join_cost) && seen_.near && !join_.judged()) || overworked() ||
                     (refits() && ageing_.tests() > 1.5 * chosen_tests_);
    if (step_ > 0 && due) choose(t);
    if (active_ != last) {
      changes_of_many_.switched();
      saved_ = 0;
      savings_counted_until_ = frame_;
    }
    tried_ = active_ != last &&
             ((rebuilds() && !rebuilds(last)) || is_active(&plain_cost) || join_.outdated() || refits_first_);
    joins_first_ = active_ != last && is_active(&join_cost);
    Runner& runner = runners_[active_];
    if (active_ != last) start(runner, t);
    window_.advance(frame_, runner.work, this->sampled_.fetched());
    if (active_ == last) {
      if (runner.all_positions) fetch_all();
      runner.strategy->advance(t);
    }
    ++runner.frames;
  }

  QueryStatus find_candidates(double t, PairBuffer& out, const Budget& /*budget*/) override {
    const std::size_t before = out.size();
    give_up_endless_join(t);
    // Not all candidates honour a budget.
    const QueryStatus status = runners_[active_].strategy->candidates_at(t, out, {});
    see_candidates(out.size() - before, true);
    const std::size_t count = out.size() - before,
                      stride = std::max<std::size_t>(1, count / ObservedMotion<S>::samples);
    touching_.clear();
    touching_of_ = nullptr;
    for (std::size_t i = 0; i < count && touching_.size() < ObservedMotion<S>::samples; i += stride)
      touching_.push_back(out[before + i]);
    return status;
  }

  void confirm_candidates(double t, PairBuffer& pairs) override {
    runners_[active_].strategy->confirm(t, pairs);
  }

  void find_changes(double t, Answer answer, PairBuffer& begun, PairBuffer& ended) override {
    give_up_endless_join(t);
    changes_of_many_.find(*runners_[active_].strategy, t, answer, begun, ended);
    const PairSet& pairs = changes_of_many_.pairs(answer);
    // Estimates the number of candidates from the pairs that intersect.
    see_candidates(pairs.size(), answer == Answer::candidates);
    touching_of_ = &pairs;
  }

  void answer_probes(double t, const Probes<S>& probes) override {
    const Runner& runner = runners_[active_];
    runner.strategy->probe_at(t, probes);
    rays_asked_ = true;
    // If pairs are asked for as well, they show how trees age.
    if (pairs_in_frame_ || runner.work == nullptr) return;
    const double tests = costs::Ageing::ray_test * double(runner.work->last_ray_tests());
    if (refits()) seen_.slab_tests = seen_.plain_tests = tests;
    see_tests(tests, 0);
  }

  void follow_plans(double t, std::span<const PlanChange<S>> changes) override {
    for (const PlanChange<S>& change : changes) {
      if (body_changed_[change.body] != 0) continue;
      body_changed_[change.body] = 1;
      changed_.push_back(change);
    }
    runners_[active_].strategy->flight_plans_changed(t, changes);
    changes_ = true;
  }

  bool wants_all_positions() const override { return runners_[active_].all_positions; }

  std::optional<AuditView> audit_view(std::uint32_t body) const override {
    return runners_[active_].strategy->audit_view(body);
  }

  std::string choice() const override {
    std::string text;
    for (const Runner& runner : runners_)
      if (runner.frames > 0)
        text += (text.empty() ? "" : ", ") + std::string(runner.candidate->id) + " for " +
                std::to_string(runner.frames) + (runner.frames == 1 ? " frame" : " frames");
    if (text.empty()) return text;
    return text + last_seen(seen_);
  }

  void be_timed() override {
    for (Runner& runner : runners_) runner.strategy->be_timed();
  }

  std::size_t bytes() const override {
    std::size_t total = touching_.capacity() * sizeof(PrimitivePair) +
                        changed_.capacity() * sizeof(PlanChange<S>) + changes_of_many_.bytes() +
                        steps_.bytes();
    for (const Runner& runner : runners_) total += runner.strategy->bytes();
    return total;
  }

 protected:
  void start_counting() override { first_fetch_ = this->sampled_.fetched(); }
  Counters counted() const override {
    Counters table = retired_;
    for (const Runner& runner : runners_)
      if (runner.started) add(table, runner.strategy->counters());
    table[Counter::positions_fetched] = this->sampled_.fetched() - first_fetch_;
    return table;
  }

 private:
  struct Runner {
    const Candidate* candidate;
    bool all_positions;
    std::unique_ptr<Strategy<S>> strategy;
    ReportsWork* work = nullptr;  ///< the strategy, if it reports its work; else null
    double factor = 1;            ///< measured / predicted cost, if it cost more than a refit
    bool started = false;         ///< since `reset`
    int frames = 0;               ///< number of frames that it answered
  };
  /// Frames after which the choice is reviewed within a segment, and at the start of a new one. The latter
  /// doubles each time that the choice is confirmed.
  static constexpr int longest_stay = 64, shortest_stay = 8;
  /// A join's first segment may take this many times the work of refits in the segment's frames.
  static constexpr double join_trial = 8;
  static constexpr double forgets = 0.9;  ///< at each choice, exponent of the factors measured for the others

  static void add(Counters& sum, const Counters& other) {
    for (const Counter peak : {Counter::list_peak, Counter::queue_peak}) {
      const std::uint64_t most = std::max(sum[peak], other[peak]);
      sum[peak] = most - other[peak];
    }
    const std::uint64_t fetched = sum[Counter::positions_fetched];
    for (std::size_t c = 0; c < sum.values.size(); ++c) sum.values[c] += other.values[c];
    // All instances read the same positions, and each counts the fetches of all instances.
    sum[Counter::positions_fetched] = fetched;
    for (const Counters::Named& counter : other.named) sum.add(counter.name, counter.value);
  }

  /// Whether the active strategy only refits its trees.
  bool refits() const { return active_ == 0 || is_active(&plain_cost); }
  bool is_active(double (*cost)(const Observed&)) const { return runners_[active_].candidate->cost == cost; }
  bool is_join(std::size_t runner) const { return runners_[runner].candidate->cost == &join_cost; }
  bool rebuilds(std::size_t runner) const {
    const auto cost = runners_[runner].candidate->cost;
    return cost == &rebuilt_cost || cost == &sorted_cost;
  }
  /// Whether the active strategy builds new trees.
  bool rebuilds() const { return rebuilds(active_); }
  /// Returns the candidate to compare a join with: in trees that have aged, a refit would take long.
  std::size_t refit_to_compare() const { return seen_.aged > 0.5 ? builder() : 0; }
  /// Returns lbvh_drift, or the first strategy without it.
  std::size_t builder() const {
    for (std::size_t i = 0; i < runners_.size(); ++i)
      if (rebuilds(i)) return i;
    return 0;
  }
  static constexpr std::size_t none_of_them = ~std::size_t(0);
  /// Returns the strategy of least predicted cost among those that are `allowed`.
  template <class Allowed>
  std::size_t least(Allowed&& allowed) const {
    std::size_t best = none_of_them;
    for (std::size_t i = 0; i < runners_.size(); ++i)
      if (allowed(i) && (best == none_of_them || cost_of(i) < cost_of(best))) best = i;
    return best;
  }
  double cost_of(std::size_t runner) const {
    return runners_[runner].factor * runners_[runner].candidate->cost(seen_);
  }
  /// Whether box tests and candidates of the active strategy alone cost more than a refit, for any reason.
  /// For a join over bodies that were not expected to meet, this is its own work; for drift_boxes, the mean
  /// over some frames, because one search serves many. Refits and new trees are compared by their searches.
  bool overworked() const {
    if (is_active(&join_cost)) return !seen_.near && searched() > gain_ * refit_cost(seen_);
    return is_active(&drift_cost) && frame_ - chosen_at_ >= shortest_stay &&
           searched() > gain_ * refit_cost(searches_.as_seen(seen_, frame_ - chosen_at_));
  }
  /// Returns the mean cost of box tests and candidates of the active strategy since it was last chosen; for a
  /// join, the cost of the box tests of its segment.
  double searched() const {
    using Work = costs::Work;
    const ReportsWork* work = runners_[active_].work;
    if (is_active(&join_cost))
      return work == nullptr
                 ? 0
                 : Work::join_box_test * double(work->last_box_tests()) / seen_.frames_per_segment;
    return searches_.cost(frame_ - chosen_at_);
  }
  /// Returns the strategy of least predicted cost among those that are `allowed`, or the active one if none
  /// is cheaper by `gain`.
  template <class Allowed>
  std::size_t cheapest(double gain, Allowed&& allowed) const {
    const std::size_t best = least(allowed);
    return best != none_of_them && cost_of(best) * gain < cost_of(active_) ? best : active_;
  }
  /// Prepares the first comparison of new trees with refitted ones: in the frame after a refit, and with the
  /// cheapest build. Boxes that have grown justify it, even where a join is predicted to be faster than
  /// either.
  void try_new_trees(std::size_t& best) {
    refits_first_ = rebuilds(best) && !refits() && seen_.aged <= 0.5;
    if (refits_first_)
      best = 0;
    else if (rebuilds(best) || (is_join(best) && refits() && seen_.aged > 0.5))
      best = builder();
  }
  /// Whether new trees by `best` pay for their first frame before the next review. Adds what they would have
  /// saved in the frames since the last call, or since the last change of strategy, and what they will save
  /// in the next frames. Assumes that each frame is like this one.
  bool worth_a_start(std::size_t best) {
    double now = cost_of(active_);
    if (!std::isfinite(now)) now = cost_of(least([&](std::size_t runner) { return !rebuilds(runner); }));
    const double saves = std::max(0.0, now - cost_of(best));
    saved_ += saves * (frame_ - savings_counted_until_);
    savings_counted_until_ = frame_;
    return saved_ + saves * shortest_stay > costs::Choice::start_primitive * seen_.primitives;
  }
  /// Starts an instance, at the beginning or when it is chosen. It sees the current plans, but does not know
  /// which bodies no longer rest.
  void start(Runner& runner, double t) {
    if (runner.started) add(retired_, runner.strategy->counters());
    if (runner.all_positions) fetch_all();
    runner.strategy->reset(t);
    if (!changed_.empty()) runner.strategy->flight_plans_changed(t, changed_);
    runner.started = true;
  }
  /// Lets a refit answer this frame if the first join after a change of strategy would take many times the
  /// work of a refit in all frames of the segment.
  void give_up_endless_join(double t) {
    if (!std::exchange(joins_first_, false) || runners_[active_].work == nullptr) return;
    const double frame = std::max(refit_cost(seen_), costs::Work::slabs.read * seen_.reads);
    const double most =
        join_trial * frame * std::max(1.0, seen_.frames_per_segment) / costs::Work::join_box_test;
    if (runners_[active_].work->searches_within(std::uint64_t(std::min(most, 1e15)) + 1)) return;
    join_.given_up(join_trial, seen_);
    --runners_[active_].frames;
    active_ = 0;
    ++runners_[active_].frames;
    start(runners_[active_], t);
    changes_of_many_.switched();
    window_.close();
    stay_ = shortest_stay;
  }
  /// Strategies differ in the pairs that they leave out early. Only drift_boxes reports all pairs of boxes,
  /// and so shows that bodies are apart.
  void see_candidates(std::size_t count, bool all) {
    pairs_asked_ = pairs_in_frame_ = true;
    const ReportsWork* work = runners_[active_].work;
    searches_.add(work, double(count));
    if (count != 0 || is_active(&drift_cost)) seen_.near = count != 0;
    if (!seen_.near) seen_.candidates = double(count);
    if (is_active(&join_cost)) joined_candidates_ = double(count);
    if (is_active(&refit_cost) && work != nullptr)
      slabs_.slabs(double(count), *work, all, frame_, seen_);
    else if (is_active(&plain_cost) && work != nullptr)
      slabs_.plain(double(count), *work, all, frame_, seen_);
    if (work != nullptr) see_tests(double(work->last_box_tests()), double(count));
  }
  void see_tests(double tests, double count) {
    if (refits())
      ageing_.refitted(tests, count, frame_, seen_);
    else if (rebuilds())
      ageing_.rebuilt(tests / (is_active(&sorted_cost) ? 1 : costs::Choice::built_tests), count,
                      std::max(1, frame_), seen_);
  }
  /// Measures the work of the active strategy since the last choice, or since its window began. `whole`: a
  /// segment ends at this frame.
  void see_work(bool whole) {
    const Runner& runner = runners_[active_];
    const double frames = frame_ - chosen_at_;
    if (refits() && runner.work != nullptr) {
      ageing_.look_at_refitted(runner.work->surface(), frame_, seen_);
      join_.refitted(frame_, seen_);
    } else if (rebuilds() && runner.work != nullptr && frames >= shortest_stay) {
      ageing_.look_at_rebuilt(runner.work->growth(), is_active(&sorted_cost), seen_);
    }
    if (rebuilds()) join_.refitted(frame_, seen_);
    // From time to time drift_boxes may check whether bodies have parted.
    if (frames >= longest_stay && seen_.candidates == 0) seen_.near = false;
    if (!is_active(&join_cost)) {
      if (frames >= shortest_stay) join_.forget(seen_);
    } else if (whole && window_.has_frames(frame_)) {
      const double work =
          seen_.near ? window_.work(frame_, runner.work, this->sampled_.fetched(), seen_) : searched();
      join_.joined(work, joined_candidates_, frame_, seen_);
    }
  }

  void fetch_all() {
    for (std::uint32_t body = 0; body < this->scene_.body_count(); ++body) this->sampled_.fetch_all(body);
  }

  /// Reads the plans, and switches to a strategy that is predicted to be faster than the active one by at
  /// least `gain_`.
  void choose(double t) {
    double begin = -std::numeric_limits<double>::infinity(), end = std::numeric_limits<double>::infinity();
    if (seen_.changes_per_frame == 0)  // otherwise the observation takes too long and is unreliable
      for (std::uint32_t body = 0; body < this->scene_.body_count(); ++body) {
        begin = std::max(begin, motion_.lines_begin(body));
        end = std::min(end, motion_.lines_end(body));
      }
    const bool bounded =
        begin > -std::numeric_limits<double>::infinity() && end < std::numeric_limits<double>::infinity();
    // A join does its work for a segment at the start, so it is not left within one, unless the segment is
    // long.
    const bool whole = bounded && begin > this->previous_time();
    if (is_active(&join_cost) && bounded && !whole && frame_ - chosen_at_ < 2 * longest_stay) return;
    const bool known = join_.known();
    see_work(whole);
    if (is_active(&drift_cost))
      runners_[active_].factor =
          overworked() ? std::max(1.0, searched() / drift_cost(searches_.as_seen(seen_, frame_ - chosen_at_)))
                       : 1;
    for (std::size_t i = 0; i < runners_.size(); ++i)
      if (i != active_) runners_[i].factor = std::pow(runners_[i].factor, forgets);
    searches_.start_over();
    chosen_at_ = frame_;
    chosen_candidates_ = seen_.candidates;
    chosen_near_ = seen_.near;
    chosen_tests_ = ageing_.tests();
    seen_.rays_only = rays_asked_ && !pairs_asked_;
    rays_asked_ = pairs_asked_ = false;
    if (touching_of_ != nullptr) {
      touching_.clear();
      touching_of_->sample(ObservedMotion<S>::samples, touching_);
    }
    steps_.observe(step_, touching_, seen_);
    segment_end_ = end > t ? end : t;
    if (bounded)
      seen_.frames_per_segment = std::max(1.0, (end - begin) / step_);
    else if (frame_ == 1 || seen_.changes_per_frame > 0)
      seen_.frames_per_segment = std::numeric_limits<double>::infinity();
    slabs_.prepare_choice(frame_ - 1, seen_);
    const double gain = tried_ || known != join_.known() ? 1 : gain_;
    std::size_t best = cheapest(gain, [](std::size_t) { return true; });
    refits_first_ = false;
    // Checked at the end of a segment, where a refitted frame costs no second join.
    if (join_.outdated())
      best = refit_to_compare();
    else if (!ageing_.compared() && !rebuilds())
      try_new_trees(best);
    if (!join_.outdated() && rebuilds(best) && !rebuilds() && !worth_a_start(best))
      best = cheapest(gain, [&](std::size_t runner) { return !rebuilds(runner); });
    // A join over the last frames of a segment costs as much as one over the whole segment.
    waits_ = best != active_ && is_join(best) && bounded && !whole &&
             cost_of(active_) * (end - t) < join_cost(seen_) * seen_.frames_per_segment * step_;
    if (waits_) return;
    stay_ = best == active_ ? std::min(2 * stay_, longest_stay) : shortest_stay;
    active_ = best;
    if (!is_active(&join_cost))
      window_.close();
    else if (whole)
      window_.open_next();
  }

  SegmentMotion<S> motion_;
  ObservedMotion<S> steps_;
  double gain_;
  std::vector<Runner> runners_;
  Counters retired_;  ///< counts of instances before their restart
  std::size_t active_ = 0;
  std::uint64_t first_fetch_ = 0;
  int frame_ = 0, chosen_at_ = 0, stay_ = shortest_stay;
  double step_ = 0, segment_end_ = 0;  ///< seconds
  double chosen_candidates_ = 0;       ///< number of candidates at the time of the choice
  bool chosen_near_ = false;           ///< whether bodies met at that time
  double chosen_tests_ = 0;            ///< box tests of the refitted trees in the last frame
  ObservedSearches searches_;          ///< since the last choice
  double saved_ = 0;                   ///< nanoseconds, see worth_a_start
  int savings_counted_until_ = 0;      ///< frame up to which savings are in `saved_`
  bool tried_ = false;                 ///< on trial: its work decides whether the active strategy stays
  ObservedAgeing ageing_;
  bool joins_first_ = false;   ///< the join answers for the first time since another strategy
  bool waits_ = false;         ///< for the next segment, before a join is chosen
  bool refits_first_ = false;  ///< a refit answers before new trees are tried
  ObservedJoin join_;
  double joined_candidates_ = 0;  ///< of the join's last frame
  JoinWindow window_;
  ObservedSlabs slabs_;
  bool pairs_asked_ = false, rays_asked_ = false;  ///< since the last choice
  bool pairs_in_frame_ = false;
  bool changes_ = false;                ///< plans changed since the last frame
  std::vector<PlanChange<S>> changed_;  ///< the first change of each body since `reset`
  std::vector<std::uint8_t> body_changed_;
  PairBuffer touching_;                   ///< sample of the candidates of the last frame
  const PairSet* touching_of_ = nullptr;  ///< where to sample them at a choice; null: sampled already
  ChangesOfMany<S> changes_of_many_;
  Observed seen_;
};

}  // namespace
}  // namespace kbvh

KBVH_STRATEGY(auto) {
  using namespace kbvh;
  return {make_entry<Auto>({
      .id = "auto",
      .title = "automatic choice",
      .family = "auto",
      .citation = "kbvh",
      .tightness = Tightness::conservative,
      .positions = PositionUse::varying,
      .topology = {.preferred = {.method = BuildMethod::median, .width = 8, .leaf_size = 16}},
      .parameters = {{"gain",
                      "1.1",
                      {},
                      "predicted speed-up from which on another strategy replaces the active one",
                      1},
                     threads_parameter("positions and the work of the chosen strategies that take threads")},
  })};
}
