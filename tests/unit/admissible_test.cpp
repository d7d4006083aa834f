// The admissible range of coordinates, velocities and times: values beyond it are refused before any strategy
// plays them, and values within it are played by all.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

#include "core/contract/registry.hpp"
#include "core/judge/range_watch.hpp"
#include "core/judge/verify.hpp"
#include "tests/support/plan_changes.hpp"
#include "tests/support/synthetic_scenes.hpp"

namespace kbvh::admissible_test {
namespace {

using test::flies;

std::string complaint(const std::function<void()>& work) {
  try {
    work();
  } catch (const std::invalid_argument& problem) {
    return problem.what();
  }
  return "nothing was thrown";
}

/// Two bodies of a few triangles each around the origin; the first has two keyframes.
template <class S>
Scene<S> small_scene() {
  Scene<S> scene;
  for (int b = 0; b < 2; ++b) {
    std::mt19937 random(unsigned(b + 1));
    Body<S> body;
    body.name = b == 0 ? "first" : "second";
    std::vector<S> positions;
    for (std::uint32_t p = 0; p < 6; ++p) {
      const std::uint32_t corners[] = {3 * p, 3 * p + 1, 3 * p + 2};
      body.primitives.add(corners);
    }
    for (int i = 0; i < 2 * 54; ++i) positions.push_back(S(int(random() % 33) - 16) / 16);
    if (b == 1) positions.resize(54);
    body.plans = FlightPlans<S>(18, b == 0 ? std::vector<double>{0, 1} : std::vector<double>{0}, positions);
    scene.bodies.push_back(std::move(body));
  }
  scene.pairs = all_pairs(scene.bodies);
  return scene;
}

template <class S>
using Changes = std::vector<PlanChange<S>>;

/// A script without changes of geometry.
template <class S>
PlanScript<S> steps(const std::vector<std::pair<double, Changes<S>>>& list) {
  PlanScript<S> script;
  for (const auto& [time, changes] : list) script.steps.push_back({time, changes, {}});
  return script;
}

template <class S>
void refuses() {
  const Scene<S> scene = small_scene<S>();
  const S most = admissible_magnitude<S>;
  const auto said = [&](const PlanScript<S>& script, std::vector<double> frames) {
    return complaint([&] { check_played<S>(scene, script, frames); });
  };
  const S speed = most * S(0.8);
  const PlanScript<S> fast = steps<S>({{0, {flies<S>(0, 3, 0, 0, speed)}}});
  EXPECT_EQ(said(fast, {0, 1, 9}), "nothing was thrown");
  EXPECT_EQ(said(fast, {0, 1, 11}), "vertex 3 of body 0 is at z = " + number_text(double(speed) * 11) +
                                        " at t = 11 s, outside the admissible range (" +
                                        (sizeof(S) == 4 ? "8e+30 in float)" : "8e+100 in double)"));
  // One vertex with velocity (0, 0, 1e29), and frames 1e30 s apart.
  EXPECT_NE(said(steps<S>({{0, {flies<S>(1, 0, 0, 0, S(1e29))}}}), {0, 1e30, 1e80}).find("at t = 1e+80 s"),
            std::string::npos);
  EXPECT_NE(said(steps<S>({{0, {flies<S>(0, 1, most, 0, 0)}}}), {0, 1e300}).find("8e270"), std::string::npos);
  EXPECT_NE(said(steps<S>({{0, {flies<S>(0, 1, -most, 0, 0)}}}), {0, 1e250}).find("x = -"),
            std::string::npos);
  // Replacing the plan in time, and steps after the last frame, do no harm.
  EXPECT_EQ(
      said(steps<S>({{0, {flies<S>(0, 3, 0, 0, most / 10)}}, {5, {flies<S>(0, 3, 0, 0, 0)}}}), {0, 5, 100}),
      "nothing was thrown");
  EXPECT_EQ(said(steps<S>({{0, {}}, {50, {flies<S>(0, 3, 0, 0, most)}}}), {0, 5}), "nothing was thrown");
  EXPECT_NE(
      said(steps<S>({{0, {flies<S>(0, 3, 0, 0, most / 10)}}, {50, {flies<S>(0, 3, 0, 0, 0)}}}), {0, 50, 100})
          .find("coordinate of vertex 3, axis z, at knot 0 is "),
      std::string::npos);
  // Vertices that are added.
  PlanScript<S> grows = steps<S>({{0, {}}});
  typename GeometryChange<S>::NewVertex vertex;
  vertex.body = 1;
  vertex.plan = flies<S>(0, 0, 0, most, 0);
  grows.steps[0].geometry.vertices.push_back(vertex);
  EXPECT_EQ(said(grows, {0, 8}), "nothing was thrown");
  EXPECT_NE(said(grows, {0, 9}).find("vertex 18 of body 1 is at y = "), std::string::npos);
}

TEST(Admissible, WhatLeavesTheRangeIsRefused) {
  refuses<float>();
  refuses<double>();
}

TEST(Admissible, TimesAreLimited) {
  EXPECT_NE(complaint([] {
              FlightPlans<float>(1, {0, 1e271}, {0, 0, 0, 0, 0, 0});
            }).find("keyframe 1"),
            std::string::npos);
  EXPECT_NO_THROW(FlightPlans<float>(1, {-admissible_time, admissible_time}, {0, 0, 0, 0, 0, 0}));
  FlightPlans<float> plans(1, {0}, {0, 0, 0});
  const float origin[3] = {0, 0, 0};
  PlanChange<float> change;
  EXPECT_NE(complaint([&] { plans.change(1e271, change, origin); }).find("1e+271 s: times are limited"),
            std::string::npos);
  change.times = {1e271};
  change.positions = {0, 0, 0};
  EXPECT_NE(complaint([&] { plans.change(0, change, origin); }).find("knot 0 of the plan of vertex 0"),
            std::string::npos);
  const Scene<float> scene = small_scene<float>();
  Playback<float> playback(scene);
  EXPECT_THROW(playback.seek(1e271), std::invalid_argument);
  EXPECT_EQ(playback.time(), 0);
}

TEST(Admissible, CornersAreLimited) {
  Scene<float> scene;
  Body<float> body;
  body.name = "large";
  std::vector<std::uint32_t> corners(most_corners + 1, 0);
  body.primitives.add(std::span(corners).first(most_corners));
  body.plans = FlightPlans<float>(1, {0}, {0, 0, 0});
  scene.bodies.push_back(body);
  EXPECT_NO_THROW(validate(scene));
  scene.bodies[0].primitives.add(corners);
  EXPECT_EQ(complaint([&] { validate(scene); }),
            "body 'large': primitive 1 has 4096 corners; at most 4095 are possible");
}

// All strategies may play the scenes with which they are tested.
TEST(Admissible, TheScenesOfTheConformanceTestsAre) {
  for (const std::string& name : test::synthetic_scene_names())
    for (const std::uint32_t l : {1u, 3u, 7u}) {
      const auto check = [&](const auto& test) {
        const auto frames = test.frames.empty() ? frame_times(test.scene, l) : test.frames;
        EXPECT_EQ(complaint([&] { check_played(test.scene, test.script, std::span<const double>(frames)); }),
                  "nothing was thrown")
            << name;
      };
      check(test::synthetic_scene<float>(name, l));
      check(test::synthetic_scene<double>(name, l));
    }
}

// --- everybody ----------------------------------------------------------------------------------------

class EveryStrategy : public testing::TestWithParam<std::string> {};

/// An eighth of the range of positions for a contestant, which may have a narrower range of its own.
template <class S>
S magnitude_for(const StrategyEntry& entry) {
  return S(std::min(double(admissible_magnitude<S>), entry.info.max_coordinate / 8));
}

/// Violations of a contestant's own range are known before the play, and a session that plays nevertheless
/// stops at the first one.
template <class S>
std::string violation(const StrategyEntry& entry, const Scene<S>& scene, const std::vector<double>& frames,
                      const PlanScript<S>& script) {
  check_played<S>(scene, script, frames);
  Session<S> session(scene, {&entry, {}, entry.info.topology.preferred});
  Oracle<S> oracle(scene, {}, hash(script));
  const auto played = [&] {
    return verify(session, std::span<const double>(frames), oracle, &script).first_violation;
  };
  if (out_of_range(entry.info, scene, script, std::span<const double>(frames)).empty()) return played();
  const std::string said = complaint([&] { played(); });
  return said.starts_with("'" + entry.info.id + "' takes coordinates up to ") ? "" : said;
}

template <class S>
void plays(const StrategyEntry& entry) {
  if (entry.factory<S>() == nullptr) return;
  const Scene<S> scene = small_scene<S>();
  const S most = magnitude_for<S>(entry);
  std::vector<double> seconds, ages;
  for (int f = 0; f <= 9; ++f) {
    seconds.push_back(f);
    ages.push_back(1e25 * f);
  }
  EXPECT_EQ(violation<S>(entry, scene, seconds, steps<S>({{0, {flies<S>(0, 3, 0, 0, most * S(0.8))}}})), "");
  EXPECT_EQ(
      violation<S>(
          entry, scene, seconds,
          steps<S>({{0, {flies<S>(0, 3, 0, 0, most * S(0.8)), flies<S>(1, 4, most / 10, -most / 10, 0)}},
                    {8, {flies<S>(1, 4, -most, most, most)}}})),
      "");
  EXPECT_EQ(violation<S>(entry, scene, ages,
                         steps<S>({{0, {flies<S>(0, 3, 0, 0, S(1e-25)), flies<S>(1, 4, S(1e4), 0, S(1e-30))}},
                                   {5e25, {flies<S>(0, 5, S(1e-27), 0, 0)}}})),
            "");
  // Long steps first: a strategy that foresees as many again would leave the range by far.
  EXPECT_EQ(
      violation<S>(entry, scene, {0, 1e9, 2e9, 3e9, 3e9 + 1, 3e9 + 2},
                   steps<S>({{0, {flies<S>(0, 3, 0, 0, S(1e-9))}}, {3e9, {flies<S>(1, 4, 0, most / 4, 0)}}})),
      "");
}

TEST_P(EveryStrategy, PlaysWhatIsAdmissible) {
  plays<float>(find_strategy(GetParam()));
  plays<double>(find_strategy(GetParam()));
}

/// Velocities and times of all sizes: either all strategies play the script, or none.
template <class S>
void plays_or_refuses(const StrategyEntry& entry) {
  if (entry.factory<S>() == nullptr) return;
  const Scene<S> scene = small_scene<S>();
  std::mt19937 random(5);
  const double top = std::log10(double(admissible_magnitude<S>));
  int played = 0;
  for (int round = 0; round < 25; ++round) {
    const auto below = [&](unsigned n) { return std::uint32_t(random() % n); };
    const double frame = std::pow(10.0, double(below(81)) - 40);
    std::vector<double> frames;
    for (int f = 0; f < 6; ++f) frames.push_back(frame * f);
    PlanScript<S> script;
    for (const int f : {0, 2}) {
      Changes<S> changes;
      const auto speed = [&] {
        const double size = double(below(unsigned(2 * top))) - top;
        return below(3) == 0 ? S(0) : S((below(2) == 0 ? 1 : -1) * std::pow(10.0, size));
      };
      for (int c = 0; c < 3; ++c) changes.push_back(flies<S>(below(2), below(18), speed(), speed(), speed()));
      script.steps.push_back({frames[std::size_t(f)], changes, {}});
    }
    try {
      check_played<S>(scene, script, frames);
    } catch (const std::invalid_argument&) {
      continue;
    }
    ++played;
    EXPECT_EQ(violation<S>(entry, scene, frames, script), "") << "round " << round;
  }
  EXPECT_GE(played, 3);
}

TEST_P(EveryStrategy, PlaysOrNobodyDoes) {
  plays_or_refuses<float>(find_strategy(GetParam()));
  plays_or_refuses<double>(find_strategy(GetParam()));
}

TEST_P(EveryStrategy, ASessionStopsBeforeTheEndOfTheRange) {
  const StrategyEntry& entry = find_strategy(GetParam());
  if (entry.factory<float>() == nullptr) return;
  const Scene<float> scene = small_scene<float>();
  Session<float> session(scene, {&entry, {}, entry.info.topology.preferred});
  PhaseTimes times;
  PairBuffer pairs;
  session.reset(0);
  const float most = magnitude_for<float>(entry);
  const std::vector<PlanChange<float>> changes{flies<float>(0, 3, 0, 0, .8f * most)};
  session.change_plans(changes, times);
  session.advance(9, times);
  const std::string said = complaint([&] { session.advance(11, times); });
  const char* const place = most < admissible_magnitude<float> ? "but vertex 3 of body 0 is at z = "
                                                               : "vertex 3 of body 0 is at z = 8.8";
  EXPECT_NE(said.find(place), std::string::npos) << said;
  EXPECT_EQ(session.playback().time(), 9);
  session.query(pairs, times);
  session.reset(0);
  session.advance(11, times);
  session.query(pairs, times);
}

std::vector<std::string> ids() {
  std::vector<std::string> list;
  for (const StrategyEntry& entry : registry())
    if (entry.info.can.plan_changes) list.push_back(entry.info.id);
  return list;
}

INSTANTIATE_TEST_SUITE_P(Registry, EveryStrategy, testing::ValuesIn(ids()),
                         [](const auto& test) { return test.param; });

}  // namespace
}  // namespace kbvh::admissible_test
