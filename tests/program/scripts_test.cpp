// Scripts of plan changes: what a user may write, what is refused and how, and a study that replays a script.
#include <gtest/gtest.h>

#include "complaint.hpp"
#include "core/judge/follow_script.hpp"
#include "experiments/common/json_reader.hpp"
#include "experiments/results/record.hpp"
#include "experiments/results/table.hpp"
#include "experiments/scenes/scene_spec.hpp"
#include "experiments/scenes/scripted.hpp"
#include "experiments/study/measure.hpp"
#include "experiments/study/plan.hpp"
#include "experiments/study/times_record.hpp"
#include "temporary_folder.hpp"

namespace kbvh::experiments::scripts_test {
namespace {

using nlohmann::json;

LoadedScene scene_with(const json& script, const std::string& order = "given") {
  const json scene{{"bodies",
                    {{{"shape", "waving_sheet"}, {"triangles", 50}, {"keyframes", 4}, {"name", "sheet"}},
                     {{"shape", "sphere"}, {"triangles", 80}}}},
                   {"order", order},
                   {"script", script}};
  return load(read_scenes(scene, "p.json: scenes[0]", {}).at(0));
}

const json sound = json::parse(R"([
  {"time": 0, "changes": [{"body": "sheet", "vertex": 3, "velocity": [0, 0, 1]}]},
  {"time": 0.05, "changes": [{"body": 1, "vertex": 0, "times": [0.06, 0.1], "positions": [[1, 0, 0], [0, 1, 0]]},
                             {"vertex": 5}]}])");

TEST(Scripts, AreReadAndTriedOut) {
  const LoadedScene loaded = scene_with(sound);
  const Scene<float> scene = assemble<float>(loaded);
  const PlanScript<float> script = script_of(scene, loaded);
  ASSERT_EQ(script.steps.size(), 2u);
  EXPECT_EQ(script.steps[0].changes[0].velocity[2], 1.0f);
  const PlanChange<float>& knots = script.steps[1].changes[0];
  EXPECT_EQ(knots.body, 1u);
  EXPECT_EQ(knots.times, (std::vector<double>{0.06, 0.1}));
  EXPECT_EQ(knots.positions, (std::vector<float>{1, 0, 0, 0, 1, 0}));
  EXPECT_EQ(script.changes_until(0), 1u);
  EXPECT_EQ(script.changes_until(1), 3u);
  // Every time of the script is a frame, in addition to those given by l.
  const auto frames = frames_of(scene, loaded, script, 1);
  EXPECT_EQ(frames.size(), 5u);
  EXPECT_TRUE(std::find(frames.begin(), frames.end(), 0.05) != frames.end());
  EXPECT_FALSE(has_own_frames(loaded));
  const auto all = frames_of(scene, loaded, script, 3);
  for (std::size_t most = 0; most <= all.size() + 1; ++most)
    EXPECT_EQ(frames_of(scene, loaded, script, 3, most),
              std::vector<double>(all.begin(), all.begin() + std::ptrdiff_t(std::min(most, all.size()))));

  const LoadedScene own = scene_with({{"frames", 10}, {"rate", 20}, {"steps", sound}});
  EXPECT_TRUE(has_own_frames(own));
  EXPECT_EQ(frames_of(assemble<float>(own), own, script, 7).size(), 10u);
}

TEST(Scripts, MayBeFiles) {
  TemporaryFolder folder;
  write_text(folder / "s.json", sound.dump());
  EXPECT_EQ(read_script_spec("s.json", "p.json", folder.path()).steps.size(), 2u);
  write_text(folder / "w.json", R"([{"time": 1, "changes": [{"vertex": 1, "speed": 2}]}])");
  const std::string wrong = complaint([&] { read_script_spec("w.json", "p.json", folder.path()); });
  EXPECT_TRUE(contains(wrong, "w.json: steps[0]: changes[0]: there is no key 'speed'"));
  write_text(folder / "j.json", "[{]");
  EXPECT_TRUE(contains(complaint([&] { read_script_spec("j.json", "p.json", folder.path()); }), "not JSON"));
  EXPECT_TRUE(
      contains(complaint([&] { read_script_spec("none.json", "p.json", folder.path()); }), "none.json"));
}

TEST(Scripts, SayWhatIsWrongAndWhere) {
  const std::string in_steps = R"([{"time": 0.05, "changes": [)", end = "]}]";
  const std::vector<std::pair<std::string, std::string>> wrong{
      {"{}", "steps: is missing"},
      {"[]", "steps: the list is empty"},
      {"[3]", "steps[0]: expected an object"},
      {R"({"steps": [{"time": 1, "changes": [{"vertex": 1}]}], "rate": 3})", "frames: goes with rate"},
      {R"({"steps": [{"time": 1, "changes": [{"vertex": 1}]}], "frames": 3, "rate": 0})",
       "rate: must be positive"},
      {R"([{"changes": [{"vertex": 1}]}])", "steps[0]: time: is missing"},
      {R"([{"time": 1}])", "steps[0]: changes: is missing"},
      {R"([{"time": "now", "changes": [{"vertex": 1}]}])", "time: expected a finite number"},
      {R"([{"time": 1, "changes": [{"vertex": 1}]}, {"time": 1, "changes": [{"vertex": 1}]}])",
       "steps[1]: time 1 is not later than that of the preceding step, 1"},
      {in_steps + R"({"velocity": [0, 0, 0]})" + end, "changes[0]: vertex: is missing"},
      {in_steps + R"({"vertex": -1})" + end, "vertex: expected a whole number"},
      {in_steps + R"({"vertex": 1, "velocity": [0, 0]})" + end,
       "velocity: expected a list of 3 finite numbers"},
      {in_steps + R"({"vertex": 1, "velocity": [0, 0, 1e999]})" + end, "too large for a double"},
      {in_steps + R"({"vertex": 1, "times": [1]})" + end, "times: go with as many positions"},
      {in_steps + R"({"vertex": 1, "times": [1, 2], "positions": [[0, 0, 0]]})" + end,
       "1 of them for 2 times"},
      {in_steps + R"({"vertex": 1, "times": [0.05], "positions": [[0, 0, 0]]})" + end,
       "times[0]: 0.05 is not after 0.05, the time of the change"},
      {in_steps + R"({"vertex": 1, "times": [2, 1], "positions": [[0, 0, 0], [0, 0, 0]]})" + end,
       "times[1]: 1 is not after 2"},
      {in_steps + R"({"vertex": 1, "times": [2], "positions": [[0, 0]]})" + end,
       "positions[0]: expected three finite numbers"},
  };
  for (const auto& [text, expected] : wrong) {
    const std::string said = complaint([&] { scene_with(parse_json(text, "p.json")); });
    EXPECT_TRUE(contains(said, expected)) << text;
    EXPECT_TRUE(contains(said, "p.json")) << text;
  }
  EXPECT_TRUE(contains(complaint([&] { scene_with(sound, "shuffled"); }), "order: a script names vertices"));
  const json builtin{{"builtin", "reversing_spheres"}, {"script", sound}};
  EXPECT_TRUE(contains(complaint([&] { read_scenes(builtin, "p", {}); }), "records its own"));
}

TEST(Scripts, AreRefusedByTheScene) {
  const auto said = [](const std::string& step) {
    const LoadedScene loaded = scene_with(json::array({json::parse(step)}));
    const Scene<float> scene = assemble<float>(loaded);
    return complaint([&] { script_of(scene, loaded); });
  };
  EXPECT_TRUE(contains(
      said(R"({"time": 0, "changes": [{"vertex": 1}, {"vertex": 36}]})"),
      "p.json: scenes[0]: script: steps[0]: changes[1]: plan change for vertex 36 of a body with 36"));
  EXPECT_TRUE(contains(said(R"({"time": 0, "changes": [{"body": 2, "vertex": 1}]})"), "body 2 of 2"));
  EXPECT_TRUE(
      contains(said(R"({"time": 0, "changes": [{"body": "shirt", "vertex": 1}]})"), "no body 'shirt'"));
  EXPECT_TRUE(contains(said(R"({"time": -1, "changes": [{"vertex": 1}]})"), "time -1 is in the past"));
  EXPECT_TRUE(contains(said(R"({"time": 0, "changes": [{"vertex": 1, "velocity": [0, 1e31, 0]}]})"),
                       "outside the admissible range"));
}

TEST(Scripts, AreReplayedToThoseWhoCanTakeThem) {
  const LoadedScene loaded = scene_with(sound);
  const Scene<float> scene = assemble<float>(loaded);
  const PlanScript<float> script = script_of(scene, loaded);
  const auto frames = frames_of(scene, loaded, script, 4);
  Oracle<float> oracle(scene, {}, hash(script));
  std::vector<std::string> notes;
  const auto contestants =
      expand({{"bottom_up", {}, {}}, {"kinetic_aabb", {}, {}}, {"limit_moved_bytes", {}, {}}}, {}, {}, notes);
  Measurement<float> measurement(scene, frames, oracle, &script);
  std::vector<json> records;
  for (const ContestantSpec& spec : contestants) {
    const std::string why = unsuitable(spec.entry->info, scene, script);
    EXPECT_EQ(why, spec.entry->info.can.plan_changes ? "" : "cannot take changes of plans");
    EXPECT_EQ(unsuitable(spec.entry->info, scene), "");
    if (!why.empty()) continue;
    measurement.add(spec, 1);
    const std::size_t i = measurement.size() - 1;
    ASSERT_TRUE(measurement.timed(i)) << measurement[i].refused;
    measurement.play(i);
    measurement.play(i);
    const json about = scene_record(scene, loaded, 4, std::span<const double>(frames), script);
    EXPECT_EQ(about.at("script").at("changes"), 3);
    records.push_back({{"scene", about},
                       {"strategy", strategy_record(spec)},
                       {"verified", verified_record(measurement[i])},
                       {"times", times_record(measurement[i])}});
    double changes = 0;
    for (const PhaseTimes& frame : measurement[i].repetitions[1].frames) changes += frame.plan_changes;
    EXPECT_GT(changes, 0);
    // The driver's own part of a change counts as motion: nothing else evaluates positions while a script is
    // followed.
    Session<float> session(scene, spec.contestant());
    session.reset(frames[0]);
    PhaseTimes times;
    follow(session, &script.steps[0], times);
    EXPECT_GT(times.motion, 0);
  }
  ASSERT_EQ(records.size(), 2u);
  const std::string table = results_table(records);
  EXPECT_TRUE(contains(table, "3 changes at 2 frames"));
  EXPECT_TRUE(contains(table, "plans"));
}

TEST(Scripts, ArePartOfAConfigurationsKey) {
  const LoadedScene loaded = scene_with(sound);
  const Scene<float> scene = assemble<float>(loaded);
  const std::vector<double> frames{0, 1};
  json about = scene_record(scene, loaded, 4, std::span<const double>(frames));
  std::vector<std::string> notes;
  const auto spec = expand({{"bottom_up", {}, {}}}, {}, {}, notes).at(0);
  const json machine{{"cpu", ""}, {"compiler", ""}, {"flags", ""}, {"build_type", ""}, {"kernels", ""}};
  const auto key = [&] { return configuration_key("p", about, strategy_record(spec), Study{}, machine); };
  const std::string without = key();
  about["script"] = script_record(script_of(scene, loaded), 1);
  EXPECT_NE(key(), without);
}

}  // namespace
}  // namespace kbvh::experiments::scripts_test
