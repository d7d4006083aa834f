#pragma once
#include <algorithm>
#include <map>

#include "core/judge/follow_script.hpp"
#include "core/judge/probe_oracle.hpp"
#include "tests/conformance/check.hpp"
#include "tests/support/ray_sets.hpp"

namespace kbvh::test {

inline constexpr std::size_t most_frames = 4;

/// The queries of one frame, and the truth.
template <class S>
struct FrameTruth {
  std::vector<Ray<S>> rays;
  std::vector<RayHit> hits;
  PairBuffer pairs;
};

/// The truth of a scene by frame, found by the first contestant to reach it: all see the same positions.
template <class S>
using Truth = std::map<std::size_t, FrameTruth<S>>;

template <class S>
const FrameTruth<S>& truth_at(Truth<S>& truth, std::size_t frame, Session<S>& session) {
  const auto [place, fresh] = truth.try_emplace(frame);
  FrameTruth<S>& known = place->second;
  if (!fresh) return known;
  session.playback().evaluate_all();
  known.rays = rays_at(session.scene(), session.playback(), 5, std::uint32_t(frame) + 1);
  known.hits.resize(known.rays.size());
  brute_force_hits<S>(session.scene(), session.playback(), RayQuery::closest, known.rays,
                      std::span<RayHit>(known.hits));
  known.pairs = sweep_pairs(session.scene(), session.playback());
  return known;
}

/// Returns every frame at which a script changes something, and a few of the others.
template <class S>
std::vector<double> some_frames(const TestScene<S>& test) {
  std::vector<double> frames = test.frames.empty() ? frame_times(test.scene, 3) : test.frames;
  if (!test.script.steps.empty() || frames.size() <= most_frames) return frames;
  std::vector<double> some;
  for (std::size_t i = 0; i < most_frames; ++i)
    some.push_back(frames[i * (frames.size() - 1) / (most_frames - 1)]);
  return some;
}

/// Plays some frames of a clip, with all changes of its script, and calls look(2 * frame) at each of them,
/// and look(2 * frame + 1) after a change of geometry there.
template <class S, class Look>
void play_some_frames(Session<S>& session, const TestScene<S>& test, const Look& look) {
  const std::vector<double> frames = some_frames(test);
  ScriptCursor<S> cursor(test.script.steps.empty() ? nullptr : &test.script);
  PhaseTimes ignored;
  for (std::size_t f = 0; f < frames.size(); ++f) {
    if (f == 0)
      session.reset(frames[0]);
    else
      session.advance(frames[f], ignored);
    look(2 * f);
    const auto* const step = cursor.at(frames[f]);
    if (step == nullptr) continue;
    follow(session, step, ignored);
    if (!step->geometry.empty()) look(2 * f + 1);
  }
}

/// Plays a clip with rays and pairs alternately, and returns the first violation, or an empty text.
template <class S>
std::string rays_violation(const StrategyEntry& entry, const TestScene<S>& test, const BuilderConfig& builder,
                           const std::map<std::string, std::string>& params, Truth<S>& truth,
                           std::uint64_t& hits) {
  if (!skipped(entry, test).empty() || !unsuitable_bodies(entry.info, test.scene).empty()) return {};
  Session<S> session(test.scene, {&entry, params, builder});
  PhaseTimes ignored;
  PairBuffer pairs;
  std::string violation;
  const auto look = [&](std::size_t frame) {
    const std::string where = "frame " + std::to_string(frame) + ": ";
    if (frame % 2 == 1) session.query(pairs, ignored);
    // Rays come before the truth, which evaluates all positions.
    const auto known = truth.find(frame);
    std::vector<RayHit> found[2];
    const auto ask = [&](const std::vector<Ray<S>>& rays) {
      for (const RayQuery query : {RayQuery::closest, RayQuery::any}) {
        auto& answers = found[query == RayQuery::any ? 1 : 0];
        answers.resize(rays.size());
        session.probe(RayProbes<S>{query, rays, std::span<RayHit>(answers)}, ignored);
      }
    };
    if (known != truth.end()) ask(known->second.rays);
    const FrameTruth<S>& expected = truth_at(truth, frame, session);
    if (known == truth.end()) ask(expected.rays);
    session.query(pairs, ignored);
    std::sort(pairs.begin(), pairs.end());
    session.playback().evaluate_all();
    for (const RayQuery query : {RayQuery::closest, RayQuery::any}) {
      const ProbeCheck check = compare_hits<S>(session.scene(), session.playback(), query, expected.rays,
                                               found[query == RayQuery::any ? 1 : 0], expected.hits);
      hits += check.hits;
      if (!check.holds() && entry.info.rays_guarantee == Guarantee::exact && violation.empty())
        violation = where + check.first_violation;
    }
    if (entry.info.guarantee == Guarantee::exact && pairs != expected.pairs && violation.empty())
      violation = where + "pairs after rays are not the pairs that intersect";
  };
  play_some_frames(session, test, look);
  return violation;
}

}  // namespace kbvh::test
