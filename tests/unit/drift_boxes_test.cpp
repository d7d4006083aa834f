// What the conformance suite cannot see of drifting boxes: what they leave out, and that lists of near pairs
// hold every pair for as long as they are said to.

#include <gtest/gtest.h>

#include <random>

#include "core/families/drift/near_pairs.hpp"
#include "core/judge/verify.hpp"
#include "core/kernels/kernel_set.hpp"
#include "tests/support/moving_grids.hpp"

namespace kbvh::test {
namespace {

// ---- How far vertices moved

template <class S>
void check_drift() {
  std::mt19937 random(7);
  for (const KernelSet set : supported_kernel_sets())
    for (const std::size_t vertices : {1u, 2u, 3u, 5u, 8u, 16u, 17u, 31u, 33u, 100u}) {
      std::vector<S> now(3 * vertices + 1), before(now.size());
      for (S& c : now) c = S(int(random() % 2001) - 1000);
      for (S& c : before) c = S(int(random() % 2001) - 1000);
      now.back() = 1e9;  // padding is no vertex
      Box<S> expected;
      for (std::size_t v = 0; v < vertices; ++v) {
        const S way[3] = {now[3 * v] - before[3 * v], now[3 * v + 1] - before[3 * v + 1],
                          now[3 * v + 2] - before[3 * v + 2]};
        expected.extend(way);
      }
      S interval[8];
      near_kernels<S>(set).drift(now.data(), before.data(), vertices, interval);
      for (int axis = 0; axis < 3; ++axis) {
        EXPECT_EQ(interval[axis], expected.lower[axis]) << name(set) << ", " << vertices;
        EXPECT_EQ(interval[axis + 4], expected.upper[axis]) << name(set) << ", " << vertices;
      }
    }
}

TEST(DriftKernel, EqualsTheIntervalPointByPoint) {
  check_drift<float>();
  check_drift<double>();
}

// ---- What is left out

TEST(DriftBoxes, BodiesFarApartGetOneBoxAFrame) {
  const Scene<float> scene = grids<float>(40, 50, lifted);
  Play<float> play(scene, "drift_boxes", {});
  EXPECT_EQ(play.frame(0.01)[Counter::bodies_skipped], 1u) << "nobody knows yet, so all vertices are read";
  const std::uint64_t vertices = scene.bodies[0].plans.vertex_count();
  for (int f = 2; f <= 100; ++f) {
    const Counters frame = play.frame(0.01 * f);
    EXPECT_EQ(frame[Counter::vertex_reads], vertices) << "each once; of the body at rest, none";
    EXPECT_EQ(frame[Counter::values_written], 0u);
    EXPECT_EQ(frame[Counter::box_tests], 0u);
    EXPECT_EQ(frame[Counter::bodies_skipped], 2u);
  }
}

TEST(DriftBoxes, WithABoundOnStepsBodiesFarApartCostNothing) {
  const Scene<float> scene = grids<float>(40, 50, lifted);
  Play<float> play(scene, "drift_boxes_bounded", {});
  play.frame(0.01);
  for (int f = 2; f <= 100; ++f) {
    const Counters frame = play.frame(0.01 * f);
    for (const Counter c :
         {Counter::vertex_reads, Counter::values_written, Counter::box_tests, Counter::positions_fetched})
      EXPECT_EQ(frame[c], 0u) << name(c);
    EXPECT_EQ(frame[Counter::bodies_skipped], 2u);
  }
}

TEST(DriftBoxes, NodesThatAreRefittedAreNotSkipped) {
  const Scene<float> scene = grids<float>(20, 0.5, left_side);
  for (const char* id : {"drift_boxes", "drift_boxes_bounded"})
    for (const char* lists : {"never", "tuned"}) {
      Play<float> play(scene, id, {{"lists", lists}});
      int refits = 0;
      for (int f = 1; f <= 40; ++f) {
        const Counters frame = play.frame(0.02 * f);
        // Two bodies with as many nodes; one rests, and the other is refitted or skipped, too.
        const std::uint64_t visited = frame[Counter::nodes_visited], skipped = frame[Counter::nodes_skipped];
        EXPECT_GT(skipped, 0u) << id;
        EXPECT_EQ(visited, visited == 0 ? 0 : skipped) << id << ", " << lists << ", frame " << f;
        refits += frame[Counter::nodes_visited] > 0 ? 1 : 0;
      }
      EXPECT_GT(refits, 0);
    }
}

TEST(DriftBoxes, ABodyThatRestsAgainAfterAResetIsWhereItWas) {
  // So slow that lists of near pairs are kept; the body at rest is shifted by a script, and then it is not.
  const Scene<float> scene = grids<float>(20, 0.5, left_side);
  std::vector<double> frames;
  for (int f = 0; f <= 60; ++f) frames.push_back(0.01 * f);
  PlanScript<float> script;
  script.steps.push_back({.time = frames[2]});
  for (std::uint32_t v = 0; v < scene.bodies[1].plans.vertex_count(); ++v)
    script.steps[0].changes.push_back({.body = 1, .vertex = v, .velocity = {0.3f, 0, 0}});
  for (const char* id : {"drift_boxes", "drift_boxes_bounded", "auto"}) {
    Session<float> session(scene, {&find_strategy(id), {}, find_strategy(id).info.topology.preferred},
                           CountingPolicy::counting);
    Oracle<float> with(scene, {}, hash(script)), without(scene);
    EXPECT_EQ(verify(session, std::span<const double>(frames), with, &script).first_violation, "") << id;
    const Verification again = verify(session, std::span<const double>(frames), without);
    EXPECT_EQ(again.first_violation, "") << id << ": moved, though it has been reset";
    EXPECT_GT(again.pairs, 0u) << id;
  }
}

TEST(DriftBoxes, ABodyAtRestIsNeverRead) {
  // Both at rest, and crossing: a plan that changes nothing makes the scene one of bodies that may move.
  const Scene<float> scene = grids<float>(20, 0.5, [](std::uint32_t) { return 0.0; });
  {
    const char* id = "drift_boxes_bounded";
    Play<float> play(scene, id, {});
    play.frame(0.01);
    for (int f = 2; f <= 30; ++f) {
      const Counters frame = play.frame(0.01 * f);
      EXPECT_EQ(frame[Counter::values_written], 0u) << id << ", frame " << f;
    }
  }
}

TEST(DriftBoxes, OneSearchLastsForManyFrames) {
  // A sheet goes down through another one; the step of a frame is small against a triangle.
  const Scene<double> scene = grids<double>(30, 0.3, [](std::uint32_t) { return 0.05; });
  for (const char* id : {"drift_boxes", "drift_boxes_bounded"}) {
    Play<double> play(scene, id, {{"candidates", "listed"}});  // else looking at pairs counts as tests
    Play<double> refit(scene, "bottom_up", {});
    int searches = 0;
    for (int f = 1; f <= 100; ++f) {
      searches += play.frame(0.001 * f)[Counter::box_tests] != 0 ? 1 : 0;
      refit.frame(0.001 * f);
      std::sort(play.pairs.begin(), play.pairs.end());
      std::sort(refit.pairs.begin(), refit.pairs.end());
      EXPECT_EQ(play.pairs, refit.pairs) << id << ", frame " << f;
    }
    EXPECT_LT(searches, 25) << id;
  }
}

TEST(DriftBoxes, WhatMovesTogetherStaysListed) {
  // The same motion for both: nothing closes in, however far they go.
  Scene<float> scene = grids<float>(20, 0.5, lifted);
  scene.bodies[1] = grid<float>(20, 0.5, 0.01, 3, lifted);
  scene.pairs = all_pairs(scene.bodies);
  Play<float> play(scene, "drift_boxes", {{"candidates", "listed"}});
  int searches = 0;
  for (int f = 1; f <= 100; ++f) searches += play.frame(0.01 * f)[Counter::box_tests] != 0 ? 1 : 0;
  EXPECT_LT(searches, 12);
}

}  // namespace
}  // namespace kbvh::test
