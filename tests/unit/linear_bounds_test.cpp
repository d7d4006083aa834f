// Properties of bounds over segments that the conformance suite cannot check: the work that they leave out,
// and that work ahead of time is spread.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "core/judge/verify.hpp"
#include "tests/support/moving_grids.hpp"
#include "tests/support/rolled_sheet.hpp"

namespace kbvh::test::linear_bounds_test {
namespace {

constexpr std::array<const char*, 3> all_linear{"linear_bounds", "interval_join", "interval_join_ahead"};

template <class S>
Verification verified(Session<S>& session, const Scene<S>& scene, const std::vector<double>& frames) {
  Oracle<S> oracle(scene);
  return verify(session, std::span<const double>(frames), oracle);
}

// ---- What is left out

TEST(LinearBounds, BodiesFarApartGetOneBoxASegment) {
  const Scene<float> bent = grids<float>(40, 50, left_side), lifted_whole = grids<float>(40, 50, lifted);
  for (const char* id : all_linear)
    for (const Scene<float>* scene : {&bent, &lifted_whole}) {
      Play<float> play(*scene, id, {});
      // The work of the second segment, which begins at the second frame, if nothing is made ahead.
      const Counters first = play.frame(0.5);
      Counters next = play.frame(1.5);
      const bool ahead = id == all_linear[2];
      EXPECT_TRUE(ahead || first[Counter::vertex_reads] == 0) << id;
      for (std::size_t c = 0; ahead && c < next.values.size(); ++c) next.values[c] += first.values[c];
      const bool moves_as_a_whole = scene == &lifted_whole;
      EXPECT_EQ(next[Counter::vertex_reads], moves_as_a_whole ? 0 : bent.bodies[0].plans.vertex_count())
          << id;
      EXPECT_EQ(next[Counter::bodies_translated], moves_as_a_whole ? 1u : 0u) << id;
      EXPECT_EQ(next[Counter::values_written], 0u) << id;
      EXPECT_EQ(next[Counter::bodies_skipped], 2u) << id;
      EXPECT_EQ(next[Counter::nodes_visited], 0u) << id;
    }
}

TEST(LinearBounds, ABodyWithItselfNeedsNoUpdateBetweenKeyframes) {
  const Scene<float> scene = rolled_sheet<float>(20, 3, 0.3, 0.02);
  for (const char* id : all_linear) {
    Play<float> play(scene, id, {});
    Play<float> refit(scene, "bottom_up", {});
    std::size_t pairs = 0;
    for (int f = 1; f <= 20; ++f) {
      const Counters frame = play.frame(f / 10.0);
      if (f % 10 > 1 && id != all_linear[2]) {
        EXPECT_EQ(frame[Counter::values_written], 0u) << id << ", frame " << f;
      }
      refit.frame(f / 10.0);
      std::sort(play.pairs.begin(), play.pairs.end());
      std::sort(refit.pairs.begin(), refit.pairs.end());
      EXPECT_EQ(play.pairs, refit.pairs) << id << ", frame " << f;
      pairs += play.pairs.size();
    }
    EXPECT_GT(pairs, 1000u) << id;
  }
}

TEST(LinearBounds, BodiesThatComeNearAgainGetAllTheirBoxes) {
  // Apart for two segments, through each other in the third, apart again.
  Scene<double> scene = grids<double>(10, 3, [](std::uint32_t) { return 0.0; });
  std::vector<double> positions;
  for (const double x : {0.0, 0.1, 0.2, 5.0, 5.1, 5.2})
    for (std::uint32_t v = 0; v < 121; ++v)
      for (const double c : {x + (v % 11) / 10.0, (v / 11) / 10.0, 0.02 * x}) positions.push_back(c);
  scene.bodies[0].plans = FlightPlans<double>(121, {0, 1, 2, 3, 4, 5}, std::move(positions));
  for (const char* id : {"linear_bounds", "interval_join", "interval_join_ahead", "drift_boxes",
                         "drift_boxes_bounded", "auto"}) {
    const StrategyEntry& entry = find_strategy(id);
    Session<double> session(scene, {&entry, {}, entry.info.topology.preferred});
    Oracle<double> oracle(scene);
    const std::vector<double> frames = frame_times(scene, 13);
    const Verification result = verify(session, std::span<const double>(frames), oracle);
    EXPECT_EQ(result.first_violation, "") << id;
    EXPECT_EQ(result.audit.protrusion, 0) << id;
    EXPECT_GT(session.strategy().counters()[Counter::bodies_skipped], 0u) << id;
  }
}

TEST(LinearBounds, BodiesAtRestBehindTheClipAreNotWhereTheyWereBeforeIt) {
  // The second body rests, moves far between two frames, and rests.
  Scene<float> scene = grids<float>(6, 0.3, [](std::uint32_t i) { return 0.02 * i; });
  std::vector<float> positions;
  for (const float x : {0.3f, 0.6f})
    for (std::uint32_t v = 0; v < 49; ++v)
      for (const float c : {x + float(v % 7) / 6, float(v / 7) / 6, 0.05f * float(v / 7) - 0.01f})
        positions.push_back(c);
  scene.bodies[1].plans = FlightPlans<float>(49, {1, 2}, std::move(positions));
  for (const char* id : all_linear)
    for (const std::vector<double>& frames :
         {std::vector<double>{0, 1, 2}, {-1, 0, 1, 2, 5}, {-1, 8}, {0.5, 2, 2.5}, {0.5, 1.5, 7}}) {
      const StrategyEntry& entry = find_strategy(id);
      Session<float> session(scene, {&entry, {}, entry.info.topology.preferred});
      const Verification result = verified(session, scene, frames);
      EXPECT_EQ(result.first_violation, "") << id << ", " << frames.size() << " frames";
      EXPECT_EQ(result.audit.protrusion, 0) << id;
      EXPECT_GT(result.pairs, 0u);
    }
}

TEST(LinearBounds, ASegmentIsNotCutBecauseTheOneBeforeWas) {
  // The first body turns by a quarter, so that boxes in between are loose, and is then bent.
  Scene<double> scene = grids<double>(20, 0.2, [](std::uint32_t) { return 0.0; });
  std::vector<double> positions;
  for (int k = 0; k < 3; ++k)
    for (std::uint32_t v = 0; v < 441; ++v) {
      const double x = v % 21 / 20.0, y = v / 21 / 20.0;
      for (const double c : {k == 0 ? x : 1 - y, k == 0 ? y : x, k == 2 ? 0.1 * x * x : 0.0})
        positions.push_back(c);
    }
  scene.bodies[0].plans = FlightPlans<double>(441, {0, 1, 2}, std::move(positions));
  for (const char* id : all_linear) {
    Play<double> play(scene, id, {{"max_looseness", "0.0005"}});
    // Fewer frames than pieces: the last frame before the knot is not in the last piece.
    for (const double t : {0.25, 0.5, 0.75}) EXPECT_GT(play.frame(t)[Counter::vertex_reads], 0u) << id;
    play.frame(1.25);
    for (const double t : {1.5, 1.75, 2.0})
      EXPECT_EQ(play.frame(t)[Counter::vertex_reads], 0u) << id << ", t = " << t;
  }
}

// ---- Translation

/// Two grids that cross: the first one moves by (1/16, 1/64, 0) from keyframe to keyframe. Its coordinates
/// are multiples of 1/1024, or arbitrary, and one vertex is `wrong` in the last keyframe.
Scene<float> crossing(double unit, float wrong) {
  constexpr std::uint32_t n = 16, keyframes = 9;
  Scene<float> scene = grids<float>(n, 0.5, lifted);
  std::vector<float> positions;
  for (std::uint32_t k = 0; k < keyframes; ++k)
    for (std::uint32_t v = 0; v < (n + 1) * (n + 1); ++v)
      for (const double c : {v % (n + 1) / double(n) + k / 16.0, v / (n + 1) / double(n) + k / 64.0,
                             (int(v % 3) - 1) / 1024.0})
        positions.push_back(float(unit * c));
  positions.back() += wrong;
  std::vector<double> times;
  for (std::uint32_t k = 0; k < keyframes; ++k) times.push_back(k);
  scene.bodies[0].plans = FlightPlans<float>((n + 1) * (n + 1), times, std::move(positions));
  return scene;
}

TEST(LinearBounds, BodiesThatMoveAsAWholeHaveTheirBoxesMoved) {
  const Scene<float> exact = crossing(1, 0), rounded = crossing(1.1, 0), bent = crossing(1, 0x1p-6f);
  for (const char* id : all_linear) {
    Play<float> play(exact, id, {}), almost(rounded, id, {}), other(bent, id, {});
    std::uint64_t pairs = 0;
    for (int f = 1; f <= 32; ++f) {
      EXPECT_EQ(play.frame(f / 4.0)[Counter::vertex_reads], 0u) << id << ", frame " << f;
      almost.frame(f / 4.0);
      other.frame(f / 4.0);
      pairs += play.pairs.size();
    }
    EXPECT_GT(pairs, 0u);
    // The first of eight segments begins with `reset`, which is not counted.
    EXPECT_EQ(play.last[Counter::bodies_translated], 7u) << id;
    EXPECT_EQ(other.last[Counter::bodies_translated], 6u) << id << ": all segments but the last";
    // Rounding enlarges moved boxes, so they are recomputed every few segments.
    EXPECT_GE(almost.last[Counter::bodies_translated], 3u) << id;
    EXPECT_LT(almost.last[Counter::bodies_translated], 7u) << id;

    for (const Scene<float>* scene : {&exact, &rounded}) {
      Session<float> session(*scene, {&find_strategy(id), {}, find_strategy(id).info.topology.preferred});
      const Verification result = verified(session, *scene, frame_times(*scene, 5));
      EXPECT_EQ(result.first_violation, "") << id;
      EXPECT_LT(result.audit.looseness(), 1e-3) << id;
    }
  }
}

/// Two waving sheets that lie in each other, with the given number of keyframes.
Scene<float> waves(std::uint32_t n, std::uint32_t keyframes) {
  Scene<float> scene;
  for (const double phase : {0.0, 1.0}) {
    Body<float> body = grid<float>(n, 0.01 * phase, 0.02 * phase, 1, lifted);
    std::vector<float> positions;
    std::vector<double> times;
    for (std::uint32_t k = 0; k < keyframes; ++k) {
      times.push_back(k);
      for (std::uint32_t v = 0; v < (n + 1) * (n + 1); ++v) {
        const double x = v % (n + 1) / double(n), y = v / (n + 1) / double(n);
        for (const double c : {x + 0.01 * phase, y, 0.01 * std::sin(40 * x + 30 * y + 0.2 * k + phase)})
          positions.push_back(float(c));
      }
    }
    body.plans = FlightPlans<float>((n + 1) * (n + 1), times, std::move(positions));
    scene.bodies.push_back(std::move(body));
  }
  scene.pairs = all_pairs(scene.bodies);
  return scene;
}

// ---- Ahead of time

TEST(IntervalJoinAhead, SpreadsTheWorkOfASegment) {
  const Scene<float> scene = waves(48, 5);
  constexpr int l = 20;
  Play<float> ahead(scene, "interval_join_ahead", {}), at_once(scene, "interval_join", {});
  for (int segment = 0; segment < 4; ++segment) {
    std::uint64_t tests = 0, attempts = 0, most_tests = 0, most_attempts = 0, at_once_tests = 0;
    for (int f = 1; f <= l; ++f) {
      const double t = segment + f / double(l);
      const Counters frame = ahead.frame(t);
      at_once_tests = std::max(at_once_tests, at_once.frame(t)[Counter::box_tests]);
      EXPECT_EQ(ahead.pairs.size(), at_once.pairs.size()) << t;
      std::sort(ahead.pairs.begin(), ahead.pairs.end());
      std::sort(at_once.pairs.begin(), at_once.pairs.end());
      EXPECT_EQ(ahead.pairs, at_once.pairs) << t;
      tests += frame[Counter::box_tests];
      attempts += frame[Counter::span_tests];
      most_tests = std::max(most_tests, frame[Counter::box_tests]);
      most_attempts = std::max(most_attempts, frame[Counter::span_tests]);
    }
    if (segment == 3) {
      EXPECT_EQ(tests, 0u) << "nothing comes after the last segment";
    } else {
      EXPECT_GT(tests, 0u);
      EXPECT_LT(most_tests, tests / 4) << segment;
      EXPECT_LT(most_attempts, attempts / 3) << segment;
    }
    EXPECT_EQ(at_once_tests > 0, segment > 0) << "the first segment was asked about at t = 0";
  }
}

TEST(IntervalJoinAhead, CountsNoBoxesThatItDidNotMake) {
  const Scene<float> scene = waves(160, 3);
  const std::map<std::string, std::string> restarted{{"plan_changes", "restarted"}};
  Play<float> ahead(scene, "interval_join_ahead", restarted), at_once(scene, "interval_join", restarted);
  PlanScript<float>::Step step;
  for (int f = 1; f <= 20; ++f) {
    // A change at every frame: work begun ahead is discarded.
    const double t = f / 1024.0;
    step.time = t;
    step.changes = {{.body = 0,
                     .vertex = std::uint32_t(f),
                     .times = {1, 2},
                     .positions = {0.1f, 0.2f, 0.3f, 0.1f, 0.2f, 0.3f},
                     .velocity = {}}};
    const std::uint64_t made = ahead.frame(t, &step)[Counter::nodes_visited];
    const std::uint64_t needed = at_once.frame(t, &step)[Counter::nodes_visited];
    EXPECT_GE(made, needed) << f;
    EXPECT_LT(made, needed + needed / 4) << f;
  }
}

std::vector<double> coordinates(Session<float>& session, std::uint32_t body) {
  std::vector<double> all;
  const std::optional<AuditView> view = session.strategy().audit_view(body);
  for (const Box<double>& box : view->boxes)
    for (int axis = 0; axis < 3; ++axis) {
      all.push_back(box.lower[axis]);
      all.push_back(box.upper[axis]);
    }
  return all;
}

TEST(IntervalJoinAhead, EqualsTheJoinAtOnceWhateverFramesThereAre) {
  const Scene<float> scene = waves(12, 8);
  Session<float> ahead(scene, {&find_strategy("interval_join_ahead"), {}, {.width = 8, .leaf_size = 4}});
  Session<float> at_once(scene, {&find_strategy("interval_join"), {}, {.width = 8, .leaf_size = 4}});
  PairBuffer pairs, expected;
  PhaseTimes times;
  // Knots met and missed, segments skipped, some of them begun ahead; before the clip and after it; frames
  // without a query; and again from the middle of the clip.
  const std::vector<std::vector<double>> plays{
      {-1, -0.5, 0, 0.1, 0.2, 1, 1.5, 1.9, 2.5, 3.1, 3.2, 5.7, 6.9, 7, 8},
      {0.5, 0.6, 1.1, 4, 4.5, 5, 5, 5.5, 9},
      {3.3, 3.4, 3.9, 4.1, 4.2, 6.5}};
  for (const std::vector<double>& play : plays)
    for (const std::size_t every : {std::size_t(1), std::size_t(3)}) {
      ahead.reset(play[0]);
      at_once.reset(play[0]);
      for (std::size_t f = 0; f < play.size(); ++f) {
        if (f > 0) ahead.advance(play[f], times), at_once.advance(play[f], times);
        if (f % every != 0) continue;
        ahead.query(pairs, times);
        at_once.query(expected, times);
        std::sort(pairs.begin(), pairs.end());
        std::sort(expected.begin(), expected.end());
        EXPECT_EQ(pairs, expected) << "t = " << play[f] << ", every " << every;
        for (std::uint32_t body = 0; body < 2; ++body)
          EXPECT_EQ(coordinates(ahead, body), coordinates(at_once, body)) << "t = " << play[f];
      }
    }
}

}  // namespace
}  // namespace kbvh::test::linear_bounds_test
