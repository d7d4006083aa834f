#pragma once
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "core/contract/registry.hpp"
#include "core/judge/contact_sweep.hpp"
#include "core/judge/phase_times.hpp"
#include "core/judge/range_watch.hpp"
#include "core/scene/self_pairs.hpp"

namespace kbvh {

/// How one contestant is to be run.
struct Contestant {
  const StrategyEntry* entry = nullptr;
  std::map<std::string, std::string> params;
  BuilderConfig builder;  ///< ignored by strategies that build their own hierarchy
};

/// One contestant on one scene: the only driver there is; verification, benchmarks and lessons all use it.
template <class S>
class Session {
 public:
  /// Builds topologies at the first frame and makes the instance. Throws ConfigError.
  Session(const Scene<S>& scene, const Contestant& contestant, CountingPolicy policy)
      : original_(&scene),
        contestant_(contestant),
        policy_(policy),
        info_(&contestant.entry->info),
        changing_(info_->can.geometry_changes ? std::optional<ChangingScene<S>>(scene) : std::nullopt),
        scene_(changing_ ? &changing_->scene() : &scene),
        view_(*scene_),
        playback_(scene) {
    make_strategy();
  }
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  /// Starts at time t, with the scene's own plans and geometry again. Where geometry was changed the
  /// instance is made anew, and references to it are not valid any more. Throws std::invalid_argument, with
  /// nothing changed, if t is not finite, or not admissible (motion/admissible.hpp).
  void reset(double t) {
    check_time(t, "cannot start");
    playback_.restore_plans();
    if (geometry_changed_) {
      changing_.emplace(*original_);
      playback_.seek(overlaid_keyframes(*original_).front());
      make_strategy();
      sweep_.reset();
      geometry_changed_ = false;
    }
    watch_.start(playback_);
    seek(t);
    playback_.evaluate_all();
    strategy_->reset(t);
  }
  /// Keeps an array with a body's positions for the next call that moves to another time (`reset`, `advance`,
  /// `contacts`), and the frames after that (Playback::hand_in). For contacts the array that was handed in
  /// before has to hold the positions of before until then.
  void hand_in(std::uint32_t body, const S* positions) { handed_in_.push_back({body, positions}); }
  /// Moves to t, with positions if the strategy wants all of them, and advances. Throws
  /// std::invalid_argument, with nothing changed, if t is before the present time, not finite or not
  /// admissible, or a vertex has left the admissible range by then.
  void advance(double t, PhaseTimes& times) {
    if (!(t >= playback_.time()))
      throw std::invalid_argument("cannot advance from t = " + std::to_string(playback_.time()) +
                                  " back to " + std::to_string(t));
    watch_.check(playback_, t);
    seek(t);
    if (info_->positions == PositionUse::all ||
        (info_->positions == PositionUse::varying && strategy_->wants_all_positions()))
      timed(times.motion, [&] { playback_.evaluate_all(); });
    timed(times.update, [&] { strategy_->advance(t); });
  }
  /// Fills `pairs` with the confirmed pairs at the current time.
  QueryStatus query(PairBuffer& pairs, PhaseTimes& times, const Budget& budget = {}) {
    QueryStatus status;
    pairs.clear();
    timed(times.traversal, [&] { status = strategy_->candidates_at(playback_.time(), pairs, budget); });
    timed(times.triangle_tests, [&] { strategy_->confirm(playback_.time(), pairs); });
    return status;
  }
  /// Performs the first event if it is due by time `until` (Strategy::step_event); the motion stays where it
  /// is until the next `advance`.
  bool step_event(double until, EventDescription<S>& out) { return strategy_->step_event(until, out); }
  /// Moves to t and appends the pairs of the interval that this takes, for strategies that declare spans.
  void spans(double t, SpanBuffer& out) {
    const double from = playback_.time();
    watch_.check(playback_, t);
    seek(t);
    strategy_->spans(from, t, out);
  }
  /// Moves to t and appends the contacts of features on the way, for strategies that declare contacts: every
  /// vertex moves on a straight line from its present position to that at t. To be called after `reset` and
  /// then again and again, no further than to `next_knot` at a time, without frames between; plans and
  /// geometry may change between two calls (edges are numbered anew then, as of the present geometry). The
  /// narrow phase counts as triangle tests. Throws std::invalid_argument, with nothing changed, unless all
  /// bodies consist of triangles, and if t is beyond the next knot or not after the present time. Returns the
  /// pairs of primitives that came to the narrow phase.
  std::size_t contacts(double t, ContactBuffer& out, PhaseTimes& times) {
    if (!info_->can.contacts) throw std::logic_error("'" + info_->id + "' does not declare contacts");
    if (!(t > playback_.time()) || !std::isfinite(t))
      throw std::invalid_argument("contacts from t = " + std::to_string(playback_.time()) +
                                  " to t = " + std::to_string(t) + ", which is not later");
    if (const double knot = next_knot(); t > knot)
      throw std::invalid_argument("contacts to t = " + std::to_string(t) + " across the knot of a plan at " +
                                  std::to_string(knot));
    if (!sweep_) sweep_.emplace(*scene_);
    return sweep_->find(
        *strategy_, playback_, t, [this](double to) { seek(to); }, out, times);
  }
  /// The first time after the present one at which the plan of any vertex has a knot; infinite if none has.
  /// O(bodies + plans of their own).
  double next_knot() const {
    double knot = std::numeric_limits<double>::infinity();
    for (std::uint32_t body = 0; body < playback_.body_count(); ++body)
      knot = std::min(knot, playback_.plans(body).lines_end(playback_.time()));
    return knot;
  }
  /// How contacts were decided; after the first call of `contacts`.
  ImpactStats impact_stats() const { return sweep_ ? sweep_->stats() : ImpactStats{}; }
  /// The swept pairs of the last call of `contacts`, which must have been called.
  const PairBuffer& swept_pairs() const { return sweep_->pairs(); }

  /// Makes the changes at the current time, all of them or, if one is not valid, none
  /// (Playback::change_plans).
  void change_plans(std::span<const PlanChange<S>> changes, PhaseTimes& times) {
    timed(times.motion, [&] {
      if (changing_) changing_->check_plans(changes);
      playback_.change_plans(playback_.time(), changes);
    });
    for (const PlanChange<S>& change : changes) watch_.changed(playback_, change.body, change.vertex);
    timed(times.plan_changes, [&] { strategy_->flight_plans_changed(playback_.time(), changes); });
  }
  /// Inserts and deletes at the current time; the scene given to the constructor stays as it is. Throws
  /// std::logic_error if the strategy does not declare geometry changes, std::invalid_argument (see
  /// ChangingScene) with nothing changed.
  void change_geometry(const GeometryChange<S>& change, PhaseTimes& times) {
    if (!changing_) throw std::logic_error("'" + info_->id + "' does not declare geometry changes");
    timed(times.motion, [&] { changing_->apply(change, playback_); });
    geometry_changed_ = true;
    sweep_.reset();  // its features are those of before
    watch_.added(playback_, change);
    timed(times.geometry_changes, [&] { strategy_->geometry_changed(playback_.time(), change); });
  }

  Strategy<S>& strategy() { return *strategy_; }
  Playback<S>& playback() { return playback_; }
  const Info& info() const { return *info_; }
  /// The scene as it is now.
  const Scene<S>& scene() const { return *scene_; }

 private:
  void make_strategy() {
    if (const std::string why = unsuitable_bodies(*info_, *scene_); !why.empty())
      throw ConfigError("'" + info_->id + "' " + why);
    const Params params(info_->id, info_->parameters, contestant_.params);
    Topologies topologies;
    if (!info_->topology.own) topologies = build_topologies(view_, playback_, contestant_.builder);
    strategy_ = create(*contestant_.entry, view_, playback_, std::move(topologies), params, policy_);
  }
  void seek(double t) {
    playback_.seek(t);
    for (const auto& [body, positions] : handed_in_) playback_.hand_in(body, positions);
    handed_in_.clear();
  }
  const Scene<S>* original_;
  Contestant contestant_;
  CountingPolicy policy_;
  const Info* info_;
  std::optional<ChangingScene<S>> changing_;  ///< for strategies that can follow
  const Scene<S>* scene_;
  SceneView<S> view_;
  Playback<S> playback_;
  RangeWatch<S> watch_;
  std::unique_ptr<Strategy<S>> strategy_;
  bool geometry_changed_ = false;
  std::vector<std::pair<std::uint32_t, const S*>> handed_in_;
  std::optional<ContactSweep<S>> sweep_;  ///< made by the first call of `contacts`
};

}  // namespace kbvh
