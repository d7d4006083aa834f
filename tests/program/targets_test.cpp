// Targets of plans: what is refused before any measurement, and the rows for given records.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>

#include "complaint.hpp"
#include "experiments/common/json_reader.hpp"
#include "experiments/results/target_rows.hpp"
#include "experiments/study/contestants.hpp"
#include "experiments/study/plan.hpp"
#include "experiments/study/targets.hpp"
#include "temporary_folder.hpp"

#if defined(KBVH_TEST_HAS_TBB)
#include <tbb/global_control.h>
#endif

namespace kbvh::experiments::targets_test {
namespace {

using nlohmann::json;

#if defined(KBVH_TEST_HAS_TBB)
// Allows as many threads as shipped plans request, even on machines with fewer cores; set before the registry
// states its parameters.
const tbb::global_control sixteen(tbb::global_control::max_allowed_parallelism, 16);
#endif

/// A plan with one correct target: period over flat, on "sheet".
json example_plan() {
  return json::parse(R"({
    "name": "example",
    "scenes": [{"name": "sheet", "builtin": "waving_sheet", "triangles": 50, "order": ["given", "shuffled"]},
               {"name": "soup", "builtin": "random_soups", "triangles": 50}, "turning_box"],
    "strategies": ["bottom_up_period", {"id": "bottom_up", "builder": {"leaf_size": [1, 4]}},
                   {"id": "peer", "optional": true}],
    "l": [1, 2],
    "targets": [{"what": "flat over period", "numerator": {"strategy": "bottom_up_period", "phase": "update"},
      "denominator": {"strategy": "bottom_up", "phase": "update"},
      "scenes": ["sheet", "soup"], "scalar": "float", "l": 2, "at_least": 2, "aim": 4}]})");
}

Plan read(const json& plan) {
  return read_plan(plan, "p.json", {});
}

void check_targets(const Plan& plan) {
  std::vector<std::string> notes;
  std::vector<std::vector<ContestantSpec>> contestants;
  for (const Study& study : plan.studies)
    contestants.push_back(expand(study.strategies, study.params, study.builder, notes));
  check_target_contestants(plan, contestants);
}

/// Returns the complaint about the plan when the program starts.
std::string start_complaint(const json& value) {
  return complaint([&] { check_targets(read(value)); });
}

std::string with(const std::string& key, const json& value) {
  json plan = example_plan();
  plan["targets"][0][json::json_pointer(key)] = value;
  return start_complaint(plan);
}

std::string without(const std::string& key) {
  json plan = example_plan();
  plan["targets"][0].erase(key);
  return start_complaint(plan);
}

TEST(Targets, ARightPlanIsAccepted) {
  EXPECT_EQ(start_complaint(example_plan()), "nothing was thrown");
  EXPECT_EQ(with("/note", "why"), "nothing was thrown");
  EXPECT_EQ(with("/aim", 2), "nothing was thrown");
  EXPECT_EQ(with("/scenes", "sheet-shuffled"), "nothing was thrown");
  EXPECT_EQ(with("/denominator/builder", {{"leaf_size", {4, 8}}}), "nothing was thrown");
  EXPECT_EQ(with("/numerator/strategy", "peer"), "nothing was thrown") << "optional, may be away";
}

TEST(Targets, ThoseOfShippedPlansAreMeasured) {
  std::size_t targets = 0;
  for (const auto& entry : std::filesystem::directory_iterator(KBVH_PLANS)) {
    if (entry.path().extension() != ".json") continue;
    const Plan plan = load_plan(entry.path());
    EXPECT_NO_THROW(check_targets(plan)) << entry.path();
    targets += plan.targets.size();
  }
  EXPECT_GT(targets, 0u);
}

/// Returns the baselines that a plan's best refits lack: "TARGET: STUDY has no ID". The best refit of a table
/// is one of its participants, so all that can be the fastest must take part; bottom_up_recursive and
/// top_down refit the boxes of bottom_up by slower loops.
std::vector<std::string> missing_baselines(const Plan& plan) {
  std::vector<std::string> notes, found;
  for (const Target& target : plan.targets) {
    if (target.numerator.strategy != best_refit_word && target.denominator.strategy != best_refit_word)
      continue;
    const TargetSelector& other =
        target.numerator.strategy == best_refit_word ? target.denominator : target.numerator;
    const auto has = [](const auto& list, const auto& value) {
      return std::find(list.begin(), list.end(), value) != list.end();
    };
    for (const Study& study : plan.studies) {
      const auto named = [&](const SceneSpec& spec) {
        return has(target.scenes, given_name(spec) + target_suffix(study.asks));
      };
      if (!has(study.scalars, target.scalar) || !has(study.per_keyframe, target.per_keyframe) ||
          target.changes != (study.asks.changes ? answer_word(*study.asks.changes) : "") ||
          std::none_of(study.scenes.begin(), study.scenes.end(), named))
        continue;
      std::set<std::string> ids;
      for (const ContestantSpec& spec : expand(study.strategies, study.params, study.builder, notes))
        ids.insert(spec.entry->info.id);
      constexpr const char* fast[] = {"bottom_up", "hybrid", "leaf_slabs", "front"};
      const auto measured = [&](const char* id) { return ids.contains(id); };
      // Targets use the first table with both sides, not one without any refit.
      if (!ids.contains(other.strategy) || std::none_of(std::begin(fast), std::end(fast), measured)) continue;
      for (const char* id : fast)
        if (!measured(id)) found.push_back(target.what + ": " + study.name + " has no " + id);
    }
  }
  return found;
}

TEST(Targets, BestRefitsOfShippedPlansLackNoFastBaseline) {
  std::size_t targets = 0;
  for (const auto& entry : std::filesystem::directory_iterator(KBVH_PLANS)) {
    if (entry.path().extension() != ".json") continue;
    const Plan plan = load_plan(entry.path());
    EXPECT_EQ(missing_baselines(plan), std::vector<std::string>{}) << entry.path();
    for (const Target& target : plan.targets) targets += target.numerator.strategy == best_refit_word ? 1 : 0;
  }
  EXPECT_GT(targets, 20U);
  json poor = example_plan();
  poor["targets"][0]["numerator"]["strategy"] = "best_refit";
  EXPECT_EQ(missing_baselines(read(poor)).size(), 3U) << "the example has bottom_up alone";
}

TEST(Targets, ErrorsNameFileTargetAndKey) {
  for (const char* key : {"what", "numerator", "denominator", "scenes", "scalar", "l", "at_least", "aim"})
    EXPECT_EQ(without(key), std::string("p.json: targets[0]: ") + key + ": is missing");
  EXPECT_EQ(with("/extra", 1),
            "p.json: targets[0]: there is no key 'extra'; known are aim, at_least, changes, denominator, l, "
            "note, numerator, over, scalar, scenes, what");
  EXPECT_EQ(with("/numerator/extra", 1),
            "p.json: targets[0]: numerator: there is no key 'extra'; known are builder, or, params, phase, "
            "scene, strategy");
  EXPECT_EQ(
      with("/denominator/phase", "lunch"),
      "p.json: targets[0]: denominator: phase: expected one of motion, update, traversal, triangle_tests, "
      "query, candidates, total, upkeep, update_per_event, got 'lunch'");
  EXPECT_EQ(with("/over", "all"), "p.json: targets[0]: over: expected worst or geometric_mean, got 'all'");
  EXPECT_EQ(with("/numerator", "bottom_up"),
            "p.json: targets[0]: numerator: expected an object with named members, got \"bottom_up\"");
  EXPECT_EQ(with("/scalar", "half"), "p.json: targets[0]: scalar: expected float or double, got 'half'");
  EXPECT_EQ(with("/at_least", 5), "p.json: targets[0]: at_least: must not be above the aim, 5 is above 4");
  EXPECT_EQ(with("/at_least", 0), "p.json: targets[0]: at_least: must be above 0, got 0");
  EXPECT_EQ(with("/at_least", "2"), "p.json: targets[0]: at_least: expected a finite number, got \"2\"");
  EXPECT_EQ(with("/l", 0), "p.json: targets[0]: l: expected a whole number from 1 to 1000000, got 0");
  json plan = example_plan();
  plan["targets"] = json::array();
  EXPECT_EQ(start_complaint(plan), "p.json: targets: the list is empty");
  plan = example_plan();
  plan["studies"] = {{{"targets", plan["targets"]}}};
  EXPECT_NE(start_complaint(plan).find("p.json: studies[0]: there is no key 'targets'"), std::string::npos);
}

TEST(Targets, ScenesMustBeMeasuredAndToldApart) {
  const std::string none = "p.json: targets[0]: scenes: no study has a scene of the name ";
  EXPECT_EQ(with("/scenes", {"sheet", "cloth"}),
            none + "'cloth' in float at l = 2; there are sheet, sheet-shuffled, soup");
  EXPECT_EQ(with("/scenes", "turning_box"),
            none + "'turning_box' in float at l = 2; there are sheet, sheet-shuffled, soup");
  EXPECT_EQ(with("/l", 3), none + "'sheet' in float at l = 3; there are none with a name");
  EXPECT_EQ(with("/scalar", "double"), none + "'sheet' in double at l = 2; there are none with a name");
  EXPECT_EQ(with("/changes", "pairs"),
            none + "'sheet' in float at l = 2 as changes of pairs; there are none with a name");
  EXPECT_EQ(with("/changes", "contacts"),
            "p.json: targets[0]: changes: expected candidates or pairs, got 'contacts'");
  json plan = example_plan();
  plan["changes"] = "pairs";
  EXPECT_EQ(start_complaint(plan), none + "'sheet' in float at l = 2; there are none with a name");
  plan["targets"][0]["changes"] = "pairs";
  EXPECT_EQ(start_complaint(plan), "nothing was thrown");
  plan = example_plan();
  plan["scenes"][0]["triangles"] = {50, 98};
  EXPECT_EQ(start_complaint(plan), "p.json: targets[0]: scenes: 'sheet' is the name of several scenes");
  plan = example_plan();
  plan["studies"] = {{{"name", "a"}}, {{"name", "b"}, {"repetitions", 5}}};
  EXPECT_EQ(start_complaint(plan), "nothing was thrown") << "the same scene in two studies";
}

TEST(Targets, SidesMustBeMeasuredTogether) {
  EXPECT_NE(
      with("/numerator/strategy", "nobody")
          .find("p.json: targets[0]: numerator: strategy: there is no strategy 'nobody'; `kbvh list` shows"),
      std::string::npos);
  EXPECT_EQ(with("/numerator/strategy", "rebuild"),
            "p.json: targets[0]: no study has both rebuild and bottom_up on 'sheet' in float at l = 2");
  EXPECT_EQ(with("/denominator/builder", {{"leaf_size", 16}, {"width", {2, 4}}}),
            "p.json: targets[0]: no study has both bottom_up_period and bottom_up with width 2 or 4, "
            "leaf_size 16 on "
            "'sheet' in float at l = 2");
  EXPECT_NE(with("/denominator/params", {{"speed", 3}}).find("p.json: targets[0]: denominator: params: "),
            std::string::npos);
  json plan = example_plan();
  plan["strategies"].push_back("brute_force");
  plan["targets"][0]["numerator"] = {
      {"strategy", "brute_force"}, {"phase", "query"}, {"builder", {{"width", 2}}}};
  EXPECT_EQ(start_complaint(plan),
            "p.json: targets[0]: numerator: builder: brute_force builds its own hierarchy");
  plan = example_plan();
  plan["studies"] = {{{"strategies", "bottom_up"}}, {{"strategies", "bottom_up_period"}}};
  EXPECT_EQ(
      start_complaint(plan),
      "p.json: targets[0]: no study has both bottom_up_period and bottom_up on 'sheet' in float at l = 2");
}

TEST(Targets, OptionalStrategiesThatAreNotThereAreLeftOut) {
  std::vector<std::string> notes;
  const Plan plan = read(example_plan());
  const auto list = expand(plan.studies[0].strategies, {}, {}, notes);
  EXPECT_EQ(list.size(), 3u);
  ASSERT_EQ(notes.size(), 1u);
  EXPECT_EQ(notes[0], "this program was built without the strategy 'peer': left out");
}

// --- rows ---------------------------------------------------------------------------------------------

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
