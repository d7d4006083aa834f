// Verdicts on what the paper proposes in its last section (C1 to C4) follow from numbers alone, and each can
// fail.
#include <gtest/gtest.h>

#include <vector>

#include "experiments/theory/judge.hpp"
#include "tests/theory/expect_flip.hpp"

namespace kbvh::theory {
namespace {

TEST(Verdict, HigherOrder) {
  const OrderRun binary{.scene = "cloth",
                        .triangles = 500,
                        .width = 2,
                        .events = 100,
                        .values = 200,
                        .certificates = 400,
                        .steps = 1000,
                        .box_tests = 5000};
  OrderRun wide = binary;
  wide.width = 8;
  wide.events = 60;
  wide.values = 90;
  const std::vector<OrderRun> good{binary, wide};
  expect_flip(good, holds, fails, judge_order, [](OrderRun& r) { r.events = 101; });
  expect_flip(good, holds, fails, judge_order, [](OrderRun& r) { r.values = 201; });
  expect_flip(good, holds, condition, judge_order, [](OrderRun& r) { r.certificates = 401; });
  expect_flip(good, holds, condition, judge_order, [](OrderRun& r) { r.box_tests = 5001; });
  EXPECT_EQ(judge_order({binary}).verdict(), Verdict::not_decided);
  // A clip without events is not compared, and not counted.
  OrderRun still = binary, wide_still = wide;
  still.scene = wide_still.scene = "still";
  still.events = wide_still.events = 0;
  const std::string why = judge_order({binary, wide, still, wide_still}).why;
  EXPECT_NE(why.find(" 1 clip has 0.6 of"), std::string::npos) << why;
}

TEST(Verdict, Rebuilding) {
  const RebuildRun never{
      .scene = "cloth", .triangles = 500, .rebuild = "never", .visited = 1000, .box_tests = 5000};
  RebuildRun median = never;
  median.rebuild = "median";
  median.box_tests = 4000;
  const std::vector<RebuildRun> good{never, median};
  expect_flip(good, holds, fails, judge_rebuild, [](RebuildRun& r) { r.box_tests = 5001; });
  expect_flip(good, holds, condition, judge_rebuild, [](RebuildRun& r) { r.visited = 2001; });
  EXPECT_EQ(judge_rebuild({never}).verdict(), Verdict::not_decided);
  expect_flip(good, holds, Verdict::not_decided, judge_rebuild, [](RebuildRun& r) { r.box_tests = 5000; });
  RebuildRun idle = never;
  idle.box_tests = 0;
  EXPECT_EQ(judge_rebuild({idle, median}).verdict(), Verdict::not_decided);
}

TEST(Verdict, ContinuousCollisionDetection) {
  const std::vector<SweepRun> good{{.scene = "cloth",
                                    .triangles = 500,
                                    .sweeps = 29,
                                    .tested_all = 4,
                                    .contacts = 100,
                                    .list_pairs = 900,
                                    .refit_pairs = 1000}};
  expect_flip(good, holds, fails, judge_sweeps, [](SweepRun& r) { r.different = 1; });
  expect_flip(good, holds, condition, judge_sweeps, [](SweepRun& r) { r.list_pairs = 1001; });
  expect_flip(good, holds, Verdict::not_decided, judge_sweeps, [](SweepRun& r) { r.contacts = 0; });
}

TEST(Verdict, OtherKindsOfMotion) {
  const std::vector<MotionRun> good{{.scene = "thrown",
                                     .triangles = 500,
                                     .segments = 29,
                                     .degree = 2,
                                     .frames = 291,
                                     .pairs = 1000,
                                     .events = 90,
                                     .events_at_keyframes = 90,
                                     .events_on_lines = 60}};
  expect_flip(good, holds, fails, judge_motion, [](MotionRun& r) { r.different = 1; });
  expect_flip(good, holds, fails, judge_motion, [](MotionRun& r) { r.events_at_keyframes = 89; });
  expect_flip(good, holds, condition, judge_motion, [](MotionRun& r) { r.events_on_lines = 44; });
  expect_flip(good, holds, Verdict::not_decided, judge_motion, [](MotionRun& r) { r.pairs = 0; });
  expect_flip(good, holds, Verdict::not_decided, judge_motion, [](MotionRun& r) { r.events = 0; });
  EXPECT_EQ(judge_motion({}).verdict(), Verdict::not_decided);
}

}  // namespace
}  // namespace kbvh::theory
