#pragma once
#include <map>
#include <string>
#include <vector>

#include "core/judge/follow_script.hpp"

namespace kbvh::test {

/// Plays a clip from 0 on, including queries, and returns what each frame added to the counters.
template <class S>
struct Play {
  /// Uses the topology that the strategy prefers.
  Play(const Scene<S>& scene, const char* id, std::map<std::string, std::string> params)
      : Play(scene, id, std::move(params), find_strategy(id).info.topology.preferred) {}
  Play(const Scene<S>& scene, const char* id, std::map<std::string, std::string> params,
       const BuilderConfig& builder)
      : session(scene, {&find_strategy(id), std::move(params), builder}) {
    reset(0);
  }
  void reset(double t) {
    session.reset(t);
    session.query(pairs, times);
    last = session.strategy().counters();
  }
  /// Plays a frame at t, after which plans change as in `step`; null: no change.
  Counters frame(double t, const typename PlanScript<S>::Step* step = nullptr) {
    session.advance(t, times);
    follow(session, step, times);
    session.query(pairs, times);
    const Counters now = session.strategy().counters();
    Counters added;
    for (std::size_t c = 0; c < added.values.size(); ++c) added.values[c] = now.values[c] - last.values[c];
    last = now;
    return added;
  }
  /// Returns [body][node]; for strategies that show them.
  std::vector<std::vector<Box<double>>> boxes() {
    std::vector<std::vector<Box<double>>> list;
    for (std::uint32_t body = 0; body < session.scene().bodies.size(); ++body)
      list.push_back(session.strategy().audit_view(body)->boxes);
    return list;
  }
  Session<S> session;
  PairBuffer pairs;
  PhaseTimes times;
  Counters last;
};

}  // namespace kbvh::test
