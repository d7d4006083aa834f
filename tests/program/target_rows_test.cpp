// Targets of plans: the rows for given records.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "experiments/results/target_rows.hpp"
#include "target_plan.hpp"
#include "temporary_folder.hpp"

namespace kbvh::experiments::targets_test {
namespace {

json scene(const std::string& name, const std::string& hash) {
  return {{"name", name},
          {"hash", hash},
          {"order", "given"},
          {"scalar", "float"},
          {"per_keyframe", 2},
          {"bodies", {{{"moving", true}, {"primitives", 50}}, {{"moving", false}, {"primitives", 7}}}}};
}

/// A record whose repetitions have these updates.
json record(const std::string& id, std::uint32_t leaf_size, const std::vector<double>& updates) {
  json repetitions = json::array();
  for (const double update : updates)
    repetitions.push_back({{"motion", 0.0},
                           {"update", update},
                           {"traversal", 1.0},
                           {"triangle_tests", 2.0},
                           {"plan_changes", 4.0}});
  return {{"run", "r"},
          {"strategy",
           {{"id", id},
            {"label", id + " [leaf=" + std::to_string(leaf_size) + "]"},
            {"params", json::object()},
            {"builder", {{"method", "median"}, {"width", 8}, {"leaf_size", leaf_size}}}}},
          {"times", {{"repetitions", repetitions}}}};
}

std::vector<TargetGroup> example_groups() {
  return {
      {scene("sheet", "1"),
       {record("bottom_up_period", 1, {8, 9, 10}), record("bottom_up", 1, {4, 4, 4}),
        record("bottom_up", 4, {3, 3, 30})}},
      {scene("soup", "2"), {record("bottom_up_period", 1, {10, 10, 12}), record("bottom_up", 1, {4, 4, 4})}},
      {scene("other", "3"), {record("bottom_up_period", 1, {1, 1}), record("bottom_up", 1, {2, 2})}}};
}

json row_of(const json& plan, const std::vector<TargetGroup>& groups) {
  return target_rows(read(plan), groups).at(0);
}

TEST(Targets, TheWorstSceneAndTheFastestConfigurationCount) {
  const json row = row_of(example_plan(), example_groups());
  EXPECT_EQ(row.at("what"), "flat over period");
  EXPECT_EQ(row.at("measured"), 2.5);
  EXPECT_EQ(row.at("scene"), "soup");
  EXPECT_EQ(row.at("verdict"), "reached");
  EXPECT_EQ(row.at("plan"), "example");
  const json& scenes = row.at("per_scene");
  ASSERT_EQ(scenes.size(), 3u);
  EXPECT_EQ(scenes[0].at("ratio"), 3.0);
  EXPECT_EQ(scenes[0].at("denominator").at("label"), "bottom_up [leaf=4]");
  EXPECT_EQ(scenes[0].at("denominator").at("ms"), 3.0);
  EXPECT_EQ(scenes[0].at("triangles"), 50);
  EXPECT_EQ(scenes[0].at("counts"), true);
  EXPECT_EQ(scenes[2].at("ratio"), 0.5);
  EXPECT_EQ(scenes[2].at("counts"), false);
}

// One configuration represents a side in every phase: the one with the shortest clip, not the one that wins a
// phase.
TEST(Targets, TheConfigurationWithTheShortestClipCountsInEveryPhase) {
  auto groups = example_groups();
  for (json& repetition : groups[0].records[2]["times"]["repetitions"]) repetition["traversal"] = 9.0;
  const json row = row_of(example_plan(), groups);
  EXPECT_EQ(row.at("per_scene")[0].at("denominator").at("label"), "bottom_up [leaf=1]");
  EXPECT_EQ(row.at("per_scene")[0].at("ratio"), 9.0 / 4.0);
}

TEST(Targets, TheBestRefitIsTheBaselineWithTheShortestClip) {
  json plan = example_plan();
  plan["targets"][0]["denominator"] = {
      {"strategy", "best_refit"}, {"phase", "update"}, {"params", {{"threads", 1}}}};
  EXPECT_EQ(start_complaint(plan), "nothing was thrown");
  auto groups = example_groups();
  for (TargetGroup& group : groups) {
    for (json& one : group.records) one["strategy"]["baseline"] = one["strategy"]["id"] == "bottom_up";
    group.records.push_back(record("lazy", 1, {0.5, 0.5, 0.5}));
    group.records.back()["strategy"]["baseline"] = true;
    for (json& repetition : group.records.back()["times"]["repetitions"]) repetition["traversal"] = 50.0;
  }
  groups[0].records[2]["strategy"]["params"]["threads"] = "2";
  const json row = row_of(plan, groups);
  EXPECT_EQ(row.at("per_scene")[0].at("denominator").at("label"), "bottom_up [leaf=1]") << "of one thread";
  EXPECT_EQ(row.at("per_scene")[0].at("ratio"), 9.0 / 4.0);
  EXPECT_EQ(row.at("denominator").at("which"), "the best refit with threads 1");
  for (TargetGroup& group : groups)
    for (json& one : group.records) one["strategy"]["baseline"] = false;
  EXPECT_EQ(row_of(plan, groups).at("reason"), "sheet: the best refit with threads 1 takes no part");
  plan["targets"][0]["denominator"]["or"] = {"hybrid"};
  EXPECT_NE(start_complaint(plan).find("the best refit has no alternatives"), std::string::npos);
}

TEST(Targets, NotesStandBelowTheTable) {
  json plan = example_plan();
  plan["targets"][0]["note"] = "counted twice";
  EXPECT_NE(
      targets_table(target_rows(read(plan), example_groups())).find("\n  flat over period: counted twice\n"),
      std::string::npos);
}

TEST(Targets, GeometricMeansAreOverAllScenesThatCount) {
  json plan = example_plan();
  plan["targets"][0]["over"] = "geometric_mean";
  const json row = row_of(plan, example_groups());
  EXPECT_EQ(row.at("over"), "geometric_mean");
  EXPECT_DOUBLE_EQ(row.at("measured").get<double>(), std::sqrt(3.0 * 2.5));
  const json &sheet = row.at("per_scene")[0].at("range"), &soup = row.at("per_scene")[1].at("range");
  for (const std::size_t end : {0u, 1u})
    EXPECT_DOUBLE_EQ(row.at("range")[end].get<double>(),
                     std::sqrt(sheet[end].get<double>() * soup[end].get<double>()));
  EXPECT_NE(targets_table(json::array({row})).find("mean of 2"), std::string::npos);
  auto groups = example_groups();
  groups.erase(groups.begin() + 1);
  EXPECT_EQ(row_of(plan, groups).at("verdict"), "unmeasured") << "a scene that counts is missing";
}

TEST(Targets, CandidatesAreUpdateTraversalAndPlanChanges) {
  json plan = example_plan();
  plan["targets"][0]["scenes"] = "sheet";
  plan["targets"][0]["numerator"]["phase"] = "candidates";
  plan["targets"][0]["denominator"]["phase"] = "query";
  EXPECT_EQ(row_of(plan, example_groups()).at("measured"), 14.0 / 3.0);
}

TEST(Targets, ASideMayBeMeasuredOnAnotherScene) {
  json plan = example_plan();
  plan["targets"][0]["scenes"] = "sheet";
  plan["targets"][0]["numerator"]["scene"] = "soup";
  EXPECT_EQ(start_complaint(plan), "nothing was thrown");
  EXPECT_EQ(row_of(plan, example_groups()).at("measured"), 10.0 / 3.0);
  auto groups = example_groups();
  groups.erase(groups.begin() + 1);
  EXPECT_EQ(row_of(plan, groups).at("reason"), "sheet: 'soup' was left out");
  plan["targets"][0]["numerator"]["scene"] = "nowhere";
  EXPECT_NE(start_complaint(plan).find("no study has a scene of the name 'nowhere'"), std::string::npos);
  plan["targets"][0]["numerator"] = {{"strategy", "rebuild"}, {"phase", "update"}, {"scene", "soup"}};
  EXPECT_EQ(start_complaint(plan), "p.json: targets[0]: no study has rebuild on 'soup' in float at l = 2");
}

TEST(Targets, UpkeepHasChangesAndEventsDivideTheUpdate) {
  json plan = example_plan();
  plan["targets"][0]["scenes"] = "sheet";
  plan["targets"][0]["numerator"]["phase"] = "upkeep";
  EXPECT_EQ(row_of(plan, example_groups()).at("measured"), 13.0 / 3.0);
  for (const char* side : {"numerator", "denominator"})
    plan["targets"][0][side]["phase"] = "update_per_event";
  auto groups = example_groups();
  for (auto& record : groups[0].records) {
    record["scene"]["frames"] = 10;
    record["counters"]["certificates_failed"] = record.at("strategy").at("id") == "bottom_up" ? 20 : 30;
  }
  EXPECT_DOUBLE_EQ(row_of(plan, groups).at("measured").get<double>(), (9.0 / 3) / (3.0 / 2));
}

TEST(Targets, Verdicts) {
  json plan = example_plan();
  const auto verdict = [&](double at_least, double aim) {
    plan["targets"][0]["at_least"] = at_least;
    plan["targets"][0]["aim"] = aim;
    return row_of(plan, example_groups()).at("verdict").get<std::string>();
  };
  EXPECT_EQ(verdict(1, 2.5), "reached_aim");
  EXPECT_EQ(verdict(2.5, 2.6), "reached");
  EXPECT_EQ(verdict(2.6, 2.6), "missed");
}

TEST(Targets, IntervalsAreReproducibleAndHoldTheRatio) {
  auto groups = example_groups();
  groups[1].records[0] = record("bottom_up_period", 1, {10, 10, 12, 10, 12});
  groups[1].records[1] = record("bottom_up", 1, {4, 4, 4, 4, 4});
  const json row = row_of(example_plan(), groups), again = row_of(example_plan(), groups);
  EXPECT_EQ(row.at("confidence_interval"), again.at("confidence_interval"));
  // For soup: medians of 10, 10, 12, 10, 12 over a constant 4.
  EXPECT_EQ(row.at("confidence_interval"), (json{2.5, 3.0}));
  EXPECT_TRUE(row.at("range").is_null());
  // With fewer than five repetitions: the range of single ones, and no interval.
  const json few = row_of(example_plan(), example_groups());
  EXPECT_TRUE(few.at("confidence_interval").is_null());
  EXPECT_EQ(few.at("range"), (json{2.5, 3.0}));
  EXPECT_NE(targets_table(json::array({few})).find("[2.5 to 3]"), std::string::npos);
  groups[1].records[0] = record("bottom_up_period", 1, {10});
  EXPECT_TRUE(row_of(example_plan(), groups).at("confidence_interval").is_null());
  EXPECT_TRUE(row_of(example_plan(), groups).at("range").is_null());
}

TEST(Targets, SelectorsSeeBuilderParametersAndPhase) {
  json plan = example_plan();
  plan["targets"][0]["scenes"] = "sheet";
  plan["targets"][0]["denominator"]["builder"] = {{"leaf_size", 1}};
  EXPECT_EQ(row_of(plan, example_groups()).at("measured"), 9.0 / 4.0);
  plan["targets"][0]["numerator"]["phase"] = "total";
  plan["targets"][0]["denominator"]["phase"] = "query";
  EXPECT_EQ(row_of(plan, example_groups()).at("measured"), 16.0 / 3.0);
  auto groups = example_groups();
  groups[0].records[1]["strategy"]["params"]["queue"] = "avl";
  plan["targets"][0]["denominator"] = {
      {"strategy", "bottom_up"}, {"phase", "update"}, {"params", {{"queue", "avl"}}}};
  plan["targets"][0]["numerator"]["phase"] = "update";
  EXPECT_EQ(row_of(plan, groups).at("measured"), 9.0 / 4.0);
}

TEST(Targets, WhatCannotBeMeasuredSaysWhy) {
  const auto reason = [](const json& plan, const std::vector<TargetGroup>& groups) {
    const json row = row_of(plan, groups);
    EXPECT_TRUE(row.at("measured").is_null());
    EXPECT_TRUE(row.at("confidence_interval").is_null());
    EXPECT_EQ(row.at("verdict"), "unmeasured");
    EXPECT_EQ(row.at("scene"), nullptr);
    EXPECT_NE(targets_table(json::array({row})).find(row.at("reason").get<std::string>()), std::string::npos);
    return row.at("reason").get<std::string>();
  };
  auto groups = example_groups();
  groups.erase(groups.begin() + 1);
  EXPECT_EQ(reason(example_plan(), groups), "soup: the scene was left out");
  groups = example_groups();
  groups[1].records[0]["times"] = nullptr;
  groups[1].records[0]["refused"] = "it lost a pair";
  EXPECT_EQ(reason(example_plan(), groups),
            "soup: bottom_up_period [leaf=1] is refused a time: it lost a pair");
  groups[1].records.erase(groups[1].records.begin());
  EXPECT_EQ(reason(example_plan(), groups), "soup: bottom_up_period takes no part");
  json plan = example_plan();
  plan["targets"][0]["numerator"]["strategy"] = "peer";
  EXPECT_EQ(reason(plan, example_groups()), "sheet: this program was built without peer");
  plan = example_plan();
  plan["targets"][0]["denominator"]["phase"] = "motion";
  EXPECT_EQ(reason(plan, example_groups()), "sheet: bottom_up [leaf=4] spends no time in 'motion'");
}

TEST(Targets, ARefusedConfigurationDoesNotCountTheOthersDo) {
  auto groups = example_groups();
  groups[0].records[2]["times"] = nullptr;
  const json row = row_of(example_plan(), groups);
  EXPECT_EQ(row.at("per_scene")[0].at("ratio"), 9.0 / 4.0);
}

TEST(Targets, BothSidesComeFromOneStudy) {
  std::vector<TargetGroup> groups{{scene("sheet", "1"), {record("bottom_up", 1, {1, 1})}}};
  for (const TargetGroup& group : example_groups()) groups.push_back(group);
  const json row = row_of(example_plan(), groups);
  EXPECT_EQ(row.at("per_scene")[0].at("ratio"), 3.0);
  EXPECT_EQ(row.at("per_scene").size(), 3u);
}

// One scene with other kernels is another row, although its hash is the same.
TEST(Targets, OtherKernelsDoNotMix) {
  json plan = example_plan();
  json held = {{"name", "held"}, {"kernels", "portable"}};
  plan["studies"] = {json{{"name", "free"}}, held};
  plan["targets"][0]["scenes"] = {"sheet (portable kernels)"};
  EXPECT_EQ(start_complaint(plan), "nothing was thrown");
  auto groups = example_groups();
  TargetGroup slow = groups[0];
  slow.scene["name"] = "sheet (portable kernels)";
  slow.scene["kernels"] = "portable";
  for (json& repetition : slow.records[2]["times"]["repetitions"]) repetition["update"] = 6.0;
  slow.records.erase(slow.records.begin() + 1);
  groups.push_back(slow);
  const json row = row_of(plan, groups);
  EXPECT_EQ(row.at("measured"), 9.0 / 6.0);
  EXPECT_EQ(row.at("scene"), "sheet (portable kernels)");
}

TEST(Targets, OtherScalarsAndFramesDoNotMix) {
  auto groups = example_groups();
  groups[0].scene["per_keyframe"] = 1;
  EXPECT_EQ(row_of(example_plan(), groups).at("verdict"), "unmeasured");
  groups = example_groups();
  groups[0].scene["scalar"] = "double";
  EXPECT_EQ(row_of(example_plan(), groups).at("verdict"), "unmeasured");
}

TEST(Targets, ChangesDoNotMixWithFullAnswers) {
  auto groups = example_groups();
  groups[0].scene["changes"] = "pairs";
  groups[0].scene["name"] = "sheet (changes of pairs)";
  EXPECT_EQ(row_of(example_plan(), groups).at("verdict"), "unmeasured");
  json plan = example_plan();
  plan["changes"] = "pairs";
  plan["targets"][0]["changes"] = "pairs";
  plan["targets"][0]["scenes"] = "sheet";
  const json row = row_of(plan, groups);
  EXPECT_EQ(row.at("measured"), 3.0);
  EXPECT_EQ(row.at("changes"), "pairs");
  EXPECT_EQ(row.at("per_scene")[0].at("scene"), "sheet (changes of pairs)");
  groups[0].scene["changes"] = "candidates";
  EXPECT_EQ(row_of(plan, groups).at("verdict"), "unmeasured");
}

TEST(Targets, TableShowsRowsAndScenes) {
  const std::string table = targets_table(target_rows(read(example_plan()), example_groups()));
  EXPECT_EQ(
      table,
      "Targets: how many times slower the other is, on the scenes that count\n"
      "target            measured  interval or [range]  at least  aim  verdict    on\n"
      "flat over period       2.5           [2.5 to 3]         2    4  reached  soup\n"
      "\n"
      "All scenes (* counts, ? disturbed)\n"
      "\n"
      "flat over period  ratio  interval or [range]  ms                         of  ms                  of\n"
      "  sheet *             3        [0.3333 to 3]   9  bottom_up_period [leaf=1]   3  bottom_up [leaf=4]\n"
      "  soup *            2.5           [2.5 to 3]  10  bottom_up_period [leaf=1]   4  bottom_up [leaf=1]\n"
      "  other             0.5         [0.5 to 0.5]   1  bottom_up_period [leaf=1]   2  bottom_up "
      "[leaf=1]\n");
}

TEST(Targets, RowsOfTheSamePlanAreReplacedAndOthersStay) {
  const TemporaryFolder folder;
  const auto row = [](const char* plan, int number) { return json{{"plan", plan}, {"number", number}}; };
  const auto written = [&] { return json::parse(text_of_file(folder / "targets.json")); };
  write_targets(folder.path(), json::array({row("a", 1), row("a", 2)}));
  write_targets(folder.path(), json::array({row("b", 3)}));
  EXPECT_EQ(written(), json::array({row("a", 1), row("a", 2), row("b", 3)}));
  write_targets(folder.path(), json::array({row("a", 4)}));
  EXPECT_EQ(written(), json::array({row("b", 3), row("a", 4)}));
  write_text(folder / "targets.json", "{");
  write_targets(folder.path(), json::array({row("a", 5)}));
  EXPECT_EQ(written(), json::array({row("a", 5)}));
  EXPECT_EQ(text_of_file(folder / "targets.json.damaged"), "{");
}

}  // namespace
}  // namespace kbvh::experiments::targets_test
