// Targets of plans: what is refused before any measurement.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <set>

#include "target_plan.hpp"

#if defined(KBVH_TEST_HAS_TBB)
#include <tbb/global_control.h>
#endif

namespace kbvh::experiments::targets_test {
namespace {

#if defined(KBVH_TEST_HAS_TBB)
// Allows as many threads as shipped plans request, even on machines with fewer cores; set before the registry
// states its parameters.
const tbb::global_control sixteen(tbb::global_control::max_allowed_parallelism, 16);
#endif

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
/// top_down refit the boxes of bottom_up by slower loops, and dirty_refit is bottom_up where most vertices
/// move.
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
      "query, candidates, total, upkeep, update_per_event, upkeep_with_motion, total_with_motion, got "
      "'lunch'");
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

}  // namespace
}  // namespace kbvh::experiments::targets_test
