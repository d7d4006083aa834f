// What the console says: no printed output gets lost, and scenes or commands that are not what was meant are
// named.
#include <cstdlib>

#include "binary.hpp"
#include "complaint.hpp"
#include "experiments/study/contestants.hpp"

namespace kbvh::experiments::console_test {
namespace {

const std::string clips = "--scene waving_sheet --triangles 100 --keyframes 3 --repetitions 1 ";

class StandardOutput : public Binary {
 protected:
  /// Runs the program with redirected standard output.
  Outcome to(const std::string& redirection, const std::string& arguments) {
    const std::string command = "cd '" + folder_.path().string() +
                                "' && ( KBVH_CACHE=cache '" KBVH_PROGRAM "' " + arguments +
                                "; echo $? >code ) 2>err " + redirection;
    EXPECT_EQ(std::system(command.c_str()), 0) << command;
    return {std::stoi(text_of_file(folder_ / "code")), "", text_of_file(folder_ / "err")};
  }
};

TEST_F(StandardOutput, AFullDiskIsNoticed) {
  std::filesystem::create_directories(folder_ / "vertex-face");
  write_text(folder_ / "vertex-face" / "data.csv",
             "1,4,1,4,1,1\n0,1,0,1,0,1\n1,1,0,1,0,1\n0,1,1,1,0,1\n"
             "1,4,1,4,-1,1\n0,1,0,1,0,1\n1,1,0,1,0,1\n0,1,1,1,0,1\n");
  // Shapes have a minimum number of triangles, so these sizes are one scene, whose growth cannot be fitted.
  const std::string small_theory =
      "theory --scenes turning_box,expanding_sphere --sizes 2,3,4,5,6,7 --keyframes 2";
  const std::string cases[] = {"--help",
                               "--version",
                               "run --help",
                               "list",
                               "list --json",
                               "run --print-plan",
                               "bench --print-plan",
                               "run " + tiny + "--strategies bottom_up --out out",
                               "bench " + tiny + "--strategies bottom_up",
                               "scene turning_box --triangles 20 --keyframes 2",
                               "scene turning_box --triangles 20 --keyframes 2 --json",
                               small_theory,
                               "stress --list",
                               "stress --scenes 1 --families tiny --strategies bottom_up --plain",
                               "ccd . --seconds 0"};
  for (const std::string& arguments : cases) {
    const Outcome outcome = to(">/dev/full", arguments);
    EXPECT_EQ(outcome.code, 3) << arguments;
    EXPECT_NE(outcome.err.find("kbvh: standard output cannot be written: No space left on device\n"),
              std::string::npos)
        << arguments << "\n"
        << outcome.err;
  }
  EXPECT_EQ(records().size(), 1u) << "what was measured is kept";
  const Outcome report = to(">/dev/full", "report --out out");
  EXPECT_EQ(report.code, 3) << report.err;
  EXPECT_NE(report.err.find("kbvh: standard output cannot be written"), std::string::npos) << report.err;
  EXPECT_EQ(report.err.find("Exception"), std::string::npos) << report.err;
  EXPECT_TRUE(std::filesystem::exists(folder_ / "out" / "report.html"));
}

TEST_F(StandardOutput, AClosedPipeLosesNothing) {
  const Outcome outcome = to("| true", "run " + clips + "--l 1,2,3 --strategies bottom_up --out out");
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(outcome.err.find("standard output"), std::string::npos) << outcome.err;
  EXPECT_EQ(records().size(), 3u);
}

TEST_F(StandardOutput, AClosedStreamIsNotAFileOfResults) {
  const Outcome outcome = to(">&-", "run " + clips + "--l 1,2 --strategies bottom_up --out out");
  EXPECT_EQ(outcome.code, 3) << outcome.err;
  EXPECT_NE(outcome.err.find("standard output cannot be written: Bad file descriptor"), std::string::npos)
      << outcome.err;
  EXPECT_EQ(records().size(), 2u);
  EXPECT_EQ(kbvh("run " + clips + "--l 1,2 --strategies bottom_up --out out").code, 0);
}

TEST_F(Binary, RaysMeetABodyAlone) {
  const Outcome rays =
      kbvh("run --body sphere:triangles=20 --rays coherent:100 --strategies bottom_up --repetitions 1");
  EXPECT_EQ(rays.code, 0);
  EXPECT_EQ(rays.err, "");
  EXPECT_TRUE(contains(unwrapped(rays.out), " true hits in 1 compared frame\n"));
}

TEST_F(Binary, AStatedRangeIsKeptAndListed) {
  const std::string program = KBVH_FAULTY_PROGRAM;
  const auto run = [&](const std::string& bodies) {
    return kbvh("run " + bodies + " --body sphere:triangles=20 --strategies honest,only_near --repetitions 1",
                "", program);
  };
  const Outcome within = run("--body sphere:triangles=20,translate=99:0:0");
  EXPECT_EQ(within.code, 0);
  EXPECT_EQ(within.err, "");
  const Outcome beyond = run("--body sphere:triangles=20,translate=101:0:0,name=ball");
  EXPECT_EQ(beyond.code, 0);
  EXPECT_NE(beyond.err.find(
                "only_near is left out of ball+icosphere-20: it takes coordinates up to 100, but vertex "),
            std::string::npos)
      << beyond.err;
  const Outcome later = run("--body sphere:triangles=20,keyframes=3,step=60:0:0,name=ball");
  EXPECT_NE(later.err.find("of body 'ball' is at x = "), std::string::npos) << later.err;
  EXPECT_NE(later.err.find(" at keyframe 2\n"), std::string::npos) << later.err;
  // By a change of plans, represented by a peer.
  if (known_strategy("fcl_float_own_verdict") != nullptr) {
    const auto with_script = [&](const std::string& velocity) {
      write_text(folder_ / "s.json",
                 R"({"steps": [{"time": 0, "changes": [{"body": 0, "vertex": 1, "velocity": [)" + velocity +
                     R"(, 0, 0]}]}]})");
      return kbvh(
                 "run --body sphere:triangles=20,keyframes=3,step=0.1:0:0,name=ball --body "
                 "sphere:triangles=20 "
                 "--script s.json --strategies bottom_up,fcl_float_own_verdict --repetitions 1")
          .err;
    };
    const std::string slow = with_script("1"), fast = with_script("1e12");
    EXPECT_EQ(slow.find("coordinates"), std::string::npos) << slow;
    EXPECT_NE(fast.find("it takes coordinates up to 1e+09, but vertex 1 of body 0 is at x = "),
              std::string::npos)
        << fast;
  }
  EXPECT_NE(
      kbvh("list", "", program).out.find("takes coordinates up to 100, and no scene that reaches beyond"),
      std::string::npos);
  const json list = json::parse(kbvh("list --json", "", program).out);
  for (const json& strategy : list.at("strategies"))
    EXPECT_EQ(strategy.at("max_coordinate"), strategy.at("id") == "only_near" ? json(100.0) : json(nullptr));
}

TEST_F(Binary, ASceneWithoutPairsSaysSo) {
  const Outcome alone =
      kbvh("run --body sphere:triangles=20,step=0:0:0.1,keyframes=3 --strategies bottom_up --repetitions 1");
  EXPECT_EQ(alone.code, 0);
  EXPECT_NE(alone.err.find("has one body, so there are no pairs of bodies, and nothing is found or compared"),
            std::string::npos)
      << alone.err;
  EXPECT_NE(alone.err.find("--self"), std::string::npos) << alone.err;
  const Outcome rests =
      kbvh("run --body sphere:triangles=20 --body box:triangles=12 --strategies bottom_up --repetitions 1");
  EXPECT_EQ(rests.err, "");
  const Outcome self = kbvh(
      "run --self --body sphere:triangles=20,step=0:0:0.1,keyframes=3 --strategies bottom_up --repetitions "
      "1");
  EXPECT_EQ(self.err, "");
}

// A newcomer's mistakes.

TEST_F(Binary, AMissingCommandIsSaid) {
  const Outcome none = kbvh("");
  EXPECT_EQ(none.code, 2);
  EXPECT_EQ(none.err.find("kbvh: a command is missing; known are list, run, bench, "), 0u) << none.err;
  const Outcome option = kbvh("--helb");
  EXPECT_EQ(option.code, 2);
  EXPECT_EQ(option.err, "kbvh: kbvh has no option '--helb'; did you mean '--help'? (try kbvh --help)\n");
}

TEST_F(Binary, AnOverlongListIsCutBetweenItsWords) {
  const Outcome outcome = kbvh("run --scene tablecoth");
  EXPECT_EQ(outcome.code, 2);
  const std::size_t cut = outcome.err.find(", ... ");
  ASSERT_NE(cut, std::string::npos) << outcome.err;
  const std::string after = outcome.err.substr(cut + 6);
  EXPECT_EQ(kbvh("scene " + after.substr(0, after.find(',')) + " --triangles 300 --keyframes 2").code, 0)
      << outcome.err;
  EXPECT_NE(outcome.err.find("did you mean 'tablecloth'?"), std::string::npos) << outcome.err;
}

TEST_F(Binary, AMeshWithoutPolygonsIsSaid) {
  write_text(folder_ / "cloud.obj", "v 0 0 0\nv 1 0 0\n");
  const std::string rest = " --body sphere:triangles=20 --strategies bottom_up --repetitions 1";
  EXPECT_EQ(
      kbvh("run --body cloud.obj" + rest).err,
      "kbvh: note: cloud.obj: has no polygons, only 2 points; pairs with them are overlaps of boxes, not "
      "intersections\n");
  EXPECT_EQ(kbvh("run --body cloud.obj,as=points" + rest).err,
            "kbvh: note: cloud.obj: 2 points; pairs with them are overlaps of boxes, not intersections\n");
}

}  // namespace
}  // namespace kbvh::experiments::console_test
