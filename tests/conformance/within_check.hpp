#pragma once
#include "tests/conformance/ray_check.hpp"
#include "tests/support/ball_sets.hpp"

namespace kbvh::test {

/// The balls of one frame, and what is within them.
template <class S>
struct WithinTruth {
  std::vector<Ball<S>> balls;
  BallHits hits;
};

/// Plays a clip with balls between queries of pairs, and returns the first violation, or an empty text. The
/// truth of a scene by frame is found by the first contestant to reach it.
template <class S>
std::string within_violation(const StrategyEntry& entry, const TestScene<S>& test,
                             const BuilderConfig& builder, const std::map<std::string, std::string>& params,
                             std::map<std::size_t, WithinTruth<S>>& truth, std::uint64_t& hits) {
  if (!skipped(entry, test).empty() || !unsuitable_bodies(entry.info, test.scene).empty()) return {};
  Session<S> session(test.scene, {&entry, params, builder});
  PhaseTimes ignored;
  PairBuffer pairs;
  std::string violation;
  const auto look = [&](std::size_t frame) {
    if (frame % 2 == 1) session.query(pairs, ignored);
    const auto [place, fresh] = truth.try_emplace(frame);
    WithinTruth<S>& known = place->second;
    if (fresh) {
      session.playback().evaluate_all();
      known.balls = balls_at(session.scene(), session.playback(), 4, std::uint32_t(frame) + 1);
      known.hits = brute_force_within<S>(session.scene(), session.playback(), known.balls);
    }
    BallHits found;
    session.probe(BallProbes<S>{known.balls, &found}, ignored);
    std::sort(found.begin(), found.end());
    const ProbeCheck check = compare_within(known.balls.size(), found, known.hits);
    hits += check.hits;
    if (!check.holds() && violation.empty())
      violation = "frame " + std::to_string(frame) + ": " + check.first_violation;
  };
  play_some_frames(session, test, look);
  return violation;
}

}  // namespace kbvh::test
