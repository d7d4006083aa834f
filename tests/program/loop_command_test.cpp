// `kbvh loop` as a shell sees it: exit codes, files, a run that is killed, and a replay.
#include <algorithm>
#include <map>

#include "binary.hpp"

namespace kbvh::experiments::loop_command_test {
namespace {

const std::string cloth = "loop --scene sphere --triangles 100 ";

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

  for (const std::string& out : {run.out, play.out, clip.out}) {
    std::size_t longest = 0, begin = 0;
    for (std::size_t end = out.find('\n'); end != std::string::npos;
         begin = end + 1, end = out.find('\n', begin))
      longest = std::max(longest, end - begin);
    EXPECT_LE(longest, 110u) << out;
  }
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
  const std::map<std::string, std::string> cases{{"loop --scene cube", "there is no scene 'cube'"},
                                                 {"loop --detect often", "there is no way to detect 'often'"},
                                                 {"loop --record", "--record: needs --out"},
                                                 {"loop --frames 3", "--frames: needs --out"},
                                                 {"loop --play nothing", "nothing"},
                                                 {"loop --play x --scene sphere", "--play"},
                                                 {"loop --clip x", "--play"},
                                                 {"loop --truth-every 3", "--play"}};
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
