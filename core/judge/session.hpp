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

#include "core/base/interruption.hpp"
#include "core/contract/registry.hpp"
#include "core/judge/contact_sweep.hpp"
#include "core/judge/phase_times.hpp"
#include "core/judge/range_watch.hpp"
#include "core/scene/self_pairs.hpp"

namespace kbvh {

/// The configuration of one contestant.
struct Contestant {
  const StrategyEntry* entry = nullptr;
  std::map<std::string, std::string> params;
  BuilderConfig builder;  ///< ignored by strategies that build their own hierarchy
};

/// The purpose of a session's instance; timed instances are made by Strategy::be_timed.
enum class Use : std::uint8_t { verified, timed };

/// Drives one contestant on one scene. This is the only driver, shared by verification, benchmarks and
/// lessons.
template <class S>
class Session {
 public:
  /// Builds the topologies at the first frame and makes the instance. Throws ConfigError.
  Session(const Scene<S>& scene, const Contestant& contestant, Use use = Use::verified)
      : original_(&scene),
        contestant_(contestant),
        use_(use),
        info_(&contestant.entry->info),
        changing_(info_->can.geometry_changes ? std::optional<ChangingScene<S>>(scene) : std::nullopt),
        scene_(changing_ ? &changing_->scene() : &scene),
        has_vertex_sets_(scene.has_vertex_sets()),
        view_(*scene_),
        playback_(scene),
        watch_(*info_) {
    make_strategy();
  }
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  /// Starts at time t, with the scene's original plans and geometry: `restore`, then `start`; afterwards all
  /// positions are current. If the geometry was changed, a new instance is created, and references to the old
  /// one become invalid. Throws std::invalid_argument and changes nothing if t is not finite or not
  /// admissible (motion/admissible.hpp).
  void reset(double t) {
    PhaseTimes ignored;
    restore(t);
    start(ignored);
    playback_.evaluate_all();
  }
  /// Restores the scene's plans and geometry at time t, before a clip begins; `start` must follow. Throws
  /// like `reset`.
  void restore(double t) {
    Interruptible::check();
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
  }
  /// Starts the strategy at the restored time: the beginning of a clip. Positions are evaluated unless the
  /// strategy declares that it fetches those that it needs. The strategy's `reset` counts as update.
  void start(PhaseTimes& times) {
    if (info_->positions != PositionUse::fetched) timed(times.motion, [&] { playback_.evaluate_all(); });
    timed(times.update, [&] { strategy_->reset(playback_.time()); });
  }
  /// Stores an array with a body's positions for the next call that moves to another time (`reset`,
  /// `advance`, `contacts`), and for the frames after it (Playback::hand_in). For contacts, the array handed
  /// in before must keep the previous positions until then. Throws std::invalid_argument if a position is
  /// beyond the range of the contestant (Info::max_coordinate).
  void hand_in(std::uint32_t body, const S* positions) {
    if (body < playback_.body_count())
      watch_.check_positions(body, playback_.plans(body).vertex_count(), positions);
    handed_in_.push_back({body, positions});
  }
  /// Moves to t, with positions if the strategy needs all of them, and advances the strategy. Throws
  /// std::invalid_argument and changes nothing if t is before the current time, not finite or not admissible,
  /// or if a vertex has by then left the admissible range or that of the contestant.
  void advance(double t, PhaseTimes& times) {
    if (!(t >= playback_.time()))
      throw std::invalid_argument("cannot advance from t = " + number_text(playback_.time()) + " back to " +
                                  number_text(t));
    Interruptible::check();
    watch_.check(playback_, t);
    seek(t);
    if (info_->positions == PositionUse::all ||
        (info_->positions == PositionUse::varying && strategy_->wants_all_positions()))
      timed(times.motion, [&] { playback_.evaluate_all(); });
    timed(times.update, [&] { strategy_->advance(t); });
  }
  /// Fills `pairs` with the confirmed pairs at the current time.
  QueryStatus query(PairBuffer& pairs, PhaseTimes& times, const Budget& budget = {}) {
    Interruptible::check();
    QueryStatus status;
    pairs.clear();
    timed(times.traversal, [&] { status = strategy_->candidates_at(playback_.time(), pairs, budget); });
    timed(times.triangle_tests, [&] { strategy_->confirm(playback_.time(), pairs); });
    return status;
  }
  /// Replaces `begun` and `ended` by the changes of an answer at the current time (Strategy::changes_at). All
  /// of this time counts as traversal, triangle tests included.
  void changes(Answer answer, PairBuffer& begun, PairBuffer& ended, PhaseTimes& times) {
    timed(times.traversal, [&] { strategy_->changes_at(playback_.time(), answer, begun, ended); });
  }
  /// Answers probes at the current time (Strategy::probe_at). All of this time counts as traversal. Throws
  /// std::invalid_argument if a probe is beyond the range of the contestant.
  void probe(const Probes<S>& probes, PhaseTimes& times) {
    watch_.check_probes(probes);
    timed(times.traversal, [&] { strategy_->probe_at(playback_.time(), probes); });
  }
  /// Performs the first event if it is due by time `until` (Strategy::step_event); the motion keeps its time
  /// until the next `advance`.
  bool step_event(double until, EventDescription<S>& out) { return strategy_->step_event(until, out); }
  /// Moves to t and appends the pairs of the elapsed interval, for strategies with spans.
  void spans(double t, SpanBuffer& out) {
    Interruptible::check();
    const double from = playback_.time();
    watch_.check(playback_, t);
    seek(t);
    strategy_->spans(from, t, out);
  }
  /// Moves to t and appends the contacts of features on the way, for strategies with contacts: every vertex
  /// moves on a straight line from its current position to its position at t. Call it after `reset` and then
  /// repeatedly, each time no further than `next_knot`, without frames in between. Plans and geometry may
  /// change between two calls (edges are then renumbered for the current geometry). The narrow phase counts
  /// as triangle tests. Throws std::invalid_argument and changes nothing unless all bodies consist of
  /// triangles, and if t is beyond the next knot or not after the current time. Returns the number of
  /// primitive pairs that reached the narrow phase.
  std::size_t contacts(double t, ContactBuffer& out, PhaseTimes& times) {
    if (!info_->can.contacts) throw std::logic_error("'" + info_->id + "' does not declare contacts");
    if (!(t > playback_.time()) || !std::isfinite(t))
      throw std::invalid_argument("contacts from t = " + number_text(playback_.time()) +
                                  " to t = " + number_text(t) + ", which is not later");
    if (const double knot = next_knot(); t > knot)
      throw std::invalid_argument("contacts to t = " + number_text(t) + " across the knot of a plan at " +
                                  number_text(knot));
    Interruptible::check();
    watch_.check(playback_, t);
    if (!sweep_) sweep_.emplace(*scene_);
    return sweep_->find(
        *strategy_, playback_, t, [this](double to) { seek(to); }, out, times);
  }
  /// Returns the first time after the current one at which the plan of any vertex has a knot; infinite if
  /// none has. O(bodies + own plans).
  double next_knot() const {
    double knot = std::numeric_limits<double>::infinity();
    for (std::uint32_t body = 0; body < playback_.body_count(); ++body)
      knot = std::min(knot, playback_.plans(body).lines_end(playback_.time()));
    return knot;
  }
  /// Returns how contacts were decided; valid after the first call of `contacts`.
  ImpactStats impact_stats() const { return sweep_ ? sweep_->stats() : ImpactStats{}; }
  /// Returns the swept pairs of the last call of `contacts`; there must have been one.
  const PairBuffer& swept_pairs() const { return sweep_->pairs(); }

  /// Applies the changes at the current time: all of them, or none if one is invalid (see
  /// Playback::change_plans) or beyond the range of the contestant. Changes of a vertex set are given for one
  /// of its bodies, and told to the strategy for all.
  void change_plans(std::span<const PlanChange<S>> changes, PhaseTimes& times) {
    watch_.check_plans(changes);
    timed(times.motion, [&] {
      if (changing_) changing_->check_plans(changes);
      playback_.change_plans(playback_.time(), changes);
    });
    for (const PlanChange<S>& change : changes) watch_.changed(playback_, change.body, change.vertex);
    std::vector<PlanChange<S>> of_bodies;
    if (has_vertex_sets_) changes = of_bodies = changes_of_bodies(*scene_, changes);
    timed(times.plan_changes, [&] { strategy_->flight_plans_changed(playback_.time(), changes); });
  }
  /// Inserts and deletes at the current time; the scene given to the constructor stays unchanged. Vertices of
  /// a vertex set are given for one of its bodies. Throws std::logic_error if the strategy does not declare
  /// geometry changes, and std::invalid_argument (see ChangingScene) without any change.
  void change_geometry(const GeometryChange<S>& change, PhaseTimes& times) {
    if (!changing_) throw std::logic_error("'" + info_->id + "' does not declare geometry changes");
    watch_.check_added(change);
    timed(times.motion, [&] { changing_->apply(change, playback_); });
    geometry_changed_ = true;
    sweep_.reset();  // its features belong to the old geometry
    std::optional<GeometryChange<S>> repeated;
    if (has_vertex_sets_) repeated = changes_of_bodies(*scene_, change);
    const GeometryChange<S>& of_bodies = repeated ? *repeated : change;
    watch_.added(playback_, of_bodies);
    timed(times.geometry_changes, [&] { strategy_->geometry_changed(playback_.time(), of_bodies); });
  }

  Strategy<S>& strategy() { return *strategy_; }
  Playback<S>& playback() { return playback_; }
  const Info& info() const { return *info_; }
  /// Returns the current scene.
  const Scene<S>& scene() const { return *scene_; }

 private:
  void make_strategy() {
    if (const std::string why = unsuitable_bodies(*info_, *scene_); !why.empty())
      throw ConfigError("'" + info_->id + "' " + why);
    const Params params(info_->id, info_->parameters, contestant_.params);
    Topologies topologies;
    if (!info_->topology.own) topologies = build_topologies(view_, playback_, contestant_.builder);
    strategy_ = create(*contestant_.entry, view_, playback_, std::move(topologies), params);
    if (use_ == Use::timed) strategy_->be_timed();
  }
  void seek(double t) {
    playback_.seek(t);
    for (const auto& [body, positions] : handed_in_) playback_.hand_in(body, positions);
    handed_in_.clear();
  }
  const Scene<S>* original_;
  Contestant contestant_;
  Use use_;
  const Info* info_;
  std::optional<ChangingScene<S>> changing_;  ///< for strategies that support geometry changes
  const Scene<S>* scene_;
  bool has_vertex_sets_;
  SceneView<S> view_;
  Playback<S> playback_;
  RangeWatch<S> watch_;
  std::unique_ptr<Strategy<S>> strategy_;
  bool geometry_changed_ = false;
  std::vector<std::pair<std::uint32_t, const S*>> handed_in_;
  std::optional<ContactSweep<S>> sweep_;  ///< made by the first call of `contacts`
};

}  // namespace kbvh
