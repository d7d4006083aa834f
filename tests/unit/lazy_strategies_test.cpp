// A property of lazy strategies that the conformance suite cannot check: they really leave work out. And the
// bound on motion that they rely on.

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "core/families/wide/kernels/bounds.hpp"
#include "core/judge/session.hpp"
#include "core/judge/verify.hpp"
#include "core/kernels/kernel_set.hpp"
#include "tests/support/moving_grids.hpp"

namespace kbvh::test::lazy_strategies_test {
namespace {

TEST(InflatedLazy, SkipsFramesUntilTheMarginMayBeUsedUp) {
  const Scene<double> scene = grids<double>(20, 5, lifted);
  Play<double> play(scene, "inflated_lazy", {{"margin_is", "absolute"}, {"margin", "0.105"}});
  int looks = 0, since = 0;
  for (int f = 1; f <= 100; ++f) {
    const Counters frame = play.frame(0.01 * f);
    ++since;
    if (frame[Counter::vertex_reads] == 0) {
      EXPECT_EQ(frame[Counter::nodes_visited], 0u);
      EXPECT_EQ(frame[Counter::values_written], 0u);
      EXPECT_EQ(frame[Counter::positions_fetched], 0u) << "nobody needed a position";
      continue;
    }
    EXPECT_EQ(since, 11) << "10 steps of 0.01 fit into the margin";
    EXPECT_EQ(frame[Counter::positions_fetched], scene.bodies[0].plans.vertex_count());
    since = 0;
    ++looks;
  }
  EXPECT_EQ(looks, 9);
}

TEST(InflatedLazy, ScanReadsEveryVertexInEveryFrameButWritesOnlyWhatWasLeft) {
  const Scene<double> scene = grids<double>(20, 5, lifted);
  Play<double> play(scene, "inflated_lazy",
                    {{"margin_is", "absolute"}, {"margin", "0.105"}, {"bound", "scan"}});
  int written = 0;
  for (int f = 1; f <= 100; ++f) {
    const Counters frame = play.frame(0.01 * f);
    EXPECT_GE(frame[Counter::vertex_reads], scene.bodies[0].plans.vertex_count());
    written += frame[Counter::values_written] != 0 ? 1 : 0;
  }
  EXPECT_EQ(written, 9);
}

TEST(InflatedLazy, WritesOnlyWhatMoved) {
  // The left quarter moves, the rest does not.
  const auto quarter = [](std::uint32_t i) { return i <= 10 ? 1.0 : 0.0; };
  const Scene<float> scene = grids<float>(40, 5, quarter);
  for (const std::string bound : {"step", "scan"}) {
    Play<float> play(scene, "inflated_lazy",
                     {{"margin_is", "absolute"}, {"margin", "0.05"}, {"bound", bound}});
    const std::uint64_t nodes = play.session.strategy().audit_view(0)->topology.size();
    std::uint64_t most = 0;
    for (int f = 1; f <= 100; ++f) most = std::max(most, play.frame(0.01 * f)[Counter::values_written]);
    EXPECT_GT(most, 0u) << bound;
    EXPECT_LT(most, 6 * nodes / 2) << bound << ": of " << 6 * nodes;
  }
}

TEST(InflatedLazy, ABodyAtRestNeverExpires) {
  const Scene<float> scene = grids<float>(10, 0.5, [](std::uint32_t) { return 0.0; });
  Play<float> play(scene, "inflated_lazy", {{"margin_is", "absolute"}, {"margin", "0"}});
  for (int f = 1; f <= 20; ++f) EXPECT_EQ(play.frame(0.1 * f)[Counter::nodes_visited], 0u);
}

TEST(InflatedLazy, NewSpeedsCountFromTheChangeOn) {
  Scene<double> scene = grids<double>(10, 5, [](std::uint32_t) { return 0.01; });
  Play<double> play(scene, "inflated_lazy", {{"margin_is", "absolute"}, {"margin", "0.1"}});
  EXPECT_EQ(play.frame(0.5)[Counter::vertex_reads], 0u);
  PlanChange<double> change{.body = 0, .vertex = 7};
  change.velocity[1] = 1;
  play.session.change_plans({&change, 1}, play.times);
  EXPECT_EQ(play.frame(0.55)[Counter::vertex_reads], 0u);
  EXPECT_GT(play.frame(0.7)[Counter::vertex_reads], 0u);
}

TEST(InflatedLazy, ABodyAtRestGetsAMarginWhenItFirstMoves) {
  Scene<double> scene = grids<double>(10, 5, [](std::uint32_t) { return 0.01; });
  Play<double> play(scene, "inflated_lazy", {{"margin_is", "absolute"}, {"margin", "0.1"}});
  PlanChange<double> change{.body = 1, .vertex = 7};
  change.velocity[1] = 1;
  play.session.change_plans({&change, 1}, play.times);
  EXPECT_GT(play.frame(0.05)[Counter::vertex_reads], 0u);
  EXPECT_EQ(play.frame(0.10)[Counter::vertex_reads], 0u);
  EXPECT_GT(play.frame(0.20)[Counter::vertex_reads], 0u);
}

TEST(InflatedLazy, AFrameMayJumpOverSegments) {
  // At rest, in motion, at rest again: the speeds at the frames do not reveal this.
  Scene<float> scene = grids<float>(10, 5, lifted);
  std::vector<float> positions;
  for (const double z : {0.0, 0.0, 1.0, 1.0})
    for (std::uint32_t v = 0; v < 121; ++v)
      for (const double c : {(v % 11) / 10.0, (v / 11) / 10.0, z}) positions.push_back(float(c));
  scene.bodies[0].plans = FlightPlans<float>(121, {0, 1, 2, 3}, std::move(positions));
  Play<float> play(scene, "inflated_lazy", {{"margin_is", "absolute"}, {"margin", "0.5"}});
  EXPECT_EQ(play.frame(0.5)[Counter::vertex_reads], 0u);
  EXPECT_GT(play.frame(2.5)[Counter::vertex_reads], 0u);
}

TEST(InflatedLazy, TheTunedMarginSkipsMoreWhereNothingMeets) {
  const Scene<float> scene = grids<float>(40, 5, lifted);
  Play<float> play(scene, "inflated_lazy", {});
  int looks = 0;
  for (int f = 1; f <= 200; ++f) looks += play.frame(0.01 * f)[Counter::vertex_reads] != 0 ? 1 : 0;
  EXPECT_LT(looks, 10);
}

TEST(Hybrid, DisjointBodiesCostOnePassOverTheirVertices) {
  const Scene<float> scene = grids<float>(60, 5, lifted);
  const std::uint64_t vertices = scene.bodies[0].plans.vertex_count();
  for (const std::string below : {"subtree", "top_down"}) {
    Play<float> root(scene, "hybrid", {{"levels", "0"}, {"below", below}});
    const Counters frame = root.frame(0.3);
    EXPECT_EQ(frame[Counter::vertex_reads], vertices);
    EXPECT_EQ(frame[Counter::nodes_visited], 1u);
    EXPECT_EQ(frame[Counter::values_written], 6u);

    Play<float> half(scene, "hybrid", {{"below", below}});
    const Counters upper = half.frame(0.3);
    const auto view = *half.session.strategy().audit_view(0);
    std::uint64_t stale = 0;
    for (const std::uint8_t node : view.stale) stale += node;
    // Only the upper part was written; vertices on the borders of subtrees are read twice.
    EXPECT_EQ(upper[Counter::values_written], 6 * (view.topology.size() - stale));
    EXPECT_GT(10 * stale, 8 * view.topology.size());
    EXPECT_GE(upper[Counter::vertex_reads], vertices);
    EXPECT_LT(upper[Counter::vertex_reads], vertices + vertices / 3);
  }
}

TEST(Hybrid, MakesOnlyTheSubtreesThatAQueryEnters) {
  // The obstacle reaches a small part of the grid, in its plane.
  const Scene<float> scene = grids<float>(60, 0.97, left_side);
  for (const std::string below : {"subtree", "top_down"}) {
    Play<float> play(scene, "hybrid", {{"below", below}});
    const Counters frame = play.frame(0.001);
    EXPECT_FALSE(play.pairs.empty());
    const auto view = *play.session.strategy().audit_view(0);
    std::uint64_t stale = 0;
    for (const std::uint8_t node : view.stale) stale += node;
    EXPECT_GT(stale, view.topology.size() / 2) << below;
    EXPECT_GE(frame[Counter::values_written], 6 * (view.topology.size() - stale));
    EXPECT_LT(frame[Counter::values_written], 3 * view.topology.size());
  }
}

TEST(Hybrid, ABudgetLeavesWorkUndone) {
  const Scene<float> scene = grids<float>(30, 0, left_side);
  const StrategyEntry& entry = find_strategy("hybrid");
  Session<float> session(scene, {&entry, {}, entry.info.topology.preferred});
  session.reset(0);
  PhaseTimes times;
  PairBuffer pairs;
  session.advance(0.1, times);
  EXPECT_FALSE(session.query(pairs, times, {.box_tests = 50}).complete());
  EXPECT_TRUE(session.query(pairs, times).complete());
}

// ---- The bound on motion

template <class S>
double distance(const FlightPlans<S>& plans, double t0, double t1) {
  std::vector<S> a(3 * plans.vertex_count()), b(a.size());
  plans.evaluate(t0, a.data());
  plans.evaluate(t1, b.data());
  double most = 0;
  for (std::size_t v = 0; v < a.size(); v += 3)
    most = std::max(most, std::hypot(double(b[v]) - double(a[v]), double(b[v + 1]) - double(a[v + 1]),
                                     double(b[v + 2]) - double(a[v + 2])));
  return most;
}

template <class S>
void check_displacements(double scale) {
  std::mt19937 random(5);
  const auto unit = [&] { return double(random() % 4096) / 2048 - 1; };
  std::vector<double> times{0};
  while (times.size() < 6) times.push_back(times.back() + 0.01 + 0.3 * std::abs(unit()));
  std::vector<S> positions;
  for (int i = 0; i < 6 * 20 * 3; ++i) positions.push_back(S(scale * unit()));
  FlightPlans<S> plans(20, times, positions);
  for (int round = 0; round < 2; ++round) {
    for (int i = 0; i < 300; ++i) {
      const double from = round == 0 ? -0.2 : 0.4;  // own plans start at 0.4
      double t0 = from + std::abs(unit()) * (times.back() + 0.4), t1 = t0 + std::abs(unit()) * 0.7;
      const double rounding = 4 * scale * double(std::numeric_limits<S>::epsilon()),
                   bound = plans.displacement_bound(t0, t1);
      EXPECT_LE(distance(plans, t0, t1), bound + rounding) << t0 << " to " << t1;
      // Bounds of parts add up to no less.
      const double middle = 0.5 * (t0 + t1);
      EXPECT_LE(bound * (1 - 1e-9),
                plans.displacement_bound(t0, middle) + plans.displacement_bound(middle, t1));
      EXPECT_LE(distance(plans, t0, t0 + 1e-4),
                plans.speed_bound(t0) * 1e-4 + plans.speed_bound(t0 + 1e-4) * 1e-4 + rounding);
    }
    for (std::uint32_t v = 0; v < 20; v += 3) {
      std::vector<S> now(60);
      plans.evaluate(0.4, now.data());
      PlanChange<S> change{.body = 0, .vertex = v};
      change.times = {0.5 + 0.01 * v, 0.9};
      for (int i = 0; i < 6; ++i) change.positions.push_back(S(scale * unit()));
      change.velocity[2] = S(scale * unit());
      plans.change(0.4, change, now.data() + 3 * v);
    }
  }
}

TEST(DisplacementBound, CoversEveryVertexAcrossSegmentsAndOwnPlans) {
  check_displacements<float>(1);
  check_displacements<double>(1);
  check_displacements<float>(1e29);
  check_displacements<double>(1e99);
  check_displacements<float>(1e-30);
  check_displacements<double>(1e-200);  // squares vanish
}

TEST(DisplacementBound, IsTheWayOfTheFastestVertexAndZeroAtRest) {
  const FlightPlans<double> plans(1, {0, 1, 2, 3}, {0, 0, 0, 3, 4, 0, 3, 4, 0, 3, 4, 2});
  EXPECT_NEAR(plans.displacement_bound(0, 1), 5, 1e-9);
  EXPECT_NEAR(plans.displacement_bound(0.5, 2.5), 3.5, 1e-9);
  EXPECT_EQ(plans.displacement_bound(1, 2), 0);
  EXPECT_EQ(plans.displacement_bound(1.25, 1.75), 0);
  EXPECT_EQ(plans.displacement_bound(3, 100), 0);
  EXPECT_EQ(plans.displacement_bound(-2, 0), 0);
  EXPECT_EQ(plans.displacement_bound(0.5, 0.5), 0);
}

// ---- Boxes from runs of vertices

template <class S>
void check_runs() {
  std::mt19937 random(3);
  std::vector<S> positions(3 * 200 + 1);
  for (S& c : positions) c = S(int(random() % 2001) - 1000) + S(0);
  for (const KernelSet set : supported_kernel_sets())
    for (int round = 0; round < 500; ++round) {
      std::vector<VertexRun> runs;
      Box<S> expected;
      for (std::uint32_t r = 0; r < 1 + random() % 4; ++r) {
        const std::uint32_t first = random() % 150, count = 1 + random() % (random() % 2 == 0 ? 4 : 50);
        runs.push_back({first, count});
        for (std::uint32_t v = first; v < first + count; ++v) expected.extend(positions.data() + 3 * v);
      }
      S box[8];
      bounds_kernels<S>(set).of_runs(runs.data(), runs.size(), positions.data(), box);
      for (int axis = 0; axis < 3; ++axis) {
        EXPECT_EQ(box[axis], expected.lower[axis]) << name(set);
        EXPECT_EQ(box[axis + 4], expected.upper[axis]) << name(set);
      }
    }
}

TEST(BoundsKernels, EqualTheBoxPointByPoint) {
  check_runs<float>();
  check_runs<double>();
}

}  // namespace
}  // namespace kbvh::test::lazy_strategies_test
