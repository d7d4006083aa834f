// kbvh theory: verdicts follow from numbers alone, and each can fail (C1 to C4: proposals_verdict_test.cpp).
// The constructed scenes have their stated properties.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "experiments/theory/fit.hpp"
#include "experiments/theory/judge.hpp"
#include "experiments/theory/measure_boxtree.hpp"
#include "experiments/theory/measure_counts.hpp"
#include "experiments/theory/measure_curves.hpp"
#include "experiments/theory/measure_exact.hpp"
#include "experiments/theory/measure_separation.hpp"
#include "experiments/theory/theory.hpp"
#include "experiments/theory/theory_scenes.hpp"
#include "tests/program/temporary_folder.hpp"
#include "tests/theory/expect_flip.hpp"

namespace kbvh::theory {
namespace {

CountRun count_run(std::uint64_t triangles = 1000) {
  CountRun run;
  run.scene = "cloth";
  run.triangles = triangles;
  run.vertices = triangles / 2;
  run.nodes = 2 * triangles - 1;
  run.depth = std::uint64_t(std::ceil(std::log2(double(triangles))));
  run.segments = 10;
  run.events = std::uint64_t(n_log_n(double(run.vertices)));
  run.values = 2 * run.events;
  run.breakpoint_bound = 100 * double(run.values);
  run.queue_peak = 2 * run.nodes;
  run.most_of_node = 6;
  run.bytes = 1000 * triangles;
  run.sum_visited = 2 * run.events, run.max_visited = run.depth;
  run.sum_steps = 20 * run.events, run.max_steps = 100;
  run.sum_operations = 5 * run.events, run.max_operations = 15;
  run.max_vertex_certificates = 80, run.mean_vertex_certificates = 50, run.max_leaves_of_vertex = 6;
  run.updates = 200, run.sum_update_certificates = 16000, run.max_update_certificates = 100;
  run.update_share = 0.4;
  return run;
}

ExactRun exact_run() {
  ExactRun run;
  run.scene = "cloth";
  run.triangles = 1000;
  run.bounds = 12000;
  run.events = 500;
  run.logged = run.net = run.envelope = run.canonical = 1000;
  run.pieces = 120000;
  run.audited_instants = 200, run.audited = 1000, run.path_bounds = 1500;
  return run;
}

std::vector<FrameRun> frame_runs() {
  std::vector<FrameRun> runs;
  for (const std::uint64_t l : {1, 10, 100}) {
    FrameRun run;
    run.scene = "cloth";
    run.triangles = 1000;
    run.l = l, run.frames = 9 * l;
    run.events = 500, run.values = 1000, run.same_log = 1;
    run.bottom_up_values = 12000 * run.frames;
    run.worst_share = 0.1;
    runs.push_back(run);
  }
  return runs;
}

LooseRun loose_run() {
  LooseRun run;
  run.scene = "cloth";
  run.triangles = 1000, run.bounds = 12000, run.l = 10, run.frames = 91, run.segments = 9;
  run.swept_values = 12000, run.linear_values = 120000;
  run.kinetic_events = 500, run.kinetic_values = 1000, run.bottom_up_values = 1080000;
  return run;
}

// ---- The rule --------------------------------------------------------------------------------------------

TEST(Criterion, RelationsAndTolerance) {
  EXPECT_TRUE((Criterion{"", 6, Relation::at_most, 6}.met()));
  EXPECT_FALSE((Criterion{"", 6.1, Relation::at_most, 6}.met()));
  EXPECT_TRUE((Criterion{"", 6.1, Relation::at_most, 6, 0.05}.met()));
  EXPECT_TRUE((Criterion{"", 0, Relation::equal, 0}.met()));
  EXPECT_FALSE((Criterion{"", 1, Relation::equal, 0, 0.5}.met()));
  EXPECT_TRUE((Criterion{"", 5.8, Relation::at_least, 6, 0.05}.met()));
  EXPECT_FALSE((Criterion{"", 5, Relation::at_least, 6, 0.05}.met()));
  for (const Relation relation : {Relation::at_most, Relation::equal, Relation::at_least})
    EXPECT_FALSE((Criterion{"", std::nan(""), relation, 6, 1}.met()));
}

TEST(Verdict, FollowsFromCriteria) {
  const Criterion good{"", 0, Relation::equal, 0, 0, Role::always};
  Criterion wrong{"", 1, Relation::equal, 0, 0, Role::always}, stated = wrong;
  stated.role = Role::as_stated;
  EXPECT_EQ(verdict({}), Verdict::not_decided);
  EXPECT_EQ(verdict({good}), Verdict::holds);
  EXPECT_EQ(verdict({good, stated}), Verdict::with_condition);
  EXPECT_EQ(verdict({stated, wrong}), Verdict::does_not_hold);
}

TEST(Verdict, NothingMeasuredDecidesNothing) {
  for (const Claim& claim :
       {judge_valid_at_all_times({}), judge_compact({}), judge_responsive({}), judge_local({}, {}),
        judge_efficient({}, {}), judge_number_of_events({}, {}, {}), judge_independent_of_frames({}),
        judge_optimal({}, {}), judge_never_more_updates({}, {}), judge_translation({}),
        judge_plan_changes({}), judge_lower_bound({})}) {
    EXPECT_EQ(claim.verdict(), Verdict::not_decided) << claim.id;
    EXPECT_FALSE(claim.why.empty()) << claim.id;
  }
}

// ---- Every claim both ways -------------------------------------------------------------------------------

TEST(Verdict, ValidAtAllTimes) {
  const std::vector<ExactRun> good{exact_run()};
  expect_flip(good, holds, fails, judge_valid_at_all_times, [](ExactRun& r) { r.violation = "node 3"; });
  expect_flip(good, holds, fails, judge_valid_at_all_times, [](ExactRun& r) { r.faults = 1; });
  expect_flip(good, holds, fails, judge_valid_at_all_times, [](ExactRun& r) { r.path_faults = 1; });
}

TEST(Verdict, KineticQualities) {
  const std::vector<CountRun> good{count_run(), count_run(2000)};
  expect_flip(good, holds, fails, judge_compact, [](CountRun& r) { r.most_of_node = 7; });
  expect_flip(good, holds, fails, judge_compact, [](CountRun& r) { r.queue_peak = 7 * r.nodes; });
  expect_flip(good, holds, fails, judge_compact, [](CountRun& r) { r.bytes *= 2; });
  expect_flip(good, holds, fails, judge_responsive, [](CountRun& r) { r.max_visited = r.depth + 1; });
  expect_flip(good, holds, fails, judge_responsive, [](CountRun& r) { r.max_steps = 10000; });
  expect_flip(good, holds, fails, judge_responsive, [](CountRun& r) { r.depth = 50; });
  const auto local = [](const std::vector<CountRun>& runs) { return judge_local(runs, {}); };
  expect_flip(good, holds, fails, local, [](CountRun& r) { r.max_vertex_certificates = 10000; });
  expect_flip(good, holds, fails, local, [](CountRun& r) { r.update_share = 1.01; });
  CountRun fan = count_run();
  fan.max_vertex_certificates = 10000;
  EXPECT_EQ(judge_local(good, {fan}).verdict(), condition);
}

TEST(Verdict, InternalEvents) {
  const std::vector<CountRun> counts{count_run()};
  const auto by_exact = [&](const std::vector<ExactRun>& runs) { return judge_efficient(counts, runs); };
  expect_flip(std::vector{exact_run()}, holds, fails, by_exact, [](ExactRun& r) { r.momentary_events = 1; });
  expect_flip(std::vector{exact_run()}, holds, condition, by_exact,
              [](ExactRun& r) { r.momentary_events = r.several_steps = 1; });
  const auto by_counts = [](const std::vector<CountRun>& runs) { return judge_efficient(runs, {}); };
  expect_flip(counts, holds, fails, by_counts, [](CountRun& r) { r.silent_events = 1; });
}

TEST(Verdict, NumberOfEvents) {
  std::vector<CountRun> good;
  for (const std::uint64_t n : {250, 500, 1000, 2000, 4000, 8000}) good.push_back(count_run(n));
  const auto judge = [](const std::vector<CountRun>& runs) {
    return judge_number_of_events(runs, {exact_run()}, fit_growth(runs, 6));
  };
  ASSERT_EQ(fit_growth(good, 6).size(), 1u);
  EXPECT_TRUE(fit_growth(good, 7).empty());
  // Shapes have a minimum size: two requests below it are one size, in either order.
  const std::vector<CountRun> same(6, count_run(250));
  EXPECT_TRUE(fit_growth(same, 6).empty());
  std::vector<CountRun> repeated = good;
  repeated.insert(repeated.begin(), count_run(8000));
  ASSERT_EQ(fit_growth(repeated, 6).size(), 1u);
  EXPECT_EQ(fit_growth(repeated, 6)[0].exponent, fit_growth(good, 6)[0].exponent);
  expect_flip(good, holds, fails, judge,
              [](CountRun& r) { r.values = std::uint64_t(2 * r.breakpoint_bound); });
  ExactRun over = exact_run();
  over.over_lambda = 1;
  EXPECT_EQ(judge_number_of_events(good, {over}, {}).verdict(), fails);
  const auto with_curves = [&](const CurveRun& run) {
    return judge_number_of_events(good, {exact_run()}, fit_growth(good, 6), {run}).verdict();
  };
  CurveRun curves{
      .scene = "thrown", .triangles = 500, .segments = 1, .order = 2, .changes = 90, .pieces = 100};
  EXPECT_EQ(with_curves(curves), holds);
  curves.over_lambda = 1;
  EXPECT_EQ(with_curves(curves), fails);
  curves.over_lambda = 0;
  curves.built = curves.most_changes = 14;
  EXPECT_EQ(with_curves(curves), holds);
  --curves.most_changes;
  EXPECT_EQ(with_curves(curves), fails);
  for (CountRun& run : good) run.events *= run.vertices;
  EXPECT_EQ(judge_number_of_events(good, {}, fit_growth(good, 6)).verdict(), fails);
  for (CountRun& run : good) run.breakpoint_bound = 1e18;
  EXPECT_EQ(judge_number_of_events(good, {}, fit_growth(good, 6)).verdict(), condition);
}

TEST(Verdict, FramesAndUpdates) {
  const std::vector<FrameRun> good = frame_runs();
  expect_flip(good, holds, fails, judge_independent_of_frames, [](FrameRun& r) { ++r.events; });
  expect_flip(good, holds, fails, judge_independent_of_frames, [](FrameRun& r) { r.same_log = 0; });
  expect_flip(good, holds, fails, judge_independent_of_frames, [](FrameRun& r) { ++r.bottom_up_values; });
  // A clip that was played at one frame rate only is not compared, and not counted.
  std::vector<FrameRun> more = good;
  more.push_back(good[0]);
  more.back().scene = "played once";
  EXPECT_EQ(judge_independent_of_frames(more).why, judge_independent_of_frames(good).why);
  const auto never = [](const std::vector<FrameRun>& runs) { return judge_never_more_updates(runs, {}); };
  expect_flip(good, holds, condition, never, [](FrameRun& r) { r.worse_frames = r.repeated_frames = 1; });
  expect_flip(good, holds, fails, never, [](FrameRun& r) { r.worse_frames = r.worse_without_repeat = 1; });
}

TEST(Verdict, Optimality) {
  const auto alone = [](const std::vector<ExactRun>& runs) { return judge_optimal(runs, {}); };
  const std::vector<ExactRun> good{exact_run()};
  expect_flip(good, holds, fails, alone, [](ExactRun& r) { --r.envelope; });
  expect_flip(good, holds, fails, alone, [](ExactRun& r) { ++r.logged; });
  expect_flip(good, holds, condition, alone, [](ExactRun& r) { ++r.logged, ++r.several_steps; });
  const auto with_loose = [&](const std::vector<LooseRun>& runs) { return judge_optimal(good, runs); };
  expect_flip(std::vector{loose_run()}, condition, fails, with_loose,
              [](LooseRun& r) { r.swept_outside = 1; });
  expect_flip(std::vector{loose_run()}, condition, holds, with_loose,
              [](LooseRun& r) { r.swept_updates = r.kinetic_values; });
  expect_flip(std::vector{loose_run()}, fails, holds, judge_lower_bound,
              [](LooseRun& r) { r.linear_updates = r.kinetic_events; });
  expect_flip(std::vector{loose_run()}, fails, Verdict::not_decided, judge_lower_bound,
              [](LooseRun& r) { r.linear_outside = 1; });
}

TEST(Verdict, TranslationsAndPlans) {
  TranslationRun near, far;
  near.scene = "near", near.exact = 1;
  far.scene = "far", far.events = far.separated_ties = 7;
  const std::vector<TranslationRun> both{near, far};
  expect_flip(both, condition, fails, judge_translation, [](TranslationRun& r) { r.separated_ties = 6; });
  expect_flip(std::vector{near}, holds, fails, judge_translation, [](TranslationRun& r) { r.events = 1; });
  PlanRun plan;
  plan.scene = "cloth", plan.updates = 10, plan.updates_at_keyframes = 5;
  const std::vector<PlanRun> plans{plan};
  expect_flip(plans, holds, condition, judge_plan_changes, [](PlanRun& r) { r.moved_between = 1; });
  expect_flip(plans, holds, fails, judge_plan_changes, [](PlanRun& r) { r.moved_at_keyframes = 1; });
  expect_flip(plans, holds, fails, judge_plan_changes, [](PlanRun& r) { r.topology_changes = 1; });
  expect_flip(plans, holds, fails, judge_plan_changes, [](PlanRun& r) { r.invalid_after = 1; });
  expect_flip(plans, holds, fails, judge_plan_changes, [](PlanRun& r) { r.violation = "node 3"; });
}

TEST(Verdict, BoxTrees) {
  BoxTreeRun box;
  box.scene = "cloth", box.triangles = 1000, box.trees = 1, box.depth = 10;
  box.inner_nodes = 999, box.nodes = 1999, box.certificates = 2 * 999 + 6;
  box.most_of_planes = 2, box.queue_peak = 1000, box.bytes = 900, box.aabb_bytes = 1000;
  box.events = 90, box.aabb_events = 100, box.max_leaves_of_vertex = 6, box.max_vertex_certificates = 50;
  const std::vector<BoxTreeRun> good{box};
  expect_flip(good, condition, fails, judge_boxtree_size, [](BoxTreeRun& r) { r.bytes = 1001; });
  expect_flip(good, condition, fails, judge_boxtree_size, [](BoxTreeRun& r) { r.events = 101; });
  expect_flip(good, condition, fails, judge_boxtree_size, [](BoxTreeRun& r) { r.most_of_planes = 3; });
  expect_flip(good, condition, holds, judge_boxtree_size, [](BoxTreeRun& r) { r.certificates -= 6; });
  SearchRun line, worst;
  line.tree = "one axis", line.leaves = 1024, line.most_searched = 21, line.searches = 10;
  worst.tree = "root x, else y", worst.leaves = 1024, worst.most_searched = 1023, worst.events_of_root = 5;
  const std::vector<SearchRun> searches{line, worst};
  const auto by_box = [&](const std::vector<BoxTreeRun>& runs) {
    return judge_boxtree_qualities(runs, searches);
  };
  expect_flip(good, holds, fails, by_box, [](BoxTreeRun& r) { r.silent_events = 1; });
  expect_flip(good, holds, fails, by_box, [](BoxTreeRun& r) { r.violation = "node 3"; });
  expect_flip(good, holds, fails, by_box, [](BoxTreeRun& r) { r.max_vertex_certificates = 1000; });
  const auto by_search = [&](const std::vector<SearchRun>& runs) {
    return judge_boxtree_qualities(good, runs);
  };
  expect_flip(searches, holds, fails, by_search, [](SearchRun& r) { r.most_searched = 100; });
  expect_flip(searches, holds, fails, by_search, [](SearchRun& r) { r.tree = "one axis"; });
}

TEST(Verdict, SeparationLists) {
  SeparationRun run;
  run.scene = "cloth", run.polygons = 1000, run.queue_peak = 3000;
  run.audits = 20, run.entries = 50000, run.most_of_box = 100, run.list_peak = 2500;
  run.overlap = {100, 400, 4, 5000, 500, 12.0};
  run.parents = {100, 400, 4, 5000, 500, 12.0};
  const std::vector<SeparationRun> good{run};
  expect_flip(good, holds, fails, judge_separation_list, [](SeparationRun& r) { r.differences = 1; });
  expect_flip(good, holds, fails, judge_separation_list, [](SeparationRun& r) { r.audits = 0; });
  expect_flip(good, holds, condition, judge_separation_list,
              [](SeparationRun& r) { r.overlap.most_pairs = 8; });
  expect_flip(good, holds, fails, judge_separation_list,
              [](SeparationRun& r) { r.leaves.most_steps_per_operation = 100; });
  std::vector<ListSizeRun> sizes;
  for (const char* scene : {"sheet", "cloth"})
    for (const std::uint64_t m : {100, 200, 400, 800}) sizes.push_back({scene, m, 3 * m, m / 2});
  EXPECT_EQ(judge_list_size(sizes).verdict(), holds);
  for (std::size_t i = 4; i < 8; ++i) sizes[i].list *= sizes[i].polygons;
  EXPECT_EQ(judge_list_size(sizes).verdict(), condition);
  for (std::size_t i = 0; i < 4; ++i) sizes[i].list *= sizes[i].polygons;
  EXPECT_EQ(judge_list_size(sizes).verdict(), fails);
  EXPECT_EQ(judge_list_size({sizes[0]}).verdict(), Verdict::not_decided);
  const std::vector<ListSizeRun> same(6, sizes[0]);
  EXPECT_EQ(judge_list_size(same).verdict(), Verdict::not_decided);
  for (ListSizeRun& size : sizes) size.list = 0;
  EXPECT_EQ(judge_list_size(sizes).verdict(), Verdict::not_decided);
}

// ---- Constructed scenes ----------------------------------------------------------------------------------

TEST(Constructed, OneBoundChangesHandsFifteenTimesInOneFrame) {
  const auto runs = measure_frames(tangents_scene(16), std::vector<std::uint32_t>{1});
  ASSERT_EQ(runs.size(), 1u);
  EXPECT_EQ(runs[0].frames, 1u);
  EXPECT_EQ(runs[0].most_of_bound, 15u);
  EXPECT_EQ(runs[0].bottom_up_values, 6u);
  EXPECT_GT(runs[0].values, runs[0].bottom_up_values);
  EXPECT_EQ(runs[0].worse_frames, 1u);
  // Not an artefact of the tree: the envelope has these breakpoints, and no lines could have more.
  const ExactRun exact = measure_exact(tangents_scene(16), 20);
  EXPECT_EQ(exact.violation, "");
  EXPECT_EQ(exact.envelope, runs[0].values);
  EXPECT_EQ(exact.most_breakpoints, 15u);
  EXPECT_EQ(exact.fullest, 1.0);
  EXPECT_EQ(judge_never_more_updates({}, runs).verdict(), condition);
}

TEST(Constructed, ParabolasReachTheBoundOfOrderTwoAndCubicsExceedIt) {
  for (const std::uint32_t n : {2u, 8u, 128u}) {
    const CurveRun run = measure_curves(parabolas_scene(n));
    EXPECT_EQ(run.order, 2u);
    EXPECT_EQ(run.most_changes, 2 * n - 2);
    EXPECT_EQ(run.over_lambda, 0u);
    EXPECT_EQ(run.fullest, n < 8 ? 0.0 : 1.0);
  }
  for (const std::uint32_t n : {2u, 3u, 8u, 12u}) {
    const CurveRun run = measure_curves(cubics_scene(n));
    EXPECT_EQ(run.order, 3u);
    EXPECT_EQ(run.most_changes, 3 * n - 3);
    EXPECT_EQ(run.over_lambda, 0u);
  }
}

TEST(Constructed, TheHubOfAFanTakesPartInEveryLeaf) {
  const CountRun fan = measure_counts(fan_scene(500));
  EXPECT_EQ(fan.max_leaves_of_vertex, 500u);
  EXPECT_GE(fan.max_vertex_certificates, 6 * 500u);
  EXPECT_LE(fan.update_share, 1.0);
}

TEST(Constructed, OneSearchTakesHalfOfTheTreeThatIsSplitOnceOnItsAxis) {
  for (const std::uint32_t leaves : {64u, 512u}) {
    const SearchRun worst = measure_searches("root x, else y", leaves);
    EXPECT_GE(worst.most_searched, leaves - 1);
    EXPECT_GT(worst.events_of_root, 0u);
    EXPECT_GE(worst.searched_by_root, worst.events_of_root * (leaves - 1));
    const SearchRun line = measure_searches("one axis", leaves);
    EXPECT_LE(line.most_searched, 2 * std::uint64_t(std::log2(leaves)) + 1);
  }
  EXPECT_THROW(measure_searches("sideways", 64), std::invalid_argument);
}

TEST(Constructed, TranslationsAreExactNearAndRoundedFar) {
  const Translation near = near_translation(500, 10), far = far_translation(500, 10);
  EXPECT_EQ(near.rounded, 0u);
  EXPECT_GT(far.rounded, 0u);
  const TranslationRun still = measure_translation(near.scene, near.rounded);
  EXPECT_EQ(still.events, 0u);
  const TranslationRun ties = measure_translation(far.scene, far.rounded);
  EXPECT_GT(ties.events, 0u);
  EXPECT_EQ(ties.events, ties.separated_ties);
}

TEST(Measured, CountsAgreeWithTheLog) {
  const Scene<float> scene = moving_scene("waving_sheet", 200, 6);
  const CountRun counts = measure_counts(scene);
  const ExactRun exact = measure_exact(scene, 30);
  EXPECT_EQ(counts.events, exact.events);
  EXPECT_EQ(counts.values, exact.logged);
  EXPECT_EQ(exact.violation, "");
  EXPECT_EQ(exact.faults + exact.path_faults, 0u);
  EXPECT_GE(exact.audited_instants, 36u);
  EXPECT_GT(exact.path_bounds, exact.events);
  const LooseRun loose = measure_loose(scene, 7);
  EXPECT_EQ(loose.swept_outside + loose.linear_outside, 0u);
  EXPECT_GT(loose.swept_looseness, loose.linear_looseness);
  EXPECT_EQ(loose.kinetic_values, counts.values);
}

TEST(Measured, BoxTreesAreProvedBesideTheAabbTrees) {
  const Scene<float> scene = moving_scene("waving_sheet", 200, 6);
  const CountRun counts = measure_counts(scene);
  const BoxTreeRun box = measure_boxtree(scene, counts, Proof::exact_envelopes);
  EXPECT_EQ(box.violation, "");
  EXPECT_EQ(box.certificates, 2 * box.inner_nodes + 6);
  EXPECT_EQ(box.proved, box.certificates);
  EXPECT_LT(box.bytes, counts.bytes);
  EXPECT_GT(box.searches, box.events);
}

TEST(Measured, SeparationListsEqualTraversals) {
  const SeparationRun run = measure_separation(colliding_scene("expanding_sphere", 80, 6), 20);
  EXPECT_EQ(run.audits, 20u);
  EXPECT_EQ(run.differences, 0u);
  EXPECT_GT(run.entries, 0u);
  EXPECT_GT(run.overlap.events, 0u);
}

TEST(Measured, PlanChangesKeepTheTree) {
  const Scene<float> scene = moving_scene("waving_sheet", 100, 8);
  const PlanScript<float> script = velocity_script(scene, 10, 10);
  ASSERT_GT(script.steps.size(), 2u);
  const PlanRun run = measure_plan_changes(scene, script, 10);
  EXPECT_EQ(run.violation, "");
  EXPECT_EQ(run.updates, script.steps.size());
  EXPECT_GT(run.updates_at_keyframes, 0u);
  EXPECT_LT(run.updates_at_keyframes, run.updates);
  EXPECT_EQ(run.topology_changes + run.invalid_before + run.invalid_after + run.moved_at_keyframes, 0u);
}

// ---- Fits and records ------------------------------------------------------------------------------------

TEST(Fit, FindsAPowerAndItsInterval) {
  EXPECT_NEAR(student_t95(4), 2.7764, 1e-4);
  std::vector<double> x, exact, noisy;
  for (int i = 0; i < 8; ++i) {
    x.push_back(std::pow(2.0, i + 4));
    exact.push_back(3 * std::pow(x.back(), 1.5));
    noisy.push_back(exact.back() * (i % 2 == 0 ? 1.1 : 0.9));
  }
  const PowerFit fit = fit_power(x, exact);
  EXPECT_NEAR(fit.exponent, 1.5, 1e-12);
  EXPECT_NEAR(fit.constant, 3, 1e-9);
  EXPECT_NEAR(fit.high - fit.low, 0, 1e-9);
  const PowerFit wide = fit_power(x, noisy);
  EXPECT_LT(wide.low, 1.5);
  EXPECT_GT(wide.high, 1.5);
  EXPECT_GT(wide.high - wide.low, 0.05);
  EXPECT_THROW(fit_power({1, 2}, {1, 2}), std::invalid_argument);
  EXPECT_THROW(fit_power({1, 2, 3}, {1, 2, 0}), std::invalid_argument);
  EXPECT_THROW(fit_power({2, 2, 2}, {1, 2, 3}), std::invalid_argument);
  const ProportionalFit line = fit_proportional({1, 2, 4}, {2, 4, 8});
  EXPECT_DOUBLE_EQ(line.constant, 2);
  EXPECT_NEAR(line.worst, 0, 1e-15);
}

TEST(Store, GoesOnWhereItWasAndForgetsOtherPrograms) {
  const experiments::TemporaryFolder folder;
  const auto file = folder / "store.jsonl";
  int made = 0;
  const auto measure = [&] {
    ++made;
    return count_run();
  };
  {
    MeasurementStore store(file, "one");
    EXPECT_EQ(store.get<CountRun>("a", measure).triangles, 1000u);
    store.get<CountRun>("a", measure);
    EXPECT_EQ(made, 1);
    std::ofstream(file, std::ios::app) << R"({"program": "one", "key": "b", "val)";
  }
  MeasurementStore again(file, "one"), other(file, "two");
  EXPECT_EQ(again.get<CountRun>("a", measure).events, count_run().events);
  EXPECT_EQ(made, 1);
  again.get<CountRun>("b", measure);
  other.get<CountRun>("a", measure);
  EXPECT_EQ(made, 3);
}

TEST(Table, FitsIntoAHundredAndTwentyColumns) {
  Claim claim = judge_compact({count_run()});
  for (int i = 0; i < 20; ++i) claim.why += " and so on with numbers like 1,234,567";
  const std::string text = claims_table({claim, judge_optimal({}, {})});
  std::size_t begin = 0;
  for (std::size_t end; (end = text.find('\n', begin)) != std::string::npos; begin = end + 1)
    EXPECT_LE(end - begin, 120u) << text.substr(begin, end - begin);
  EXPECT_NE(text.find("not decided here"), std::string::npos);
}

}  // namespace
}  // namespace kbvh::theory
