// The kbvh binary from a shell's point of view: exit codes, and which output goes where.
#include "binary.hpp"
#include "core/contract/registry.hpp"

namespace kbvh::experiments::binary_test {
namespace {

TEST_F(Binary, HelpHasExamples) {
  for (const char* command :
       {"list", "run", "bench", "report", "scene", "theory", "loop", "lab", "ccd", "data"}) {
    const Outcome help = kbvh(std::string(command) + " --help");
    EXPECT_EQ(help.code, 0);
    EXPECT_NE(help.out.find("Example"), std::string::npos) << command;
    EXPECT_NE(help.out.find(std::string("kbvh ") + command), std::string::npos) << command;
  }
  EXPECT_EQ(kbvh("--help").code, 0);
  EXPECT_EQ(kbvh("--version").code, 0);
}

TEST_F(Binary, WrongUseIsCodeTwoAndOneSentence) {
  write_text(folder_ / "plan.json", R"({"scenes": "tablecloth", "repetition": 3})");
  write_text(folder_ / "broken.json", "{");
  write_text(folder_ / "bad.obj", "v 0 0 0\nv 1 0 0\nv 0 1 nan\nf 1 2 3\n");
  write_text(folder_ / "file", "x");
  const std::pair<std::string, std::string> cases[] = {
      {"", "a command is missing"},
      {"fly", "fly"},
      {"run --triangles many", "many"},
      {"run --l 0", "l: expected a whole number"},
      {"run --scene nowhere", "there is no built-in scene 'nowhere'"},
      {"run --strategies nobody", "there is no strategy 'nobody'"},
      {"run --param speed=3", "'speed' belongs to none"},
      {"run --param speed", "expected key=value"},
      {"run --width 3", "expected 2, 4 or 8"},
      {"run --leaf-size 17", "from 1 to 16"},
      {"run --builder magic", "magic"},
      {"run --scalar half", "half"},
      {"run --order sideways", "sideways"},
      {"run --scene tablecloth --body sphere", "exclude"},
      {"run --body sphere:triangles=20 --triangles 30", "triangles"},
      {"run --body missing.obj --body sphere", "missing.obj"},
      {"run --body bad.obj --body sphere", "bad.obj"},
      {"run --body sphere:size=3", "'size'"},
      {"run --body sphere:triangles=20,self=perhaps", "self: expected true or false"},
      {"run --scene tablecloth --strategies kinetic_aabb --continuous --l 1,2 --plan plan.json", "--plan"},
      {"ccd nowhere.csv", "nowhere.csv"},
      {"ccd plan.json", "plan.json"},
      {"run --plan missing.json", "missing.json"},
      {"run --plan plan.json", "plan.json: there is no key 'repetition'"},
      {"run --plan broken.json", "broken.json: line 1"},
      {"run --plan plan.json --l 3", "--l"},
      {"run " + tiny + "--out file/out", "file/out"},
      {"report --out nowhere", "nowhere/results.jsonl"},
      {"report", "--out"},
  };
  for (const auto& [arguments, part] : cases) {
    const Outcome outcome = kbvh(arguments);
    EXPECT_EQ(outcome.code, 2) << arguments << "\n" << outcome.err;
    EXPECT_NE(outcome.err.find(part), std::string::npos) << arguments << "\n" << outcome.err;
    EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << arguments << "\n"
                                                                           << outcome.err;
    EXPECT_EQ(outcome.out, "") << arguments;
  }
}

TEST_F(Binary, DecidesQueriesOfContinuousCollision) {
  std::filesystem::create_directories(folder_ / "vertex-face");
  // One vertex falls through a face, from 1 to -1, and another one next to it.
  std::string text;
  for (const bool hits : {true, false}) {
    const std::string x = hits ? "1,4" : "5,4", verdict = hits ? ",1\n" : ",0\n";
    for (const char* z : {"1,1", "-1,1"})
      text += x + ",1,4," + z + verdict + "0,1,0,1,0,1" + verdict + "1,1,0,1,0,1" + verdict + "0,1,1,1,0,1" +
              verdict;
  }
  write_text(folder_ / "vertex-face" / "data.csv", text);
  const Outcome right = kbvh("ccd . --seconds 0 --out out");
  EXPECT_EQ(right.code, 0) << right.err;
  const json all = json::parse(text_of_file(folder_ / "out" / "ccd.json"));
  ASSERT_EQ(all.at("files").size(), 1u);
  EXPECT_EQ(all.at("files")[0].at("queries"), 2);
  EXPECT_EQ(all.at("files")[0].at("positives"), 1);
  // A wrong verdict is detected.
  text.replace(text.find(",1\n"), 3, ",0\n");
  for (std::size_t at = 0; (at = text.find(",1\n", at)) != std::string::npos;) text.replace(at, 3, ",0\n");
  write_text(folder_ / "vertex-face" / "data.csv", text);
  const Outcome wrong = kbvh("ccd . --seconds 0");
  EXPECT_EQ(wrong.code, 1);
  EXPECT_NE(wrong.err.find("1 verdict"), std::string::npos) << wrong.err;
}

TEST_F(Binary, ListsEveryStrategy) {
  const Outcome text = kbvh("list");
  const Outcome as_json = kbvh("list --json");
  EXPECT_EQ(text.code, 0);
  EXPECT_EQ(as_json.code, 0);
  const json all = json::parse(as_json.out);
  ASSERT_EQ(all.at("strategies").size(), registry().size());
  for (std::size_t i = 0; i < registry().size(); ++i) {
    EXPECT_EQ(all.at("strategies")[i].at("id"), registry()[i].info.id);
    EXPECT_NE(text.out.find(registry()[i].info.title), std::string::npos);
  }
  EXPECT_NE(text.out.find("tablecloth"), std::string::npos);
}

TEST_F(Binary, ShowsAndExportsAScene) {
  const Outcome outcome = kbvh("scene passing_spheres --triangles 80 --keyframes 4 --json --out meshes");
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const json scene = json::parse(outcome.out);
  ASSERT_EQ(scene.at("bodies").size(), 2u);
  for (const json& body : scene.at("bodies")) {
    EXPECT_EQ(body.at("primitives"), 80u);
    EXPECT_EQ(body.at("keyframes"), 4u);
    EXPECT_EQ(body.at("nodes"), 159u);
  }
  for (const char* file :
       {"0-icosphere-80.obj", "0-icosphere-80.pc2", "1-icosphere-80.obj", "1-icosphere-80.pc2"})
    EXPECT_TRUE(std::filesystem::exists(folder_ / "meshes" / file)) << file;
  EXPECT_EQ(kbvh("scene passing_spheres --triangles 80 --keyframes 4 --frame 3 --out last.obj").code, 0);
  const std::string text = text_of_file(folder_ / "last.obj");
  std::size_t faces = 0;
  for (std::size_t at = text.find("\nf "); at != std::string::npos; at = text.find("\nf ", at + 1)) ++faces;
  EXPECT_EQ(faces, 160u);
  for (const char* out : {"thrown", "thrown.json"}) {
    const Outcome thrown = kbvh(std::string("scene thrown_cloth --triangles 50 --keyframes 3 --out ") + out);
    EXPECT_EQ(thrown.code, 0) << thrown.err;
    EXPECT_NE(thrown.err.find("curves between keyframes, which '" + std::string(out) + "' does not hold"),
              std::string::npos)
        << thrown.err;
  }
  EXPECT_EQ(kbvh("scene nowhere").code, 2);
}

TEST_F(Binary, WorksWithoutACache) {
  write_text(folder_ / "file", "x");
  const Outcome run =
      kbvh("run " + tiny + "--strategies bottom_up", "KBVH_CACHE='" + (folder_ / "file/x").string() + "'");
  EXPECT_EQ(run.code, 0);
  EXPECT_NE(run.err.find("warning: the cache folder"), std::string::npos) << run.err;
}

TEST_F(Binary, NothingMovesAndNothingMeets) {
  const Outcome run =
      kbvh("run --body box:triangles=12 --body sphere:triangles=20,centre=9:0:0 --strategies default");
  EXPECT_EQ(run.code, 0) << run.err;
  EXPECT_NE(run.out.find("1 frame,"), std::string::npos) << run.out;
  const Outcome alone = kbvh("run --body sphere:triangles=20,step=0:0:0.1,keyframes=3 --strategies default");
  EXPECT_EQ(alone.code, 0) << alone.err;
}

}  // namespace
}  // namespace kbvh::experiments::binary_test
