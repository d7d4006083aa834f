// The beginning of a clip: nothing that is derived from the motion after the first frame is made before
// `reset`, and nothing of it survives a reset. For every linked strategy.

#include <gtest/gtest.h>

#include <cmath>

#include "core/judge/verify.hpp"
#include "tests/support/grids.hpp"
#include "tests/support/play.hpp"

namespace kbvh::test::clip_beginning_test {
namespace {

constexpr std::uint32_t keyframes = 6;

/// A motion: moves a vertex of body `body` from keyframe 0 on by this much at keyframe k.
struct Motion {
  double height, phase;
  bool translates;  ///< the first body moves as a whole
  double operator()(std::uint32_t body, std::uint32_t k, std::uint32_t i, std::uint32_t j, int axis) const {
    if (k == 0) return 0;
    if (translates && body == 0) return axis == 2 ? 0.015 * k : 0;
    const double along = axis == 2 ? 1 : axis == 0 ? 0.1 : 0;
    return along * height * std::sin(phase + 0.7 * k + 0.5 * i + 0.3 * j + body);
  }
};

/// Two grids that cut each other while they move, and one at rest below them; at keyframe 0 the same for all
/// motions.
Scene<float> scene_of(const Motion& motion) {
  Scene<float> scene;
  for (const std::uint32_t body : {0U, 1U, 2U})
    scene.bodies.push_back(placed_grid<float>(
        12, body == 2 ? 1 : keyframes, [&](std::uint32_t k, std::uint32_t i, std::uint32_t j, int axis) {
          const double start = axis == 0   ? 0.3 * body + i / 12.0
                               : axis == 1 ? 0.02 * body + j / 12.0
                                           : 0.01 * std::sin(2.0 * i + body) - 0.02 * (body == 2);
          return start + motion(body, k, i, j, axis);
        }));
  scene.pairs = all_pairs(scene.bodies);
  return scene;
}

/// Replaces the keyframes of `scene`, which its sessions share, by those of `other`. (The arrays are not
/// constant; plans only expose them as constant.)
void replace_motion(const Scene<float>& scene, const Scene<float>& other) {
  for (std::size_t body = 0; body < scene.bodies.size(); ++body) {
    const FlightPlans<float>&plans = scene.bodies[body].plans, &others = other.bodies[body].plans;
    for (std::size_t k = 1; k < plans.keyframe_count(); ++k)
      std::copy_n(others.keyframe(k), 3 * plans.keyframed_count(), const_cast<float*>(plans.keyframe(k)));
  }
}

struct Played {
  std::string violation;
  Counters counters;
  std::uint64_t fetched = 0;  ///< positions, from the beginning on
};

/// Plays a clip as for timing, and compares every frame with the truth.
Played play(Session<float>& session, const std::vector<double>& frames, Oracle<float>& oracle) {
  Played played;
  PhaseTimes ignored;
  PairBuffer pairs;
  const std::uint64_t before = session.playback().fetched();
  session.restore(frames[0]);
  for (std::size_t f = 0; f < frames.size(); ++f) {
    if (f == 0)
      session.start(ignored);
    else
      session.advance(frames[f], ignored);
    session.query(pairs, ignored);
    std::sort(pairs.begin(), pairs.end());
    const PairBuffer* truth = oracle.known(frames[f], 0);
    if (played.violation.empty() && session.info().guarantee != Guarantee::approximate && pairs != *truth)
      played.violation = "t = " + std::to_string(frames[f]) + ": " + std::to_string(pairs.size()) +
                         " pairs, the truth has " + std::to_string(truth->size());
  }
  played.counters = session.strategy().counters();
  played.fetched = session.playback().fetched() - before;
  return played;
}

void expect_equal(const Played& found, const Played& fresh, const std::string& what) {
  EXPECT_EQ(found.violation, "") << what;
  for (std::size_t c = 0; c < std::size_t(Counter::count); ++c) {
    if (Counter(c) == Counter::bytes) continue;
    EXPECT_EQ(found.counters.values[c], fresh.counters.values[c]) << what << ": " << name(Counter(c));
  }
  ASSERT_EQ(found.counters.named.size(), fresh.counters.named.size()) << what;
  for (std::size_t c = 0; c < found.counters.named.size(); ++c)
    EXPECT_EQ(found.counters.named[c].value, fresh.counters.named[c].value)
        << what << ": " << found.counters.named[c].name;
  EXPECT_EQ(found.fetched, fresh.fetched) << what;
}

TEST(ClipBeginning, NothingOfTheMotionIsKnownBeforeOrLeftFromAnEarlierPlay) {
  const Motion usual{0.03, 0, false}, slow{0.002, 1, true};
  const Scene<float> truth_scene = scene_of(usual);
  // The first frames rest, so that the first segment also begins in a frame, and its work is counted.
  std::vector<double> frames{-0.5};
  for (const double t : frame_times(truth_scene, 4)) frames.push_back(t);
  Oracle<float> oracle(truth_scene);
  Playback<float> playback(truth_scene);
  std::size_t pairs = 0;
  for (const double t : frames) {
    playback.seek(t);
    playback.evaluate_all();
    pairs += oracle.pairs(playback).size();
  }
  ASSERT_GT(pairs, 100u);
  for (const StrategyEntry& entry : registry()) {
    if (entry.factory<float>() == nullptr) continue;
    SCOPED_TRACE(entry.info.id);
    const Contestant contestant{&entry, {}, entry.info.topology.preferred};
    Session<float> fresh(truth_scene, contestant);
    const Played first = play(fresh, frames, oracle);
    EXPECT_EQ(first.violation, "");
    expect_equal(play(fresh, frames, oracle), first, "second play");

    const Scene<float> made_before = scene_of(slow);
    Session<float> created(made_before, contestant);
    replace_motion(made_before, truth_scene);
    expect_equal(play(created, frames, oracle), first, "created for another motion");

    const Scene<float> played_before = scene_of(slow);
    Session<float> again(played_before, contestant);
    PhaseTimes ignored;
    PairBuffer found;
    again.restore(frames[0]);
    for (std::size_t f = 0; f < frames.size(); ++f) {
      f == 0 ? again.start(ignored) : again.advance(frames[f], ignored);
      again.query(found, ignored);
    }
    replace_motion(played_before, truth_scene);
    expect_equal(play(again, frames, oracle), first, "played with another motion before");
  }
}

}  // namespace
}  // namespace kbvh::test::clip_beginning_test
