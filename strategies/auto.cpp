// A strategy that chooses among other strategies by the work that they do, in counts: never by a clock, so
// that a run can be repeated. The candidates and the costs of their work stand in one table
// (core/families/choice/choice_candidates.cpp). A policy decides which one answers the next unit, a frame or
// a segment of the flight plans; it tries others within a stated budget, and returns to a refit where that
// costs less (core/families/choice/choice_policy.hpp).
//
// Each candidate has one instance, with its own hierarchies, created with the strategy. This takes the memory
// of all candidates, but a change of strategy creates no instance. An instance starts when it is first tried.
//
// Pairs within a body and sweeps are answered by the candidates that can. Sweeps report no work, so they
// change no choice: the active candidate answers them, or the refit in its place.

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/base/cost_constants.hpp"
#include "core/contract/reports_work.hpp"
#include "core/families/choice/choice_candidates.hpp"
#include "core/families/choice/choice_policy.hpp"
#include "core/families/choice/one_of_many.hpp"
#include "core/scene/self_pairs.hpp"

namespace kbvh {
namespace {

template <class S>
class Auto final : public OneOfMany<S>,
                   public AnswersSelfPairs,
                   public AnswersSweeps<S>,
                   public AnswersProbes<S> {
  using Base = OneOfMany<S>;
  using Base::active;

 public:
  static constexpr Foresight foresight = Foresight::next_keyframe;

  Auto(const SceneView<S>& scene, const SegmentMotion<S>& motion, Topologies topologies, const Params& params)
      : Base(scene, motion), motion_(motion) {
    for (const ChoiceCandidate& candidate : choice_candidates()) {
      const auto found = std::find_if(registry().begin(), registry().end(), [&](const StrategyEntry& entry) {
        return entry.info.id == candidate.id;
      });
      if (found == registry().end() || (has_self_pairs(scene.pairs()) && !found->info.can.self_pairs))
        continue;
      const Params own(candidate.id, found->info.parameters, candidate.params);
      this->instances_.push_back(
          {&found->info, NestedStrategies<S>::create(*found, scene, motion, topologies, own)});
      runners_.push_back({&candidate, dynamic_cast<ReportsWork*>(this->instances_.back().strategy.get())});
      if (runners_.back().work == nullptr)
        throw ConfigError(std::string(candidate.id) + " reports no work to choose by");
    }
    if (runners_.empty()) throw ConfigError("auto has nothing to choose from");
    for (std::uint32_t body = 0; body < scene.body_count(); ++body) {
      const double primitives = scene.primitives(body).count();
      primitives_ += primitives;
      if (!scene.moving(body)) continue;
      size_.bodies += 1;
      size_.primitives += primitives;
      // Leaves of a mesh share vertices, those of a soup do not.
      size_.reads += std::max(0.85 * primitives, double(scene.vertex_count(body)));
    }
    offers_.resize(runners_.size());
    policy_.emplace(runners_.size(), ChoicePolicy::Settings{.gain = params.number("gain")});
  }

  void reset_to(double t) override {
    policy_->start_over();
    this->start_over(t);
    for (Runner& runner : runners_) runner.searched_until = -never;
    seen_ = size_;
    refit_ = {};
    first_join_ = 0;
    look_at_ = surface_at_ = 1;
    started_at_ = 0;
    step_ = 0;
    only_rays_ = plans_changed_ = plans_are_old_ = false;
    segment_begin_ = segment_end_ = t;
    surface_ = runner().work->surface();
    begin_frame(t);
  }

  void advance_to(double t) override {
    end_frame();
    if (t > this->previous_time()) step_ = t - this->previous_time();
    look(t);
    if (!policy_->due() && frames_of(policy_->active(), t) > 0) return answer_by(policy_->go_on(), t);
    make_offers(t);
    answer_by(policy_->next(offers_), t);
  }

  QueryStatus find_candidates(double t, PairBuffer& out, const Budget& /*budget*/) override {
    const std::size_t before = out.size();
    // Not all candidates honour a budget.
    const bool limited = policy_->state() == ChoiceState::tries && active().info->can.time_budget;
    if (!limited) stop_endless_join(t);
    QueryStatus status =
        active().strategy->candidates_at(t, out, limited ? Budget{most_box_tests()} : Budget{});
    if (limited && !status.complete()) {
      out.resize(before);
      stop(t);
      status = active().strategy->candidates_at(t, out, {});
    }
    see(out.size() - before);
    return status;
  }

  /// Counts the contacts: pairs that intersect are the same for all candidates, unlike those that may.
  void confirm_candidates(double t, PairBuffer& pairs) override {
    Base::confirm_candidates(t, pairs);
    contacts_ = double(pairs.size());
  }

  void find_changes(double t, Answer answer, PairBuffer& begun, PairBuffer& ended) override {
    stop_endless_join(t);
    Base::find_changes(t, answer, begun, ended);
    see(this->pairs_of_changes(answer).size());
  }

  void answer_probes(double t, const Probes<S>& probes) override {
    active().strategy->probe_at(t, probes);
    ray_tests_ += double(runner().work->last_ray_tests());
    asked_ = true;
  }

  void follow_plans(double t, std::span<const PlanChange<S>> changes) override {
    Base::follow_plans(t, changes);
    plans_changed_ = true;
  }

  void prepare_sweep(double t) override {
    if (!active().info->can.contacts) {
      this->step_back();
      Base::answer_by(ChoicePolicy::refit, t);
    }
    active().strategy->start_sweep(t);
  }
  void find_swept_pairs(double t0, double t1, std::span<const S* const> before, PairBuffer& out) override {
    active().strategy->swept_pairs(t0, t1, before, out);
  }

  std::string choice() const override {
    const std::string text = Base::choice();
    return text.empty() ? text : text + last_seen(seen_);
  }

 private:
  struct Runner {
    const ChoiceCandidate* candidate;
    ReportsWork* work;
    double searched_until = 0;  ///< end of the segment of its last search
    int frames = 1;             ///< of its last unit
  };
  static constexpr double never = std::numeric_limits<double>::infinity();
  /// Frames after which the surfaces of boxes are looked at again, and of the longest unit.
  static constexpr int longest_look = 16, longest_unit = 128;

  Runner& runner() { return runners_[policy_->active()]; }
  const Runner& runner() const { return runners_[policy_->active()]; }
  const ChoiceCandidate& candidate() const { return *runner().candidate; }
  bool is_join() const { return candidate().unit == ChoiceUnit::segment; }
  static bool refits(const Runner& one) {
    return one.candidate->unit == ChoiceUnit::frame && !(one.candidate->build > 0);
  }
  void answer_by(std::size_t next, double t) {
    if (!this->goes_on(next)) {
      started_at_ = this->frame() + 1;
      runners_[next].searched_until = -never;
    }
    if (policy_->begins()) runners_[next].frames = offers_[next].frames;
    Base::answer_by(next, t);
    begin_frame(t);
  }

  // ---- Limits

  /// Returns the box tests that the active candidate may make in this frame.
  std::uint64_t most_box_tests() const {
    return std::uint64_t(std::clamp((policy_->limit() - update_work()) / candidate().box_test, 0.0, 1e15));
  }
  /// Lets another candidate answer this frame, after the active one has made all box tests that it may.
  void stop(double t) {
    const double work = update_work() + candidate().box_test * double(most_box_tests());
    this->step_back();
    answer_by(policy_->stopped(work), t);
  }
  /// A join that can be stopped takes longer, so its search is watched only where it may reach the limit.
  void stop_endless_join(double t) {
    if (!is_join() || policy_->state() == ChoiceState::stopped) return;
    const double usual = runner().frames * policy_->estimate(policy_->active());
    if (usual >= policy_->limit() / 4 && !runner().work->searches_within(most_box_tests())) stop(t);
  }

  // ---- Counted work

  void begin_frame(double t) {
    asked_ = pairs_asked_ = false;
    ray_tests_ = found_ = contacts_ = 0;
    span_tests_ = runner().work->span_tests();
    frame_tests_ = runner().work->frame_tests();
    fetched_ = this->sampled_.fetched();
    // The search of a join serves a segment; after its end, the next frame searches again.
    searches_ = !is_join() || t > runner().searched_until;
    if (searches_) runner().searched_until = segment_end_;
  }
  void see(std::size_t candidates) {
    found_ = contacts_ = double(candidates);
    asked_ = pairs_asked_ = true;
  }
  /// Returns the work of this frame without the query.
  double update_work() const { return searches_ ? candidate().update(seen_) : candidate().frame; }
  /// Counts the work of the frame that ends.
  void end_frame() {
    only_rays_ = asked_ && !pairs_asked_;
    if (!asked_) return;
    const ReportsWork& work = *runner().work;
    const double pair_tests = pairs_asked_ && searches_ ? double(work.last_box_tests()) : 0,
                 ray_tests = costs::Ageing::ray_test * ray_tests_;
    double query = ray_tests + candidate().box_test * pair_tests + candidate().pair * found_;
    if (is_join())
      query += ChoicePrices::span_test * double(work.span_tests() - span_tests_) +
               ChoicePrices::frame_test * double(work.frame_tests() - frame_tests_) +
               ChoicePrices::fetch * double(this->sampled_.fetched() - fetched_);
    if (candidate().build > 0) {
      const bool known = this->frame() - started_at_ >= frames_of_unit;
      query += upkeep(candidate().build * seen_.primitives,
                      known ? candidate().box_test * work.growth() : seen_.ageing);
    }
    policy_->worked(update_work() + query, contacts_);
    if (policy_->active() == ChoicePolicy::refit)
      refit_ = {pair_tests + ray_tests, found_, policy_->contacts(), seen_.growth};
    if (is_join() && pair_tests > 0) see_join_age(pair_tests / policy_->contacts());
  }

  // ---- Observations

  /// Looks at the plans where a segment begins and after changes that have become rare, and from time to time
  /// at velocities and at the surfaces of boxes.
  void look(double t) {
    const int frame = this->frame() + 1;
    plans_are_old_ = plans_are_old_ || plans_changed_;
    seen_.changes_per_frame +=
        ((std::exchange(plans_changed_, false) ? 1.0 : 0.0) - seen_.changes_per_frame) / std::min(frame, 16);
    // A join answers the last frame of a segment before it begins the next one.
    const bool ends = is_join() ? t > segment_end_ : t >= segment_end_;
    if (step_ > 0 && (ends || (plans_are_old_ && seen_.changes_per_frame <= rare))) look_at_plans();
    if (frame >= look_at_) {
      look_at_ = frame + std::min(frame, longest_look);
      seen_.translates = translate();
    }
    if (frame < surface_at_ || !refits(runner()) || !(surface_ > 0)) return;
    surface_at_ = frame + std::min(frame, longest_look);
    const double growth = std::max(1.0, runner().work->surface() / surface_);
    see_growth(growth);
  }
  void see_growth(double growth) {
    policy_->changed(std::abs(growth / seen_.growth - 1));
    seen_.growth = growth;
  }
  /// A join's trees are those of the refit. Their age shows in its box tests for each contact, if clearly.
  void see_join_age(double tests_per_contact) {
    if (!(first_join_ > 0)) first_join_ = tests_per_contact;
    const double grown = tests_per_contact / first_join_;
    if (grown > 1.5) see_growth(std::cbrt(grown * grown));
  }
  void look_at_plans() {
    plans_are_old_ = false;
    segment_begin_ = -never;
    segment_end_ = never;
    for (std::uint32_t body = 0; body < this->scene_.body_count(); ++body) {
      segment_begin_ = std::max(segment_begin_, motion_.lines_begin(body));
      segment_end_ = std::min(segment_end_, motion_.lines_end(body));
    }
    seen_.frames = std::max(1.0, (segment_end_ - segment_begin_) / step_);
    if (seen_.translates) seen_.translates = translate();
  }
  /// Whether some bodies move as a whole: each of them the same at its first, middle and last vertex.
  bool translate() const {
    int looked_at = 0;
    for (std::uint32_t body = 0; body < this->scene_.body_count() && looked_at < 4; ++body) {
      const std::uint32_t count = this->scene_.vertex_count(body);
      if (!this->scene_.moving(body) || count == 0) continue;
      ++looked_at;
      double way[3], differs = 0, length = 0;
      for (int axis = 0; axis < 3; ++axis) {
        way[axis] = velocity(body, 0, axis);
        for (const std::uint32_t vertex : {count / 2, count - 1})
          differs = std::max(differs, std::abs(velocity(body, vertex, axis) - way[axis]));
        length = std::max(length, std::abs(way[axis]));
      }
      if (length == 0 || differs > 0.02 * length) return false;
    }
    return looked_at > 0;
  }
  double velocity(std::uint32_t body, std::uint32_t vertex, int axis) const {
    const Piece<S> piece = motion_.piece(body, vertex, axis);
    return piece.kind == PieceKind::ray ? double(piece.x1)
                                        : (double(piece.x1) - double(piece.x0)) / (piece.t1 - piece.t0);
  }

  void make_offers(double t) {
    seen_.refit = never;
    for (std::size_t i = 0; i < runners_.size(); ++i)
      if (refits(runners_[i])) seen_.refit = std::min(seen_.refit, policy_->estimate(i));
    const double more = policy_->contacts() / refit_.contacts;
    seen_.box_tests = more * refit_.box_tests * std::pow(seen_.growth / refit_.growth, 1.5);
    seen_.pairs = more * refit_.pairs;
    seen_.ageing = seen_.box_tests * (1 - 1 / seen_.growth) / (this->frame() + 1);
    for (std::size_t i = 0; i < runners_.size(); ++i) {
      const ChoiceCandidate& one = *runners_[i].candidate;
      const bool joins = one.unit == ChoiceUnit::segment;
      Offer& offer = offers_[i];
      offer.frames = frames_of(i, t);
      offer.whole =
          joins ? std::max(offer.frames, int(std::min(seen_.frames, double(longest_unit)))) : offer.frames;
      offer.fixed = joins ? one.frame + (one.update(seen_) - one.frame) / offer.whole : one.update(seen_);
      offer.change = this->goes_on(i) ? 0 : ChoicePrices::start * primitives_ + one.build * seen_.primitives;
      const auto [expected, hoped] = one.predict(seen_, one);
      offer.follows_prediction = joins;
      offer.expected = expected;
      offer.hoped = hoped;
    }
  }
  /// Returns the frames that a candidate could answer from this one on with one unit.
  int frames_of(std::size_t runner, double t) const {
    const ChoiceUnit unit = runners_[runner].candidate->unit;
    // Rays meet the same trees with slabs and without; they do not show the work of those that are no trees.
    const bool by_rays =
        unit == ChoiceUnit::frame && (runner == ChoicePolicy::refit || !refits(runners_[runner]));
    if (only_rays_ && !by_rays) return 0;
    if (unit == ChoiceUnit::frame) return 1;
    if (unit == ChoiceUnit::frames) return frames_of_unit;
    // A search for the last frames of a segment takes as long as one for all of it.
    const bool begins = step_ > 0 && (runner == policy_->active() ||
                                      segment_end_ - t >= most_of_it * (segment_end_ - segment_begin_));
    if (!begins || seen_.changes_per_frame > rare || !(segment_end_ - segment_begin_ < never)) return 0;
    return int(std::clamp((segment_end_ - t) / step_ + 1.5, 1.0, double(longest_unit)));
  }

  static constexpr double rare = 0.02;       ///< changes of plans per frame
  static constexpr double most_of_it = 0.6;  ///< of a segment that has to be left for a join to begin

  SegmentMotion<S> motion_;
  std::vector<Runner> runners_;  ///< of the instances
  std::vector<Offer> offers_;    ///< [runner]
  std::optional<ChoicePolicy> policy_;
  double primitives_ = 0;  ///< of all bodies
  Observed size_, seen_;   ///< before any frame, and now
  /// The last frame of the refit.
  struct {
    double box_tests = 0, pairs = 0, contacts = 1, growth = 1;
  } refit_;
  double first_join_ = 0;  ///< box tests for each contact of the first join
  int look_at_ = 1, surface_at_ = 1,
      started_at_ = 0;                          ///< frames: of the next looks, of the active one's start
  double step_ = 0, surface_ = 0;               ///< seconds; of the refitted boxes at the start
  double segment_begin_ = 0, segment_end_ = 0;  ///< seconds
  bool plans_changed_ = false, plans_are_old_ = false;  ///< since the last frame, since the last look
  // Of the current frame; the counts are those at its beginning.
  bool searches_ = false, asked_ = false, pairs_asked_ = false, only_rays_ = false;
  double ray_tests_ = 0, found_ = 0, contacts_ = 0;  ///< found_: candidates
  std::uint64_t span_tests_ = 0, frame_tests_ = 0, fetched_ = 0;
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
                      "estimated speed-up from which on another strategy replaces the active one",
                      1},
                     threads_parameter("positions and the work of the chosen strategies that take threads")},
  })};
}
