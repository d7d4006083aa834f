// Scenes of many small bodies, over the registry: answers, and the cost in memory and box tests when there
// are more bodies, each with the same number of neighbours.

#include <gtest/gtest.h>

#include <algorithm>

#include "core/families/wide/near_bodies.hpp"
#include "core/geometry/lane_box.hpp"
#include "tests/conformance/check.hpp"
#include "tests/support/many_bodies.hpp"

namespace kbvh::test::many_bodies_test {
namespace {

/// The true pairs by one sweep over all triangles of a scene.
template <class S>
PairBuffer true_pairs(const Scene<S>& scene, double t) {
  Playback<S> playback(scene);
  playback.seek(t);
  return sweep_pairs(scene, playback);
}

// The broad phase alone: against every pair of boxes, with pairs in any order, repeated, and within one body,
// and with bodies without a box; bodies move far from one search to the next.
TEST(NearBodies, AreThoseWhoseBoxesOverlap) {
  Random random(3);
  for (const bool shuffled : {false, true})
    for (const std::uint32_t count : {2U, 40U, 150U}) {
      std::vector<BodyPair> pairs;
      for (std::uint32_t a = 0; a < count; ++a)
        for (std::uint32_t b = a + 1; b < count; ++b)
          if (!shuffled || random.below(5) != 0) pairs.push_back({a, b});
      for (std::uint32_t a = 0; a < count; a += 3) pairs.push_back({a, a});
      if (shuffled) {
        pairs.push_back({0, 1});
        for (std::size_t i = pairs.size(); i-- > 1;)
          std::swap(pairs[i], pairs[random.below(std::uint32_t(i + 1))]);
      }
      NearBodies near(pairs, count);
      EXPECT_EQ(near.searches(), count > 2);
      for (int round = 0; round < 12; ++round) {
        std::vector<Box<double>> boxes(count);
        for (std::uint32_t body = 0; body < count; ++body) {
          if (random.below(9) == 0) continue;
          for (int axis = 0; axis < 3; ++axis) {
            boxes[body].lower[axis] = random.below(9);  // many touch in a face
            boxes[body].upper[axis] = boxes[body].lower[axis] + random.below(3);
          }
        }
        std::uint64_t tests = 0;
        const auto found = near.find([&](std::uint32_t body) { return boxes[body]; }, tests);
        std::vector<std::uint32_t> expected;
        for (std::uint32_t i = 0; i < pairs.size(); ++i)
          if (!near.searches() || pairs[i].first == pairs[i].second ||
              overlap(boxes[pairs[i].first], boxes[pairs[i].second]))
            expected.push_back(i);
        EXPECT_EQ(std::vector<std::uint32_t>(found.begin(), found.end()), expected)
            << count << " bodies, round " << round;
      }
    }
}

// 79,800 pairs of bodies: more than 16 bits can number.
TEST(ManyBodies, SeparationListNumbersMoreThan65535BodyPairs) {
  Scene<float> scene = many_bodies<float>(400, 1);
  for (const char* id : {"kinetic_separation_list"}) {
    const StrategyEntry& entry = find_strategy(id);
    Session<float> session(scene, {&entry, {}, entry.info.topology.preferred});
    PhaseTimes ignored;
    PairBuffer pairs;
    session.reset(0);
    for (const double t : {0.5, 1.25, 2.0}) {
      session.advance(t, ignored);
      session.query(pairs, ignored);
      std::sort(pairs.begin(), pairs.end());
      const PairBuffer truth = true_pairs(scene, t);
      EXPECT_FALSE(truth.empty());
      EXPECT_EQ(pairs, truth) << id << " at t = " << t;
    }
  }
}

// Events that belong to a body beyond 65,535.
TEST(ManyBodies, EventsNumberMoreThan65535Bodies) {
  Scene<float> scene;
  for (std::uint32_t b = 0; b < 65'540; ++b) {
    Body<float> body;
    body.primitives.add(std::vector<std::uint32_t>{0, 1, 2});
    const bool moves = b >= 65'538;
    const float way = b == 65'538 ? 2 : -2, x = b == 65'538 ? -1 : 1;
    std::vector<float> positions{x, 0, 0, x + 0.5F, 1, 0, x, 0, 1};
    // The corners overtake each other on the way.
    if (moves) positions.insert(positions.end(), {x + way, 1, 0, x + way, 0, 0, x + way + 0.5F, 0, -1});
    body.plans = FlightPlans<float>(3, moves ? std::vector<double>{0, 1} : std::vector<double>{0}, positions);
    scene.bodies.push_back(std::move(body));
  }
  scene.pairs = {{65'538, 65'539}};
  std::size_t found = 0;
  for (const StrategyEntry& entry : registry()) {
    if (!entry.info.can.event_driven || entry.info.foresight != Foresight::whole_clip ||
        entry.info.guarantee != Guarantee::exact || entry.factory<float>() == nullptr)
      continue;
    Session<float> session(scene, {&entry, {}, entry.info.topology.preferred});
    PhaseTimes ignored;
    PairBuffer pairs;
    session.reset(0);
    for (const double t : {0.25, 0.5, 0.75}) {
      session.advance(t, ignored);
      session.query(pairs, ignored);
      EXPECT_EQ(pairs, true_pairs(scene, t)) << entry.info.id << " at t = " << t;
      found += pairs.size();
      session.playback().evaluate_all();
      for (const std::uint32_t body : {65'538U, 65'539U})
        EXPECT_EQ(
            session.strategy().audit_view(body)->boxes[0],
            to_double(primitive_box(scene.bodies[body].primitives[0], session.playback().positions(body))))
            << entry.info.id << " at t = " << t << ", body " << body;
    }
  }
  EXPECT_GT(found, 0u);
}

/// Answers, bounds and spans at every frame, by the driver's own verification; with pairs within some bodies,
/// and with changes of plans for strategies that accept them.
template <class S>
void expect_conforming(const StrategyEntry& entry) {
  TestScene<S> test;
  test.scene = many_bodies<S>(60, 6);
  ASSERT_GT(test.scene.pairs.size(), 1000U);
  EXPECT_EQ(check(entry, test, 4, {}, entry.info.topology.preferred), "") << entry.info.id;
  // Pairs in a different order, and within bodies.
  std::reverse(test.scene.pairs.begin(), test.scene.pairs.end());
  if (entry.info.can.self_pairs)
    for (std::uint32_t body = 0; body < 60; body += 7) test.scene.pairs.push_back({body, body});
  if (entry.info.can.plan_changes) {
    test.frames = frame_times(test.scene, 4);
    Random random(5);
    for (const std::size_t frame : {0U, 2U, 3U, 6U}) {
      typename PlanScript<S>::Step step{test.frames[frame], {}, {}};
      for (std::uint32_t i = 0; i < 25; ++i) {
        PlanChange<S> change{.body = (11 * i + std::uint32_t(frame)) % 60, .vertex = random.below(8)};
        for (S& v : change.velocity) v = S(2 * random.unit());
        step.changes.push_back(change);
      }
      test.script.steps.push_back(step);
    }
  }
  EXPECT_EQ(check(entry, test, 4, {}, entry.info.topology.preferred), "") << entry.info.id << ", changed";
}

class ManyBodiesOf : public testing::TestWithParam<std::string> {};

TEST_P(ManyBodiesOf, Conform) {
  const StrategyEntry& entry = find_strategy(GetParam());
  if (entry.factory<float>() != nullptr) expect_conforming<float>(entry);
  if (entry.factory<double>() != nullptr) expect_conforming<double>(entry);
}

// Twice the bodies at the same density, four times the pairs: memory and box tests grow with the bodies. A
// pair may take some bytes.
TEST_P(ManyBodiesOf, CostWhatBodiesCostAndNotTheirPairs) {
  const StrategyEntry& entry = find_strategy(GetParam());
  if (entry.factory<float>() == nullptr || entry.info.max_primitive_pairs != 0) return;
  struct Cost {
    std::size_t bytes = 0, tests = 0, pairs = 0, found = 0;
  };
  const auto cost_of = [&](std::uint32_t bodies) {
    Cost cost;
    const Scene<float> scene = many_bodies<float>(bodies, 8);
    Session<float> session(scene, {&entry, {}, entry.info.topology.preferred});
    PhaseTimes ignored;
    PairBuffer pairs;
    session.reset(0);
    for (const double t : {0.125, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5}) {
      session.advance(t, ignored);
      session.query(pairs, ignored);
      cost.found += pairs.size();
    }
    cost.bytes = session.strategy().bytes();
    cost.tests = session.strategy().counters()[Counter::box_tests];
    cost.pairs = scene.pairs.size();
    return cost;
  };
  const Cost few = cost_of(300), many = cost_of(600);
  if (entry.info.guarantee != Guarantee::approximate) {
    EXPECT_GT(few.found, 100U) << GetParam();
  }
  EXPECT_LT(many.bytes, 2.6 * double(few.bytes) + 10.0 * double(many.pairs))
      << GetParam() << ", " << few.bytes;
  EXPECT_LT(many.tests, 2.6 * double(few.tests) + 1000) << GetParam() << ", " << few.tests;
  // At most the size of two or three trees, and of the pairs of boxes in a list.
  EXPECT_LT(many.bytes, 40'000.0 * 600 + 10.0 * double(many.pairs)) << GetParam();
}

std::vector<std::string> all_ids() {
  std::vector<std::string> ids;
  for (const StrategyEntry& entry : registry()) ids.push_back(entry.info.id);
  return ids;
}

INSTANTIATE_TEST_SUITE_P(Registry, ManyBodiesOf, testing::ValuesIn(all_ids()),
                         [](const auto& test) { return test.param; });

}  // namespace
}  // namespace kbvh::test::many_bodies_test
