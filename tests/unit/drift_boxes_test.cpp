// Properties of drifting boxes that the conformance suite cannot check: the work that they leave out, and
// that lists of near pairs contain every pair for as long as promised.

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <random>

#include "core/families/drift/drift_probes.hpp"
#include "core/families/drift/near_pairs.hpp"
#include "core/judge/probe_oracle.hpp"
#include "core/judge/verify.hpp"
#include "core/kernels/kernel_set.hpp"
#include "tests/support/moving_grids.hpp"
#include "tests/support/ray_sets.hpp"
#include "tests/support/rolled_sheet.hpp"
#include "tests/support/synthetic_scenes.hpp"

namespace kbvh::test::drift_boxes_test {
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
  EXPECT_EQ(play.frame(0.01)[Counter::bodies_skipped], 1u)
      << "nothing is known yet, so all vertices are read";
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
        // Two bodies with equally many nodes; one rests, and the other one is refitted or also skipped.
        const std::uint64_t visited = frame[Counter::nodes_visited], skipped = frame[Counter::nodes_skipped];
        EXPECT_GT(skipped, 0u) << id;
        EXPECT_EQ(visited, visited == 0 ? 0 : skipped) << id << ", " << lists << ", frame " << f;
        refits += frame[Counter::nodes_visited] > 0 ? 1 : 0;
      }
      EXPECT_GT(refits, 0);
    }
}

TEST(DriftBoxes, ABodyThatRestsAgainAfterAResetIsWhereItWas) {
  // Slow enough that lists of near pairs are kept; a script first shifts the body at rest, and then no longer
  // does.
  const Scene<float> scene = grids<float>(20, 0.5, left_side);
  std::vector<double> frames;
  for (int f = 0; f <= 60; ++f) frames.push_back(0.01 * f);
  PlanScript<float> script;
  script.steps.push_back({.time = frames[2]});
  for (std::uint32_t v = 0; v < scene.bodies[1].plans.vertex_count(); ++v)
    script.steps[0].changes.push_back({.body = 1, .vertex = v, .velocity = {0.3f, 0, 0}});
  for (const char* id : {"drift_boxes", "drift_boxes_bounded", "auto"}) {
    Session<float> session(scene, {&find_strategy(id), {}, find_strategy(id).info.topology.preferred});
    Oracle<float> with(scene, {}, hash(script)), without(scene);
    EXPECT_EQ(verify(session, std::span<const double>(frames), with, &script).first_violation, "") << id;
    const Verification again = verify(session, std::span<const double>(frames), without);
    EXPECT_EQ(again.first_violation, "") << id << ": moved, though it has been reset";
    EXPECT_GT(again.pairs, 0u) << id;
  }
}

/// Queries pairs and rays at every frame, and compares the hits with brute force. Returns the number of
/// frames that made no boxes.
int check_rays(const Scene<float>& scene, const char* id) {
  Session<float> session(scene, {&find_strategy(id), {}, find_strategy(id).info.topology.preferred});
  session.reset(0);
  session.playback().evaluate_all();
  const std::vector<Ray<float>> rays = rays_at(session.scene(), session.playback(), 4, 1);
  std::vector<RayHit> hits(rays.size());
  std::uint64_t visited = 0, found = 0;
  int kept = 0;
  PairBuffer pairs;
  PhaseTimes ignored;
  for (int f = 1; f <= 40; ++f) {
    const double t = 0.01 * f;
    session.advance(t, ignored);
    const std::uint64_t before =
        std::exchange(visited, session.strategy().counters()[Counter::nodes_visited]);
    kept += visited == before ? 1 : 0;
    if (f % 4 != 0) session.strategy().pairs_at(t, pairs);
    session.probe(RayProbes<float>{RayQuery::closest, rays, std::span<RayHit>(hits)}, ignored);
    session.playback().evaluate_all();
    const ProbeCheck check = check_hits<float>(session.scene(), session.playback(), RayQuery::closest,
                                               std::span<const Ray<float>>(rays), hits);
    EXPECT_TRUE(check.holds()) << id << ", frame " << f << ": " << check.first_violation;
    found += check.hits;
  }
  EXPECT_GT(found, 100U);
  return kept;
}

/// Rays at later frames, in boxes without a margin that were made at the first frame.
template <class S>
void check_old_boxes(const char* name, std::uint64_t& found) {
  const auto test = synthetic_scene<S>(name);
  const auto frames = test.frames.empty() ? frame_times(test.scene, 3) : test.frames;
  Playback<S> playback(test.scene);
  playback.seek(frames[0]);
  playback.evaluate_all();
  const SceneView<S> view(test.scene);
  std::vector<WideHierarchy<S>> trees(test.scene.bodies.size());
  std::vector<DriftBody<S>> bodies(trees.size());
  for (std::uint32_t body = 0; body < trees.size(); ++body) {
    const S* const positions = playback.positions(body);
    trees[body].assign(build_topology<S>(primitive_boxes(view.primitives(body), positions),
                                         {.method = BuildMethod::median, .width = 4, .leaf_size = 2}),
                       view.primitives(body), active_kernel_set());
    trees[body].refit(positions);
    bodies[body].before.assign(positions, positions + std::size_t(3) * view.vertex_count(body));
    bodies[body].box = bodies[body].box_then = to_double(trees[body].box(0));
    bodies[body].watch = DriftBody<S>::Watch::drift;
    bodies[body].stand();
  }
  DriftProbes<S> drift(view, SampledMotion<S>(playback));
  const std::size_t stride = 1 + frames.size() / 6;
  for (std::size_t f = 1; f < frames.size(); f += stride) {
    playback.seek(frames[f]);
    playback.evaluate_all();
    drift.moved();
    for (std::uint32_t body = 0; body < trees.size(); ++body) {
      S interval[8];
      near_kernels<S>(active_kernel_set())
          .drift(playback.positions(body), bodies[body].before.data(), view.vertex_count(body), interval);
      bodies[body].drifted_by(interval, 1);
      bodies[body].near = f + stride < frames.size();  // at the last frame only the body's box is known
    }
    const std::vector<Ray<S>> rays = rays_at(test.scene, playback, 12, std::uint32_t(f));
    std::vector<RayHit> hits(rays.size());
    TriangleTestStats stats;
    std::uint64_t tests = 0;
    drift.answer(trees, bodies, true, RayProbes<S>{RayQuery::closest, rays, hits}, stats, tests, nullptr);
    const ProbeCheck check =
        check_hits<S>(test.scene, playback, RayQuery::closest, std::span<const Ray<S>>(rays), hits);
    EXPECT_TRUE(check.holds()) << name << ", frame " << f << ": " << check.first_violation;
    found += check.hits;
  }
}

TEST(DriftProbes, ReadOldBoxesAsFarAsVerticesMoved) {
  std::uint64_t found = 0;
  for (const char* name : {"soups", "sheets"}) {
    check_old_boxes<float>(name, found);
    check_old_boxes<double>(name, found);
  }
  EXPECT_GT(found, 300U);
}

TEST(DriftBoxes, OldBoxesMoveWithTheRaysThatReadThem) {
  // Close to each other, so that lists are kept; and far apart, so that there is only one box.
  for (const char* id : {"drift_boxes", "drift_boxes_bounded"}) {
    // Lists for 8 of 25 frames: after each, the cost model refits for 17.
    EXPECT_EQ(check_rays(grids<float>(20, 0.5, left_side), id), 16);
    EXPECT_GT(check_rays(grids<float>(20, 50, lifted), id), 20);
  }
}

TEST(DriftBoxes, ABodyAtRestIsNeverRead) {
  // Both at rest, and crossing: a plan that changes nothing turns the scene into one of bodies that may move.
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

/// Frames with box tests, of a hundred, and the pairs found in all of them; they equal those of `bottom_up`.
struct Searches {
  int frames = 0;
  std::size_t pairs = 0;
};
Searches searches_of(const Scene<double>& scene, const char* id) {
  Play<double> play(scene, id, {{"candidates", "listed"}});  // otherwise checks of pairs count as tests
  Play<double> refit(scene, "bottom_up", {});
  Searches searches;
  for (int f = 1; f <= 100; ++f) {
    searches.frames += play.frame(0.001 * f)[Counter::box_tests] != 0 ? 1 : 0;
    refit.frame(0.001 * f);
    std::sort(play.pairs.begin(), play.pairs.end());
    std::sort(refit.pairs.begin(), refit.pairs.end());
    EXPECT_EQ(play.pairs, refit.pairs) << id << ", frame " << f;
    searches.pairs += play.pairs.size();
  }
  return searches;
}

TEST(DriftBoxes, OneSearchLastsForManyFrames) {
  // A sheet moves down through another one; the step of a frame is small compared with a triangle.
  const Scene<double> scene = grids<double>(30, 0.3, [](std::uint32_t) { return 0.05; });
  for (const char* id : {"drift_boxes", "drift_boxes_bounded"})
    EXPECT_LT(searches_of(scene, id).frames, 25) << id;
}

TEST(DriftBoxes, WhatMovesTogetherStaysListed) {
  // The same motion for both: the bodies never close in, at any distance.
  Scene<float> scene = grids<float>(20, 0.5, lifted);
  scene.bodies[1] = grid<float>(20, 0.5, 0.01, 3, lifted);
  scene.pairs = all_pairs(scene.bodies);
  Play<float> play(scene, "drift_boxes", {{"candidates", "listed"}});
  int searches = 0;
  for (int f = 1; f <= 100; ++f) searches += play.frame(0.01 * f)[Counter::box_tests] != 0 ? 1 : 0;
  EXPECT_LT(searches, 12);
}

// ---- A body with itself

/// Returns the gap between two boxes: the largest of all sides; at most 0 if they overlap.
template <class S>
double gap_between(const Box<S>& a, const Box<S>& b) {
  double gap = -std::numeric_limits<double>::infinity();
  for (int axis = 0; axis < 3; ++axis)
    gap = std::max(
        {gap, double(b.lower[axis]) - double(a.upper[axis]), double(a.lower[axis]) - double(b.upper[axis])});
  return gap;
}

/// Lists the near pairs of a cloth with itself, and compares them with all pairs of its triangles.
template <class S>
void check_pairs_within(std::uint32_t width, std::uint32_t leaf_size, KernelSet kernels) {
  SCOPED_TRACE(std::to_string(width) + ", leaves of " + std::to_string(leaf_size) + ", " + name(kernels));
  const auto test = synthetic_scene<S>("self_rolled_cloth");
  const Primitives& primitives = test.scene.bodies[0].primitives;
  Playback<S> playback(test.scene);
  playback.seek(1.5);
  playback.evaluate_all();
  const S* const positions = playback.positions(0);
  const std::vector<Box<S>> boxes = primitive_boxes(primitives, positions);
  WideHierarchy<S> tree;
  tree.assign(
      build_topology<S>(boxes, {.method = BuildMethod::median, .width = width, .leaf_size = leaf_size}),
      primitives, kernels);
  tree.refit(positions);
  constexpr S margin = S(0.03);
  constexpr S margins[6] = {margin, margin, margin, margin, margin, margin};
  constexpr S reach[6] = {2 * margin, 2 * margin, 2 * margin, 2 * margin, 2 * margin, 2 * margin};
  near_kernels<S>(kernels).widen(width)(tree.arrays(), tree.node_count(), margins, 0);
  NearLeafRows<S> rows;
  NearWork<S> work;
  NearPairs<S> lists;
  std::uint64_t tests = 0;
  const NearSide<S> side{&tree, positions, margins, &rows, 0, &primitives};
  lists.build(side, side, 0, 0, reach, work, tests);
  std::size_t before = 0;
  for (const double fraction : {0.0, 0.3, 0.7, 1.0}) {
    PairBuffer found;
    lists.read(fraction, found);
    EXPECT_GT(found.size(), before) << "the scene proves nothing";
    before = found.size();
    std::sort(found.begin(), found.end());
    EXPECT_EQ(std::adjacent_find(found.begin(), found.end()), found.end()) << "a pair is listed twice";
    std::size_t wrong = 0, listed = 0;
    for (std::uint32_t a = 0; a < primitives.count(); ++a)
      for (std::uint32_t b = a + 1; b < primitives.count(); ++b) {
        const bool is_listed = std::binary_search(found.begin(), found.end(), PrimitivePair{0, a, 0, b});
        listed += is_listed ? 1 : 0;
        const double gap = gap_between(boxes[a], boxes[b]);
        const bool is_pair = !share_vertex(primitives[a], primitives[b]);
        const bool must = is_pair && (gap <= 0 || gap <= 0.999 * fraction * double(reach[0]));
        const bool may = is_pair && (gap <= 0 || (fraction > 0 && gap <= 1.001 * double(reach[0])));
        wrong += (must && !is_listed) || (is_listed && !may) ? 1 : 0;
      }
    EXPECT_EQ(wrong, 0u) << "at fraction " << fraction;
    EXPECT_EQ(listed, found.size()) << "all are canonical";
  }
}

TEST(NearPairs, WithinABodyAreThoseInReachWithoutNeighbours) {
  for (const KernelSet set : supported_kernel_sets())
    for (const std::uint32_t width : {2u, 4u, 8u})
      for (const std::uint32_t leaf_size : {1u, 3u, 16u}) {
        check_pairs_within<float>(width, leaf_size, set);
        check_pairs_within<double>(width, leaf_size, set);
      }
}

TEST(DriftBoxes, ABodyThatMovesAsAWholeKeepsItsList) {
  // Each frame moves all vertices by 0.005, and single ones by a hundredth of that.
  const Scene<double> scene = rolled_sheet<double>(30, 2, 5, 0.05);
  // A bound on steps does not know that all vertices move alike.
  EXPECT_GT(searches_of(scene, "drift_boxes_bounded").pairs, 10'000u);
  const Searches searches = searches_of(scene, "drift_boxes");
  EXPECT_GT(searches.pairs, 10'000u);
  EXPECT_LT(searches.frames, 25);
}

}  // namespace
}  // namespace kbvh::test::drift_boxes_test
