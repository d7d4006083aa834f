// A strategy that chooses among other strategies by observed properties of the scene: the number of frames
// per segment of the flight plans, the vertex steps per frame, changes of plans, and the number of
// candidates; the growth of boxes as trees age, with the box tests that new trees save; the triangle and box
// tests of the interval join, by which a join that decides little for spans of time, or whose trees have
// aged, is left after some frames; and the candidates that slabs at the leaves leave out. The choice depends
// on counts and plans only, never on a clock, so that a run can be repeated.
//
// Each candidate has one instance from the first frame on, with its own hierarchies. This costs the memory of
// all candidates and saves creating an instance at a change. Inactive instances do not advance.

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "core/contract/registry.hpp"
#include "core/contract/tells_work.hpp"
#include "core/families/choice/observed_ageing.hpp"
#include "core/families/choice/observed_slabs.hpp"
#include "core/families/choice/predicted_costs.hpp"

namespace kbvh {
namespace {

/// A strategy to choose, its explicitly set parameters, and its predicted cost. To add a candidate, add a
/// line: any registered strategy that follows plan changes and needs no more foresight than the next keyframe
/// is suitable.
struct Candidate {
  const char* id;
  std::map<std::string, std::string> params;
  double (*cost)(const Observed&);
};
const std::vector<Candidate>& candidates() {
  static const std::vector<Candidate> list{
      {"leaf_slabs", {}, &refit_cost},  // first: it answers until observations exist
      {"bottom_up", {}, &plain_cost},   {"lbvh_drift", {}, &rebuilt_cost},
      {"drift_boxes", {}, &drift_cost}, {"interval_join", {}, &join_cost},
  };
  return list;
}

/// Counts nothing itself: its counters are those of its instances, with the triangle tests of silent ones, so
/// it is no CountedStrategy.
template <class S, class Count>
class Auto final : public Strategy<S>,
                   public AnswersChanges<S>,
                   public AnswersRays<S>,
                   public TakesPlanChanges<S> {
 public:
  static constexpr Foresight foresight = Foresight::next_keyframe;

  Auto(const SceneView<S>& scene, const SegmentMotion<S>& motion, Topologies topologies, const Params& params)
      : Strategy<S>(scene, motion), motion_(motion), gain_(params.number("gain")) {
    for (std::uint32_t body = 0; body < scene.body_count(); ++body) measure(topologies[body], body);
    constexpr auto policy = Count::enabled ? CountingPolicy::counting : CountingPolicy::silent;
    for (const Candidate& candidate : candidates()) {
      const auto found = std::find_if(registry().begin(), registry().end(), [&](const StrategyEntry& entry) {
        return entry.info.id == candidate.id;
      });
      if (found == registry().end() || !found->info.can.plan_changes || !found->info.can.rays) continue;
      const Params own(found->info.id, found->info.parameters, candidate.params);
      runners_.push_back({&candidate, found->info.positions == PositionUse::all,
                          NestedStrategies<S>::create(*found, scene, motion, topologies, own, policy)});
      Runner& runner = runners_.back();
      runner.work = dynamic_cast<TellsWork*>(runner.strategy.get());
    }
    if (runners_.empty()) throw ConfigError("auto has nothing to choose from");
    velocities_.resize(scene.body_count());
  }

  void reset_to(double t) override {
    for (Runner& runner : runners_) {
      runner.strategy->reset(t);
      runner.fresh = true;
      runner.frames = 0;
    }
    retired_ = {};
    active_ = 0;
    frame_ = chosen_at_ = 0;
    stay_ = shortest_stay;
    step_ = 0;
    segment_end_ = t;
    changes_ = false;
    chosen_candidates_ = tests_before_ = 0;
    chosen_near_ = false;
    touching_.clear();
    for (Reported& one : reported_) one.start_over();
    switches_ = 0;
    changed_.clear();
    body_changed_.assign(this->scene_.body_count(), 0);
    seen_ = {};
    for (const double reads : reads_) seen_.reads += reads;
    ageing_.start_over(runners_[0].work != nullptr ? runners_[0].work->surface() : 0);
    chosen_tests_ = 0;
    tried_ = false;
    slabs_.start_over(runners_[0].candidate->cost == &refit_cost, seen_);
  }

  void advance_to(double t) override {
    const double before = this->previous_time();
    ++frame_;
    seen_.changes_per_frame += ((changes_ ? 1.0 : 0.0) - seen_.changes_per_frame) / std::min(frame_, 16);
    changes_ = false;
    if (t > before) step_ = t - before;
    const std::size_t last = active_;
    const int stayed = frame_ - chosen_at_;
    const bool due = frame_ == 1 || stayed >= (t >= segment_end_ ? stay_ : longest_stay) ||
                     (seen_.changes_per_frame > 0 && !runners_[active_].all_positions) ||
                     seen_.near != chosen_near_ || seen_.candidates > 2 * chosen_candidates_ ||
                     2 * seen_.candidates < chosen_candidates_ || tried_ ||
                     (refits() && ageing_.tests() > 1.5 * chosen_tests_);
    if (step_ > 0 && due) choose(t);
    if (active_ != last) ++switches_;
    tried_ = active_ != last && (is_active(&rebuilt_cost) || is_active(&plain_cost));
    Runner& runner = runners_[active_];
    if (runner.all_positions) fetch_all();
    if (active_ == last || runner.fresh) {
      runner.strategy->advance(t);
    } else {
      add(retired_, runner.strategy->counters());
      fetch_all();
      runner.strategy->reset(t);
      // The instance sees the current plans, but not which bodies no longer rest.
      if (!changed_.empty()) runner.strategy->flight_plans_changed(t, changed_);
    }
    for (Runner& other : runners_) other.fresh = false;
    ++runner.frames;
  }

  QueryStatus find_candidates(double t, PairBuffer& out, const Budget& /*budget*/) override {
    const std::size_t before = out.size();
    // Not all candidates honour a budget.
    const QueryStatus status = runners_[active_].strategy->candidates_at(t, out, {});
    see_candidates(out.size() - before, true);
    const std::size_t count = out.size() - before, stride = std::max<std::size_t>(1, count / samples);
    touching_.clear();
    for (std::size_t i = 0; i < count && touching_.size() < samples; i += stride)
      touching_.push_back(out[before + i]);
    return status;
  }

  void confirm_candidates(double t, PairBuffer& pairs) override {
    runners_[active_].strategy->confirm(t, pairs);
  }

  /// Forwards; a strategy that has become active since the last call begins all pairs, and is compared with
  /// what the one before has reported.
  void find_changes(double t, Answer answer, PairBuffer& begun, PairBuffer& ended) override {
    Reported& reported = reported_[std::size_t(answer)];
    Strategy<S>& strategy = *runners_[active_].strategy;
    if (reported.switches == switches_) {
      strategy.changes_at(t, answer, begun, ended);
    } else {
      reported.switches = switches_;
      strategy.changes_at(t, answer, now_, none_);
      before_.clear();
      reported.pairs.append_to(before_);
      difference_.find(before_, now_, begun, ended);
    }
    for (const PrimitivePair& pair : ended) reported.pairs.erase(pair);
    for (const PrimitivePair& pair : begun) reported.pairs.insert(pair);
    // Pairs that intersect stand for the candidates among which they are.
    see_candidates(reported.pairs.size(), answer == Answer::candidates);
    touching_.clear();
    reported.pairs.sample(samples, touching_);
  }

  void find_hits(double t, RayQuery query, std::span<const Ray<S>> rays, std::span<RayHit> hits) override {
    runners_[active_].strategy->hits_at(t, query, rays, hits);
  }

  void follow_plans(double t, std::span<const PlanChange<S>> changes) override {
    for (const PlanChange<S>& change : changes) {
      if (body_changed_[change.body] != 0) continue;
      body_changed_[change.body] = 1;
      changed_.push_back(change);
    }
    runners_[active_].strategy->flight_plans_changed(t, changes);
    for (std::size_t i = 0; i < runners_.size(); ++i)
      if (i != active_) runners_[i].fresh = false;
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
    char segments[48] = "one segment", last[160];
    if (std::isfinite(seen_.frames_per_segment))
      std::snprintf(segments, sizeof segments, "%.3g frames per segment", seen_.frames_per_segment);
    std::snprintf(
        last, sizeof last,
        " (last seen: %s, steps of %.2g leaves, %.2g between candidates, %.0f candidates, plans changed at "
        "%.2g of frames)",
        segments, seen_.step, seen_.slide, seen_.candidates, seen_.changes_per_frame);
    return text + last;
  }

  std::size_t bytes() const override {
    std::size_t total =
        (touching_.capacity() + now_.capacity() + before_.capacity()) * sizeof(PrimitivePair) +
        changed_.capacity() * sizeof(PlanChange<S>) + difference_.bytes() + reported_[0].pairs.bytes() +
        reported_[1].pairs.bytes();
    for (const Runner& runner : runners_) total += runner.strategy->bytes();
    return total;
  }

 protected:
  void start_counting() override { first_fetch_ = this->sampled_.fetched(); }
  Counters counted() const override {
    Counters table = retired_;
    for (const Runner& runner : runners_) add(table, runner.strategy->counters());
    if constexpr (Count::enabled) table[Counter::positions_fetched] = this->sampled_.fetched() - first_fetch_;
    return table;
  }

 private:
  struct Runner {
    const Candidate* candidate;
    bool all_positions;
    std::unique_ptr<Strategy<S>> strategy;
    TellsWork* work = nullptr;  ///< the strategy, if it does
    bool fresh = false;         ///< in the state after `reset`
    int frames = 0;             ///< number of frames that it answered
  };
  /// The number of frames after which the choice is reviewed within one segment, and at the start of a new
  /// one; the latter doubles each time that the choice is confirmed.
  static constexpr int longest_stay = 64, shortest_stay = 8;
  static constexpr std::uint32_t samples = 24;
  static constexpr std::size_t most_pairs = 1024;  ///< pairs of bodies that a choice examines

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

  /// Measures a body's hierarchy: the current mean side of leaf boxes, and the number of vertices in its
  /// leaves.
  void measure(const Topology& topology, std::uint32_t body) {
    const Primitives& primitives = this->scene_.primitives(body);
    double sum = 0, leaves = 0, reads = 0;
    std::vector<std::uint32_t> unique;
    for (const TopologyNode& node : topology.nodes) {
      if (!node.is_leaf()) continue;
      Box<S> box;
      unique.clear();
      for (std::uint32_t k = node.first(); k < node.first() + node.count(); ++k)
        for (const std::uint32_t v : primitives[topology.primitives[k]]) {
          box.extend(motion_.position(body, v));
          unique.push_back(v);
        }
      std::sort(unique.begin(), unique.end());
      reads += double(std::unique(unique.begin(), unique.end()) - unique.begin());
      for (int axis = 0; axis < 3; ++axis) sum += (double(box.upper[axis]) - double(box.lower[axis])) / 3;
      ++leaves;
    }
    leaf_size_.push_back(leaves == 0 ? 0 : sum / leaves);
    reads_.push_back(this->scene_.moving(body) ? reads : 0);
  }

  /// Whether trees that are only refitted answer.
  bool refits() const { return active_ == 0 || is_active(&plain_cost); }
  bool is_active(double (*cost)(const Observed&)) const { return runners_[active_].candidate->cost == cost; }
  /// Strategies differ in the pairs that they leave out early: only drift_boxes reports all pairs of boxes,
  /// and shows that bodies are apart.
  void see_candidates(std::size_t count, bool all) {
    if (count != 0 || is_active(&drift_cost)) seen_.near = count != 0;
    if (!seen_.near) seen_.candidates = double(count);
    const TellsWork* work = runners_[active_].work;
    if (is_active(&refit_cost) && work != nullptr)
      slabs_.slabs(double(count), *work, all, frame_, seen_);
    else if (is_active(&plain_cost))
      slabs_.plain(double(count), all, frame_, seen_);
    if (work == nullptr) return;
    if (refits())
      ageing_.refitted(double(work->last_box_tests()));
    else if (is_active(&rebuilt_cost))
      ageing_.rebuilt(double(work->last_box_tests()), double(count), std::max(1, frame_), seen_);
  }
  /// Measures the work of the active strategy since the last choice.
  void see_work() {
    if (refits() && runners_[active_].work != nullptr)
      ageing_.look_at_refitted(runners_[active_].work->surface(), frame_, seen_);
    else if (is_active(&rebuilt_cost) && frame_ - chosen_at_ >= shortest_stay)
      ageing_.look_at_rebuilt();
    const double tests = double(runners_[active_].strategy->counters()[Counter::triangle_tests]);
    const double frames = frame_ - chosen_at_;
    // From time to time drift_boxes may look whether bodies have parted.
    if (frames >= longest_stay && seen_.candidates == 0) seen_.near = false;
    if (!is_active(&join_cost)) {
      seen_.undecided *= 0.8;
      seen_.join_tests *= 0.8;
    } else if (frames > 0) {
      if (seen_.candidates > 0) seen_.undecided = (tests - tests_before_) / frames / seen_.candidates;
      if (const TellsWork* work = runners_[active_].work; work != nullptr)
        seen_.join_tests = double(work->last_box_tests()) / seen_.frames_per_segment;
    }
    tests_before_ = tests;
  }

  void fetch_all() {
    for (std::uint32_t body = 0; body < this->scene_.body_count(); ++body) this->sampled_.fetch_all(body);
  }

  /// Reads the plans, and switches to a strategy that is predicted to be faster than the active one by at
  /// least `gain_`.
  void choose(double t) {
    see_work();
    chosen_at_ = frame_;
    chosen_candidates_ = seen_.candidates;
    chosen_near_ = seen_.near;
    chosen_tests_ = ageing_.tests();
    double begin = -std::numeric_limits<double>::infinity(), end = std::numeric_limits<double>::infinity();
    for (std::uint32_t body = 0; body < this->scene_.body_count(); ++body) {
      if (seen_.changes_per_frame == 0) {  // otherwise the observation takes too long and is unreliable
        begin = std::max(begin, motion_.lines_begin(body));
        end = std::min(end, motion_.lines_end(body));
      }
      sample(body);
    }
    seen_.step = seen_.spread = 0;
    // Samples some of many pairs of bodies: similar bodies show similar largest steps.
    const auto pairs = this->scene_.pairs();
    seen_.many_bodies = pairs.size() > most_pairs;
    const std::size_t apart = (pairs.size() + most_pairs - 1) / most_pairs;
    for (std::size_t i = 0; i < pairs.size(); i += apart) {
      pass(pairs[i].first, pairs[i].second);
      pass(pairs[i].second, pairs[i].first);
    }
    seen_.slide = slide();
    segment_end_ = end > t ? end : t;
    const bool known =
        begin > -std::numeric_limits<double>::infinity() && end < std::numeric_limits<double>::infinity();
    if (known)
      seen_.frames_per_segment = std::max(1.0, (end - begin) / step_);
    else if (frame_ == 1 || seen_.changes_per_frame > 0)
      seen_.frames_per_segment = std::numeric_limits<double>::infinity();
    slabs_.prepare_choice(frame_ - 1, seen_);
    const double gain = tried_ ? 1 : gain_;
    std::size_t best = active_;
    double least = runners_[active_].candidate->cost(seen_);
    for (std::size_t i = 0; i < runners_.size(); ++i) {
      const double cost = runners_[i].candidate->cost(seen_);
      if (cost < least && cost * gain < runners_[active_].candidate->cost(seen_)) {
        least = cost;
        best = i;
      }
    }
    stay_ = best == active_ ? std::min(2 * stay_, longest_stay) : shortest_stay;
    if (best != active_) tests_before_ = 0;  // it starts over
    active_ = best;
  }

  /// Samples the current velocities of some of a body's vertices.
  void sample(std::uint32_t body) {
    Velocities& seen = velocities_[body];
    const std::uint32_t count = this->scene_.vertex_count(body);
    seen = {};
    if (count == 0 || (!this->scene_.moving(body) && seen_.changes_per_frame == 0)) return;
    seen.count = std::min(samples, count);
    for (std::uint32_t i = 0; i < seen.count; ++i) {
      // Spreads the samples by the golden ratio: even steps may hit the same place in every row of a grid.
      const std::uint32_t share = 0x9e3779b9u * i;  // of 2^32
      const auto vertex = std::uint32_t(std::uint64_t(share) * count >> 32);
      for (int axis = 0; axis < 3; ++axis) {
        seen.of[i][axis] = velocity(body, vertex, axis);
        seen.mean[axis] += seen.of[i][axis] / seen.count;
      }
    }
  }
  double velocity(std::uint32_t body, std::uint32_t vertex, int axis) const {
    if (!this->scene_.moving(body) && seen_.changes_per_frame == 0) return 0;
    const Piece<S> piece = motion_.piece(body, vertex, axis);
    return piece.kind == PieceKind::ray ? double(piece.x1)
                                        : (double(piece.x1) - double(piece.x0)) / (piece.t1 - piece.t0);
  }
  /// Returns the step of primitives relative to their candidates in the last frame.
  double slide() const {
    double sum = 0;
    for (const PrimitivePair& pair : touching_) {
      const std::uint32_t a = this->scene_.primitives(pair.body_a)[pair.primitive_a][0];
      const std::uint32_t b = this->scene_.primitives(pair.body_b)[pair.primitive_b][0];
      double way[3];
      for (int axis = 0; axis < 3; ++axis)
        way[axis] = velocity(pair.body_a, a, axis) - velocity(pair.body_b, b, axis);
      const double leaf = std::max(leaf_size_[pair.body_a], leaf_size_[pair.body_b]);
      if (leaf > 0) sum += std::hypot(way[0], way[1], way[2]) * step_ / leaf;
    }
    return touching_.empty() ? seen_.step : sum / double(touching_.size());
  }
  /// Measures how a body's vertices move relative to another body as a whole. Common motion does not count:
  /// bounds that move contain it.
  void pass(std::uint32_t body, std::uint32_t other) {
    const Velocities &own = velocities_[body], &others = velocities_[other];
    if (own.count == 0 || leaf_size_[body] <= 0) return;
    double sum = 0;
    for (std::uint32_t i = 0; i < own.count; ++i)
      sum += std::hypot(own.of[i][0] - others.mean[0], own.of[i][1] - others.mean[1],
                        own.of[i][2] - others.mean[2]);
    const double common = own.count * std::hypot(own.mean[0] - others.mean[0], own.mean[1] - others.mean[1],
                                                 own.mean[2] - others.mean[2]);
    seen_.step = std::max(seen_.step, sum / own.count * step_ / leaf_size_[body]);
    if (sum > 0) seen_.spread = std::max(seen_.spread, 1 - common / sum);
  }

  /// What answers as changes add up to.
  struct Reported {
    PairSet pairs;
    int switches = 0;  ///< of the active strategy, at the last answer
    void start_over() {
      pairs.clear();
      switches = 0;
    }
  };
  struct Velocities {
    std::uint32_t count = 0;  ///< none: the body rests
    double of[samples][3] = {}, mean[3] = {};
  };
  SegmentMotion<S> motion_;
  double gain_;
  std::vector<Runner> runners_;
  std::vector<double> leaf_size_, reads_;  ///< by body
  std::vector<Velocities> velocities_;     ///< by body, per second
  Counters retired_;                       ///< counts of instances before their restart
  std::size_t active_ = 0;
  std::uint64_t first_fetch_ = 0;
  int frame_ = 0, chosen_at_ = 0, stay_ = shortest_stay;
  double step_ = 0, segment_end_ = 0;  ///< seconds
  double chosen_candidates_ = 0;       ///< number of candidates at the time of the choice
  bool chosen_near_ = false;           ///< whether bodies met then
  double tests_before_ = 0;            ///< triangle tests of the active strategy until then
  double chosen_tests_ = 0;            ///< box tests of the refitted trees in the frame before
  bool tried_ = false;  ///< a strategy answers for the first time whose work decides whether it stays
  ObservedAgeing ageing_;
  ObservedSlabs slabs_;
  bool changes_ = false;                ///< plans changed since the last frame
  std::vector<PlanChange<S>> changed_;  ///< since `reset`, the first change of each body
  std::vector<std::uint8_t> body_changed_;
  PairBuffer touching_;   ///< sample of the candidates of the last frame
  Reported reported_[2];  ///< [Answer]
  int switches_ = 0;      ///< changes of the active strategy since `reset`
  PairBuffer now_, none_, before_;
  PairDifference difference_;
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
