#pragma once
#include <chrono>
#include <map>
#include <vector>

#include "core/hierarchy/oracle.hpp"
#include "core/registry.hpp"

namespace kbvh {

/// Plan changes to be made at run time, at frames: the same script is replayed to every contestant.
template <class S>
struct PlanScript {
  struct Step {
    double time;  ///< of a frame; the changes are made after its query
    std::vector<PlanChange<S>> changes;
  };
  std::vector<Step> steps;  ///< ascending times
};

/// How one contestant is to be run.
struct Contestant {
  const StrategyEntry* entry = nullptr;
  std::map<std::string, std::string> params;
  BuilderConfig builder;  ///< ignored by strategies that build their own hierarchy
};

/// Seconds of one frame by phase (design, measuring policy).
struct PhaseTimes {
  double motion = 0, update = 0, traversal = 0, triangle_tests = 0, plan_changes = 0;
  double query() const { return traversal + triangle_tests; }
  double total() const { return update + traversal + triangle_tests + plan_changes; }
};

/// One contestant on one scene: the only driver there is; verification, benchmarks and lessons all use it.
template <class S>
class Session {
 public:
  /// Builds topologies at the first frame and makes the instance. Throws ConfigError.
  Session(const Scene<S>& scene, const Contestant& contestant, CountingPolicy policy)
      : scene_(&scene), view_(scene), info_(&contestant.entry->info), playback_(scene) {
    const Params params(info_->id, info_->parameters, contestant.params);
    Topologies topologies;
    if (!info_->topology.own) topologies = build_topologies(view_, playback_, contestant.builder);
    strategy_ = create(*contestant.entry, view_, playback_, std::move(topologies), params, policy);
  }
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  /// Starts at time t; phase times so far are forgotten.
  void reset(double t) {
    playback_.seek(t);
    playback_.evaluate_all();
    strategy_->reset(t);
  }
  /// Moves to t, with positions if the strategy wants all of them, and advances.
  void advance(double t, PhaseTimes& times) {
    playback_.seek(t);
    if (info_->positions == PositionUse::all) timed(times.motion, [&] { playback_.evaluate_all(); });
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
  /// Moves to t and appends the pairs of the interval that this takes, for strategies that declare spans.
  void spans(double t, SpanBuffer& out) {
    const double from = playback_.time();
    playback_.seek(t);
    strategy_->spans(from, t, out);
  }
  /// Makes the changes at the current time.
  void change_plans(std::span<const PlanChange<S>> changes, PhaseTimes& times) {
    playback_.change_plans(playback_.time(), changes);
    timed(times.plan_changes, [&] { strategy_->flight_plans_changed(playback_.time(), changes); });
  }

  Strategy<S>& strategy() { return *strategy_; }
  Playback<S>& playback() { return playback_; }
  const Info& info() const { return *info_; }
  const Scene<S>& scene() const { return *scene_; }

 private:
  template <class Work>
  static void timed(double& seconds, Work&& work) {
    const auto begin = std::chrono::steady_clock::now();
    work();
    seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  }
  const Scene<S>* scene_;
  SceneView<S> view_;
  const Info* info_;
  Playback<S> playback_;
  std::unique_ptr<Strategy<S>> strategy_;
};

}  // namespace kbvh
