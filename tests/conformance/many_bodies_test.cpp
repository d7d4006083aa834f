// Scenes of many small bodies, over the registry: answers, and what memory and box tests cost when the bodies
// are more and each of them has as many neighbours as before.

#include <gtest/gtest.h>

#include "tests/conformance/check.hpp"
#include "tests/support/many_bodies.hpp"

namespace kbvh::test {
namespace {

/// The true pairs by one sweep over all triangles of a scene.
template <class S>
PairBuffer true_pairs(const Scene<S>& scene, double t) {
  Playback<S> playback(scene);
  playback.seek(t);
  return sweep_pairs(scene, playback);
}

// 79,800 pairs of bodies: more than 16 bits can number.
TEST(ManyBodies, SeparationListNumbersMoreThan65535BodyPairs) {
  Scene<float> scene = many_bodies<float>(400, 1);
  for (const char* id : {"kinetic_separation_list"}) {
    const StrategyEntry& entry = find_strategy(id);
    Session<float> session(scene, {&entry, {}, entry.info.topology.preferred}, CountingPolicy::silent);
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
    Session<float> session(scene, {&entry, {}, entry.info.topology.preferred}, CountingPolicy::silent);
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

}  // namespace
}  // namespace kbvh::test
