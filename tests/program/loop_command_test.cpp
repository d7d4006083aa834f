// `kbvh loop` as a shell sees it: exit codes, files, a run that is killed, and a replay.
#include <algorithm>
#include <map>
#include <set>

#include "binary.hpp"
#include "experiments/cli/loop_runs.hpp"
#include "experiments/results/table.hpp"

namespace kbvh::experiments::loop_command_test {
namespace {

const std::string cloth = "loop --scene sphere --triangles 100 ";

std::size_t longest_line_of(const std::string& out) {
  std::size_t longest = 0, begin = 0;
  for (std::size_t end = out.find('\n'); end != std::string::npos;
       begin = end + 1, end = out.find('\n', begin))
    longest = std::max(longest, end - begin);
  return longest;
}

TEST_F(Binary, LoopRunsRecordsAndReplays) {
  const Outcome run = kbvh(cloth + "--steps 12 --record --frames 6 --out out");
  EXPECT_EQ(run.code, 0) << run.err;
  EXPECT_NE(run.out.find("penetrations"), std::string::npos) << run.out;
  const std::vector<json> lines = records("out/loop.jsonl");
  ASSERT_EQ(lines.size(), 13u);
  EXPECT_EQ(lines[0].at("schema"), "kbvh-loop-1");
  EXPECT_EQ(lines[0].at("options").at("scene"), "sphere");
  EXPECT_EQ(lines[12].at("step"), 12);
  EXPECT_GT(lines[12].at("resident_bytes").get<double>(), 1e6);
  EXPECT_NE(run.out.find("memory, MB"), std::string::npos) << run.out;
  for (const char* key :
       {"time_s",    "ending",     "iterates",        "evaluations",    "questions",
        "searches",  "candidates", "contacts",        "smallest_gap_m", "penetrations",
        "detect_ms", "impact_ms",  "rest_ms",         "kinetic_j",      "gravitational_j",
        "elastic_j", "barrier_j",  "momentum_kg_m_s", "memory_bytes",   "peak_resident_bytes",
        "state",     "orders",     "lag_m",           "resident_bytes"})
    EXPECT_TRUE(lines[12].contains(key)) << key;
  EXPECT_TRUE(std::filesystem::exists(folder_ / "out" / "frames" / "frame_000012.obj"));

  const Outcome play = kbvh("loop --play out/loop.recording --truth-every 5");
  EXPECT_EQ(play.code, 0) << play.err;
  for (const char* word : {"near", "swept", "impact", "rebuild", "kept, 0.5 radii"})
    EXPECT_NE(play.out.find(word), std::string::npos) << word << "\n" << play.out;

  // Played to strategies, which know no exact distances.
  const std::string to_strategies = "loop --play out/loop.recording --strategies broad_phase,bottom_up,lbvh";
  const Outcome answered = kbvh(to_strategies);
  EXPECT_EQ(answered.code, 0) << answered.err;
  for (const char* word : {"swept", "impact", "refit", "bottom_up", "lbvh"})
    EXPECT_NE(answered.out.find(word), std::string::npos) << word << "\n" << answered.out;
  EXPECT_EQ(answered.out.find("near"), std::string::npos) << answered.out;
  EXPECT_EQ(kbvh(to_strategies + " --lose 1").code, 1);
  const Outcome unsuitable = kbvh("loop --play out/loop.recording --strategies kinetic_aabb");
  EXPECT_EQ(unsuitable.code, 2) << unsuitable.err;
  EXPECT_NE(unsuitable.err.find("--clip writes the iterates for `kbvh run`"), std::string::npos)
      << unsuitable.err;

  const Outcome clip = kbvh("loop --play out/loop.recording --clip iterates --iterates 9");
  EXPECT_EQ(clip.code, 0) << clip.err;
  EXPECT_NE(clip.out.find("9 iterates"), std::string::npos) << clip.out;
  const Outcome compared = kbvh(
      "run --body iterates/iterates.obj,motion=iterates/iterates.pc2 --self --l 1 --repetitions 1 "
      "--strategies bottom_up,front --out clip");
  EXPECT_EQ(compared.code, 0) << compared.err;
  const std::vector<json> contestants = records("clip/results.jsonl");
  ASSERT_EQ(contestants.size(), 2u);
  EXPECT_EQ(contestants[0].at("scene").at("frames"), 9);

  for (const std::string& out : {run.out, play.out, answered.out, clip.out})
    EXPECT_LE(longest_line_of(out), 110u) << out;
}

TEST_F(Binary, LoopComparesStrategies) {
  const Outcome run = kbvh(cloth + "--steps 20 --strategies broad_phase,bottom_up,lbvh --out out");
  EXPECT_EQ(run.code, 0) << run.err;
  for (const char* word : {"of sphere", "over refit", "states", "broad_phase", "bottom_up", "lbvh", "equal"})
    EXPECT_NE(run.out.find(word), std::string::npos) << word << "\n" << run.out;
  EXPECT_EQ(run.out.find("differ at"), std::string::npos) << run.out;
  EXPECT_LE(longest_line_of(run.out), longest_line) << run.out;
  const std::vector<json> own = records("out/broad_phase/loop.jsonl");
  ASSERT_EQ(own.size(), 21u);
  EXPECT_TRUE(own[0].at("options").at("strategy").is_null());
  EXPECT_EQ(own[0].at("options").at("detection"), "refit");
  for (const std::string& strategy : {std::string("bottom_up"), std::string("lbvh")}) {
    const std::vector<json> found = records("out/" + strategy + "/loop.jsonl");
    ASSERT_EQ(found.size(), 21u);
    EXPECT_EQ(found[0].at("options").at("strategy"), strategy);
    EXPECT_EQ(found[0].at("baseline"), strategy == "bottom_up");
    EXPECT_EQ(found[0].at("exact"), true);
    for (std::size_t i = 1; i < found.size(); ++i)
      for (const char* key : {"state", "candidates", "questions", "penetrations"})
        EXPECT_EQ(found[i].at(key), own[i].at(key)) << strategy << i << key;
  }

  // One alone, with a parameter, writes to the folder itself; the same command has nothing left to do.
  const std::string one = cloth + "--steps 3 --strategies bottom_up --param threads=1 --out one";
  for (int i = 0; i < 2; ++i) {
    const Outcome alone = kbvh(one);
    EXPECT_EQ(alone.code, 0) << alone.err;
    EXPECT_NE(alone.out.find("pairs found by"), std::string::npos) << alone.out;
  }
  EXPECT_EQ(records("one/loop.jsonl").size(), 4u);

  const Outcome lost = kbvh(cloth + "--steps 40 --strategies bottom_up,lbvh --lose 1");
  EXPECT_EQ(lost.code, 1) << lost.out;
  EXPECT_NE(lost.err.find("lbvh: "), std::string::npos) << lost.err;
  EXPECT_NE(lost.err.find("penetrated"), std::string::npos) << lost.err;

  // Of a family, those that do not suit are left out, with a reason.
  const Outcome family = kbvh(cloth + "--steps 2 --strategies 'bottom_up,family:kinetic'");
  EXPECT_EQ(family.code, 0) << family.err;
  EXPECT_NE(family.err.find("needs to know the motion in advance"), std::string::npos) << family.err;
}

TEST_F(Binary, LoopRunsTheSimulationsOfAPlan) {
  write_text(folder_ / "plan.json", R"({"name": "p", "scenes": "turning_box", "live": [
    {"name": "cloth, small", "scene": "sphere", "triangles": 100, "steps": 3, "strategies": ["dirty_refit", "bottom_up"]},
    {"scene": "sheets", "triangles": 60, "steps": 2}]})");
  const Outcome run = kbvh("loop --plan plan.json --out live");
  EXPECT_EQ(run.code, 0) << run.err;
  EXPECT_NE(run.out.find("of cloth, small"), std::string::npos) << run.out;
  EXPECT_NE(run.out.find("of sheets"), std::string::npos) << run.out;
  EXPECT_EQ(records("live/cloth-small/dirty_refit/loop.jsonl").size(), 4u);
  EXPECT_EQ(records("live/cloth-small/bottom_up/loop.jsonl").size(), 4u);
  EXPECT_EQ(records("live/sheets/loop.jsonl").size(), 3u);
  // Studies leave them alone.
  const Outcome jobs = kbvh("run --plan plan.json --list-jobs");
  EXPECT_EQ(jobs.code, 0) << jobs.err;
  EXPECT_EQ(jobs.out.find("sheets"), std::string::npos) << jobs.out;

  const std::map<std::string, std::string> wrong{
      {R"({"scenes": "turning_box"})", "has no simulations"},
      {R"({"live": []})", "live"},
      {R"({"live": [{"scene": "cube"}]})", "there is no scene 'cube'"},
      {R"({"live": [{"scenes": "sphere"}]})", "scenes"},
      {R"({"live": [{"steps": 0}]})", "steps"},
      {R"({"live": [{"strategies": ["kinetic_aabb"]}]})", "needs to know the motion in advance"},
      {R"({"live": [{"params": {"threads": 2}}]})", "threads"},
      {R"({"live": [{"scene": "knot"}, {"scene": "knot"}]})", "two simulations"}};
  for (const auto& [plan, part] : wrong) {
    write_text(folder_ / "wrong.json", plan);
    const Outcome outcome = kbvh("loop --plan wrong.json");
    EXPECT_EQ(outcome.code, 2) << plan << outcome.err;
    EXPECT_NE(outcome.err.find(part), std::string::npos) << plan << "\n" << outcome.err;
    EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
  }
}

TEST_F(Binary, LoopRunsAPlanInParts) {
  write_text(folder_ / "plan.json", R"({"name": "p", "scenes": "turning_box", "live": [
    {"name": "both", "scene": ["sphere", "cloths", "sphere"], "triangles": 60, "steps": 4,
     "strategies": ["broad_phase", "bottom_up"]},
    {"scene": "sheets", "triangles": 60, "steps": 2}]})");
  const auto lines = [&](const std::string& out, const std::string& folder) {
    return records(out + "/" + folder + "/loop.jsonl");
  };
  const std::string folders[] = {"both/sphere/broad_phase", "both/sphere/bottom_up",
                                 "both/cloths/broad_phase", "both/cloths/bottom_up"};
  // In no time, each makes a step; later the same command makes the others.
  const std::string both = "loop --plan plan.json --study both --out live";
  ASSERT_EQ(kbvh(both + " --seconds 0.001").code, 0);
  for (const std::string& folder : folders) EXPECT_GE(lines("live", folder).size(), 2u) << folder;
  const Outcome run = kbvh(both);
  EXPECT_EQ(run.code, 0) << run.err;
  EXPECT_NE(run.err.find("continued after step"), std::string::npos) << run.err;
  for (const char* word : {"of both, sphere", "of both, cloths", "first 4 steps", "of all", "equal"})
    EXPECT_NE(run.out.find(word), std::string::npos) << word << "\n" << run.out;
  for (const std::string& folder : folders) {
    const std::vector<json> found = lines("live", folder);
    ASSERT_EQ(found.size(), 5u) << folder;
    for (std::size_t i = 1; i < found.size(); ++i) EXPECT_EQ(found[i].at("step"), i) << folder;
  }
  EXPECT_FALSE(std::filesystem::exists(folder_ / "live" / "sheets"));
  // The sums are those of all steps, also where no step was left to make.
  const Outcome again = kbvh(both);
  EXPECT_EQ(again.out, run.out);

  ASSERT_EQ(kbvh("loop --plan plan.json --steps 1 --out short").code, 0);
  EXPECT_EQ(lines("short", "sheets").size(), 2u);
  EXPECT_EQ(lines("short", folders[3]).size(), 2u);
  const Outcome unknown = kbvh("loop --plan plan.json --study bot");
  EXPECT_EQ(unknown.code, 2);
  EXPECT_NE(unknown.err.find("did you mean 'both'?"), std::string::npos) << unknown.err;
}

TEST(LoopPlan, HasSimulationsOfEveryScene) {
  std::set<std::string> scenes;
  for (const LiveStudy& study : load_live_studies(std::string(KBVH_PLANS) + "/loop.json", {})) {
    scenes.insert(study.simulation.scene);
    EXPECT_GE(study.finders.size(), 10u) << study.title;
    EXPECT_EQ(study.finders.front().strategy.id, "");
    EXPECT_TRUE(std::any_of(study.finders.begin(), study.finders.end(), [](const LiveFinder& finder) {
      return finder.baseline;
    })) << study.title;
  }
  EXPECT_EQ(scenes.size(), loop::scene_names().size());
}

TEST_F(Binary, LoopTellsPenetrationsByItsExitCode) {
  const Outcome run = kbvh(cloth + "--steps 40 --lose 1");
  EXPECT_EQ(run.code, 1) << run.out;
  EXPECT_NE(run.err.find("penetrated"), std::string::npos) << run.err;
}

TEST_F(Binary, LoopGoesOnAfterItWasKilled) {
  ASSERT_EQ(kbvh(cloth + "--steps 40 --out whole").code, 0);
  const std::string run =
      std::string("'") + KBVH_PROGRAM + "' " + cloth + "--steps 40 --save-every 3 --out killed";
  // Killed as soon as some steps are written, if it has not ended by then.
  const Outcome killed = shell(run +
                               " & pid=$!\n"
                               "for i in $(seq 2000); do\n"
                               "  [ \"$(wc -l < killed/loop.jsonl 2>/dev/null || echo 0)\" -ge 8 ] && break\n"
                               "  sleep 0.01\n"
                               "done\n"
                               "kill -9 $pid; wait $pid; true");
  ASSERT_EQ(killed.code, 0) << killed.err;
  // save-every is not part of what the state depends on.
  const Outcome continued = shell(run);
  EXPECT_EQ(continued.code, 0) << continued.err;
  const std::vector<json> expected = records("whole/loop.jsonl"), found = records("killed/loop.jsonl");
  ASSERT_EQ(found.size(), 41u);
  ASSERT_EQ(expected.size(), 41u);
  for (std::size_t i = 1; i < found.size(); ++i)
    EXPECT_EQ(found[i].at("state"), expected[i].at("state")) << i;
}

TEST_F(Binary, LoopRefusesInOneSentence) {
  const std::map<std::string, std::string> cases{
      {"loop --scene cube", "there is no scene 'cube'"},
      {"loop --detect often", "there is no way to detect 'often'"},
      {"loop --record", "--record: needs --out"},
      {"loop --frames 3", "--frames: needs --out"},
      {"loop --play nothing", "nothing"},
      {"loop --play x --scene sphere", "--play"},
      {"loop --clip x", "--play"},
      {"loop --truth-every 3", "--play"},
      {"loop --strategies kinetic_aabb", "'kinetic_aabb' needs to know the motion in advance"},
      {"loop --strategies botom_up", "did you mean 'bottom_up'"},
      {"loop --strategies bottom_up --detect kept", "--detect"},
      {"loop --strategies bottom_up --param depth=2", "'depth'"},
      {"loop --param threads=2", "goes with --strategies"},
      {"loop --param threads", "expected key=value"},
      {"loop --plan nothing.json", "nothing.json"},
      {"loop --plan x --strategies bottom_up", "--strategies"},
      {"loop --study x", "--plan"},
      {"loop --play x --seconds 3", "--seconds"},
      {"loop --play x --clip y --strategies bottom_up", "--strategies"},
      {"loop --play x --strategies bottom_up", "--play"},
      {"loop --plan x --scene sphere", "--plan"}};
  for (const auto& [arguments, part] : cases) {
    const Outcome outcome = kbvh(arguments);
    EXPECT_EQ(outcome.code, 2) << arguments;
    EXPECT_NE(outcome.err.find(part), std::string::npos) << arguments << "\n" << outcome.err;
    EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
  }
  ASSERT_EQ(kbvh(cloth + "--steps 1 --out out").code, 0);
  EXPECT_EQ(kbvh(cloth + "--steps 2 --seed 2 --out out").code, 2);
  EXPECT_EQ(kbvh(cloth + "--steps 2 --out out").code, 0);
}

}  // namespace
}  // namespace kbvh::experiments::loop_command_test
