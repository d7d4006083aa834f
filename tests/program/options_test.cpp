// Options of every subcommand: wrong ones are refused in one sentence.
#include <cstdlib>
#include <map>
#include <sstream>

#include "binary.hpp"
#include "experiments/cli/program.hpp"

namespace kbvh::experiments::options_test {
namespace {

/// The values that an option takes, and those that it must refuse.
enum class Kind {
  number,  ///< whole numbers, lists of them, or a time: all nonsense
  names,   ///< words or files that must exist: all nonsense
  free,    ///< any folder or name: only empty, forgotten and repeated values
  several  ///< may be repeated: only empty and forgotten values
};

struct Option {
  std::string name;
  Kind kind;
  std::string right;  ///< a valid value
};

const std::vector<Option> study_options{{"--scene", Kind::names, "turning_box"},
                                        {"--body", Kind::several, "sphere"},
                                        {"--clip", Kind::names, "Run"},
                                        {"--name", Kind::free, "mine"},
                                        {"--triangles", Kind::number, "20"},
                                        {"--obstacle", Kind::number, "20"},
                                        {"--keyframes", Kind::number, "3"},
                                        {"--seed", Kind::number, "1"},
                                        {"--script", Kind::names, "script"},
                                        {"--pairs", Kind::names, "points:cloth"},
                                        {"--radius", Kind::number, "0.1"},
                                        {"--order", Kind::names, "given"},
                                        {"--strategies", Kind::names, "all"},
                                        {"--param", Kind::names, "threads=1"},
                                        {"--builder", Kind::names, "sah"},
                                        {"--width", Kind::number, "8"},
                                        {"--leaf-size", Kind::number, "4"},
                                        {"--l", Kind::number, "10"},
                                        {"--scalar", Kind::names, "float"},
                                        {"--repetitions", Kind::number, "3"},
                                        {"--interval-width", Kind::number, "0.5"},
                                        {"--seconds", Kind::number, "3"},
                                        {"--changes", Kind::names, "pairs"},
                                        {"--rays", Kind::names, "coherent:100"},
                                        {"--within", Kind::names, "10:0.1"},
                                        {"--kernels", Kind::names, "portable"},
                                        {"--frames-limit", Kind::number, "3"},
                                        {"--oracle-every", Kind::number, "3"},
                                        {"--out", Kind::free, "out"},
                                        {"--plan", Kind::names, "plan.json"},
                                        {"--study", Kind::several, "small"}};

/// The additional options of `run`, for engines that use many machines.
std::vector<Option> run_options() {
  std::vector<Option> options = study_options;
  options.push_back({"--job", Kind::free, "job"});
  options.push_back({"--prepare", Kind::free, "scene"});
  return options;
}

const std::map<std::string, std::vector<Option>> all_options{
    {"list", {}},
    {"run", run_options()},
    {"bench", run_options()},
    {"report", {{"--out", Kind::free, "out"}, {"--title", Kind::free, "mine"}}},
    {"scene",
     {{"--triangles", Kind::number, "20"},
      {"--obstacle", Kind::number, "20"},
      {"--keyframes", Kind::number, "3"},
      {"--seed", Kind::number, "1"},
      {"--full-triangles", Kind::number, "20"},
      {"--frame", Kind::number, "1"},
      {"--out", Kind::free, "out"}}},
    {"theory",
     {{"--scenes", Kind::names, "turning_box"},
      {"--sizes", Kind::number, "20"},
      {"--keyframes", Kind::number, "3"},
      {"--exact-limit", Kind::number, "20"},
      {"--instants", Kind::number, "20"},
      {"--out", Kind::free, "out"}}},
    {"stress",
     {{"--strategies", Kind::names, "all"},
      {"--families", Kind::names, "tiny"},
      {"--scenes", Kind::number, "1"},
      {"--seed", Kind::number, "1"},
      {"--scalars", Kind::names, "float"},
      {"--l", Kind::number, "1"},
      {"--param", Kind::several, "threads=1"},
      {"--many-keyframes", Kind::number, "100"},
      {"--seconds", Kind::number, "1"},
      {"--repro", Kind::names, "repro.json"},
      {"--out", Kind::free, "out"}}},
    {"loop",
     {{"--scene", Kind::names, "sphere"},
      {"--triangles", Kind::number, "20"},
      {"--seed", Kind::number, "1"},
      {"--steps", Kind::number, "1"},
      {"--detect", Kind::names, "refit"},
      {"--strategies", Kind::names, "bottom_up"},
      {"--param", Kind::names, "threads=1"},
      {"--plan", Kind::names, "plan.json"},
      {"--keep", Kind::number, "1"},
      {"--save-every", Kind::number, "1"},
      {"--seconds", Kind::number, "1"},
      {"--study", Kind::several, "small"},
      {"--lose", Kind::number, "1"},
      {"--frames", Kind::number, "1"},
      {"--play", Kind::names, "loop.recording"},
      {"--truth-every", Kind::number, "1"},
      {"--iterates", Kind::number, "1"},
      {"--clip", Kind::free, "out"},
      {"--out", Kind::free, "out"}}},
    {"lab",
     {{"--port", Kind::number, "0"}, {"--folder", Kind::names, "lab"}, {"--study", Kind::names, "out"}}},
    {"ccd", {{"--seconds", Kind::number, "1"}, {"--out", Kind::free, "out"}}},
    {"data", {{"--only", Kind::free, "cloth"}}}};

const std::vector<std::string> nonsense{"-1",
                                        "99999999999999999999999999",
                                        "1e30",
                                        "-1e-30",
                                        "nan",
                                        "inf",
                                        "-inf",
                                        "abc",
                                        "0x10",
                                        " 3",
                                        "3 ",
                                        "+3",
                                        "1,,2",
                                        ",",
                                        "{}",
                                        "3;4",
                                        "\x1b[31m",
                                        "a\nb",
                                        "\xc3\xa9",
                                        std::string(1000, '9'),
                                        std::string(1000, 'x')};

/// Runs the program inside of this process, in its own folder: a thousand starts of the binary would take
/// minutes.
class Options : public Binary {
 protected:
  void SetUp() override {
    before_ = std::filesystem::current_path();
    std::filesystem::current_path(folder_.path());
    ::setenv("KBVH_CACHE", (folder_ / "cache").c_str(), 1);
  }
  void TearDown() override { std::filesystem::current_path(before_); }

  Outcome called(const std::vector<std::string>& words) {
    std::vector<const char*> arguments{"kbvh"};
    for (const std::string& word : words) arguments.push_back(word.c_str());
    arguments.push_back(nullptr);
    testing::internal::CaptureStdout();
    testing::internal::CaptureStderr();
    const int code = run_program(int(arguments.size()) - 1, arguments.data());
    std::string err = testing::internal::GetCapturedStderr();
    return {code, testing::internal::GetCapturedStdout(), err};
  }

  /// Expects exit code 2, and one short sentence that names the option, by its own name or its key in plans,
  /// and the value.
  void refused(const std::vector<std::string>& words, const std::string& option, const std::string& value) {
    const Outcome outcome = called(words);
    std::string command = "kbvh";
    for (const std::string& word : words) command += " '" + word.substr(0, 50) + "'";
    const std::string& said = outcome.err;
    EXPECT_EQ(outcome.code, 2) << command << "\n" << said;
    EXPECT_EQ(outcome.out, "") << command;
    EXPECT_LE(said.size(), 301u) << command << "\n" << said;
    EXPECT_EQ(std::count(said.begin(), said.end(), '\n'), 1) << command << "\n" << said;
    EXPECT_EQ(said.find('\x1b'), std::string::npos) << command;
    EXPECT_EQ(said.find("internal error"), std::string::npos) << command << "\n" << said;
    // Values that would be shortened or replaced are searched by their second character.
    const bool plain = value.size() < 30 && value.find_first_of("\x1b\n\xc3") == std::string::npos;
    const bool named = said.find(plain ? value : value.substr(1, 1)) != std::string::npos;
    EXPECT_TRUE(named || said.find(R"('?)") != std::string::npos) << command << "\n" << said;
    std::string key = option.substr(option.find_first_not_of('-'));
    for (char& c : key) c = c == '-' ? '_' : c;
    if (key == "body" || key == "param" || key == "repro" || key == "plan" || key == "strategies") return;
    // Keys of plans may be singular or plural.
    if (key.size() > 4 && key.ends_with("ies")) key.resize(key.size() - 3);
    if (key.size() > 2 && key.ends_with("s")) key.resize(key.size() - 1);
    std::string text = said;
    for (char& c : text) c = c == '-' ? '_' : c;
    EXPECT_NE(text.find(key), std::string::npos) << command << "\n" << said;
  }

  std::filesystem::path before_;
};

TEST_F(Options, TableHasAll) {
  for (const auto& [command, options] : all_options) {
    std::istringstream help(called({command, "--help"}).out);
    for (std::string line; std::getline(help, line);) {
      const std::size_t at = line.find("--");
      // Flags have no type after their name.
      if (!line.starts_with("  --") || line.find(" TEXT") == std::string::npos) {
        if (!line.starts_with("  --") ||
            (line.find(" UINT") == std::string::npos && line.find(" FLOAT") == std::string::npos))
          continue;
      }
      const std::string name = line.substr(at, line.find(' ', at) - at);
      EXPECT_TRUE(
          std::any_of(options.begin(), options.end(), [&](const Option& o) { return o.name == name; }))
          << "the option " << name << " of `kbvh " << command
          << "` is not tested: name it and its kind in study_options or all_options of this file";
    }
  }
}

TEST_F(Options, NonsenseIsRefusedInOneSentence) {
  for (const auto& [command, options] : all_options) {
    const std::string help = called({command, "--help"}).out;
    for (const Option& option : options) {
      std::vector<std::string> words{command};
      if (command == "scene") words.push_back("turning_box");
      if (option.name == "--study" && command != "lab") words.insert(words.end(), {"--plan", "plan.json"});
      if (command == "data") words.push_back("list");
      if (option.name == "--job" || option.name == "--prepare")
        words.insert(words.end(), {"--plan", "plan.json", "--out", "out"});
      const auto with = [&](const std::vector<std::string>& more) {
        std::vector<std::string> all = words;
        all.insert(all.end(), more.begin(), more.end());
        return all;
      };
      refused(with({option.name, ""}), option.name, "empty");
      refused(with({option.name + "="}), option.name, "empty");
      refused(with({option.name, "--help-me"}), option.name, "--help-me");
      // In lists, all occurrences count.
      const bool list = help.find(option.name + " TEXT ...") != std::string::npos ||
                        help.find(option.name + " UINT ...") != std::string::npos;
      if (!list && option.kind != Kind::several && option.name != "--param")
        refused(with({option.name, option.right, option.name, option.right}), option.name, option.right);
      if (option.kind == Kind::free || option.kind == Kind::several) continue;
      for (const std::string& value : nonsense) refused(with({option.name, value}), option.name, value);
      refused(with({option.name + "=-1"}), option.name, "-1");
    }
  }
}

TEST_F(Options, NumbersAreReadStrictly) {
  const std::pair<std::vector<std::string>, std::string> cases[] = {
      {{"run", "--repetitions", "0"},
       "--repetitions: expected a whole number from 1 to 10000, got '0' (try --help)"},
      {{"run", "--l", "-1"}, "--l: expected a whole number from 1 to 1000000, got '-1' (try --help)"},
      {{"run", "--seed", "-1"}, "--seed: expected a whole number from 0 to 2^64 - 1, got '-1' (try --help)"},
      {{"run", "--l", "1,,3"}, "--l: has an empty part between commas in '1,,3' (try --help)"},
      {{"run", "--width", "3"}, "command line: builder: width: expected 2, 4 or 8, got 3"},
      {{"ccd", "--seconds", "1e300"},
       "--seconds: expected a number from 0 to 3600, got '1e300' (try --help)"},
      {{"run", "--out", ""}, "--out: is empty, but needs a value (try --help)"},
      {{"run", "--plan", ""}, "--plan: is empty, but needs a value (try --help)"},
      {{"run", "--out", "--l", "3"}, "--out: needs a value, got the option '--l' (try --help)"},
      {{"run", "--body", "cloth.obj,motion="},
       "body 'cloth.obj,motion=': motion: is empty, but needs a value"},
      {{"--json", "list"}, "--json belongs behind the command, as in kbvh list --json"},
      {{"scene", "turning_box", "--full-triangles", "3"},
       "--full-triangles: is for shirt and dress, not for 'turning_box'"},
      {{"scene", "twisted_rod", "--obstacle", "3"}, "--obstacle: the scene 'twisted_rod' has one body"},
      {{"scene", "turning_box", "--frame", "3"},
       "--frame: goes with --out FILE.obj, which shows one keyframe"},
      {{"scene", "turning_box", "--triangles", "20", "--keyframes", "3", "--frame", "3", "--out", "a.obj"},
       "--frame: 3 is not before the end, the scene has 3 keyframes, from 0"}};
  for (const auto& [words, message] : cases) {
    const Outcome outcome = called(words);
    EXPECT_EQ(outcome.code, 2);
    EXPECT_EQ(outcome.err, "kbvh: " + message + "\n");
  }
  EXPECT_TRUE(std::filesystem::is_empty(folder_.path()));
  // Decimal, regardless of leading zeros, and up to the largest.
  const Outcome right =
      called({"run", "--print-plan", "--l", "010,2,10", "--l=3", "--seed", "18446744073709551615"});
  ASSERT_EQ(right.code, 0) << right.err;
  const json plan = json::parse(right.out);
  EXPECT_EQ(plan.at("l"), json({10, 2, 3}));
  EXPECT_EQ(plan.at("scenes")[0].at("seed"), json({~std::uint64_t(0)}));
}

TEST_F(Options, MisspeltNamesGetASuggestion) {
  write_text(folder_ / "plan.json", R"({"scenes": "turning_box", "repetition": 3})");
  write_text(folder_ / "params.json",
             R"({"scenes": "turning_box", "strategies": [{"id": "bottom_up", "params": {"thread": 1}}]})");
  const std::pair<std::vector<std::string>, std::string> cases[] = {
      {{"rn"}, "'run'"},
      {{"lst"}, "'list'"},
      {{"run", "--triangle", "3"}, "'--triangles'"},
      {{"run", "--strategy=bottom_up"}, "'--strategies'"},
      {{"theory", "--size", "3"}, "'--sizes'"},
      {{"run", "--leaf_size", "3"}, "'--leaf-size'"},
      {{"run", "--scene", "tableclot"}, "'tablecloth'"},
      {{"scene", "waving-sheet"}, "'waving_sheet'"},
      {{"theory", "--scenes", "turning_boxes"}, "'turning_box'"},
      {{"run", "--strategies", "botom_up"}, "'bottom_up'"},
      {{"run", "--strategies", "family:kinetik"}, "'kinetic'"},
      {{"stress", "--families", "spike"}, "'spikes'"},
      {{"stress", "--strategies", "kinetic_abb"}, "'kinetic_aabb'"},
      {{"run", "--strategies", "bottom_up", "--param", "thread=2"}, "'threads'"},
      {{"run", "--strategies", "bottom_up", "--param", "bottom_up.thread=2"}, "'threads'"},
      {{"run", "--plan", "params.json"}, "'threads'"},
      {{"run", "--plan", "plan.json"}, "'repetitions'"}};
  for (const auto& [words, name] : cases) {
    const Outcome outcome = called(words);
    EXPECT_EQ(outcome.code, 2);
    EXPECT_NE(outcome.err.find("did you mean " + name + "?"), std::string::npos) << outcome.err;
    EXPECT_LE(outcome.err.size(), 301u) << outcome.err;
  }
  EXPECT_EQ(called({"run", "--strategies", "nobody"}).err,
            "kbvh: there is no strategy 'nobody'; `kbvh list` shows them\n");
}

TEST_F(Options, ParametersAreRefusedBeforeAnythingIsMeasured) {
  const std::pair<std::string, std::string> cases[] = {
      {"interval_join.pieces=1.5",
       "'pieces' of 'interval_join' cannot be '1.5': it is a whole number from 1 to 64"},
      {"interval_join.horizon=1e7",
       "'horizon' of 'interval_join' cannot be '10000000': it is a number from 0 to 1024"},
      {"bottom_up.threads=2.5", "'threads' of 'bottom_up' cannot be '2.5': it is a whole number from 1 to"},
      {"bottom_up_budget.box_tests=1e300",
       "'box_tests' of 'bottom_up_budget' cannot be '1e+300': it is a whole number from 1 to 1e+15"},
      {"bottom_up_budget.box_tests=2.5",
       "'box_tests' of 'bottom_up_budget' cannot be '2.5': it is a whole number from 1 to 1e+15"},
      {"kinetic_boxtree.check_every=1e300",
       "'check_every' of 'kinetic_boxtree' cannot be '1e+300': it is a whole number from 1 to 1e+15"},
      {"bottom_up.threads=", "threads"},
      {"bottom_up.threads=nan", "'nan'"},
      {"bottom_up.threads=1e999", "'1e999'"}};
  for (const auto& [parameter, message] : cases) {
    const Outcome outcome =
        called({"run", "--scene", "turning_box", "--triangles", "20", "--keyframes", "3", "--strategies",
                "rebuild,interval_join,bottom_up,bottom_up_budget,kinetic_boxtree", "--param", parameter});
    EXPECT_EQ(outcome.code, 2) << parameter;
    EXPECT_EQ(outcome.out, "") << parameter;
    EXPECT_NE(outcome.err.find(message), std::string::npos) << outcome.err;
  }
}

TEST_F(Options, QueriesOfSeveralPathsAndOfFoldersThatHoldThemselves) {
  const std::string one =
      "1,4,1,4,1,1\n0,1,0,1,0,1\n1,1,0,1,0,1\n0,1,1,1,0,1\n1,4,1,4,-1,1\n0,1,0,1,0,1\n1,1,0,1,0,1\n0,1,1,1,0,"
      "1\n";
  std::filesystem::create_directories("all/vf");
  write_text("all/vf/one.csv", one);
  std::filesystem::create_directory_symlink("..", "all/vf/up");
  for (const auto& [paths, files] : std::vector<std::pair<std::vector<std::string>, std::size_t>>{
           {{"all"}, 1}, {{"all/vf/one.csv", "all"}, 2}}) {
    std::vector<std::string> words{"ccd", "--seconds", "0", "--out", "out"};
    words.insert(words.begin() + 1, paths.begin(), paths.end());
    const Outcome outcome = called(words);
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    EXPECT_EQ(json::parse(text_of_file("out/ccd.json")).at("files").size(), files) << outcome.err;
  }
  std::filesystem::remove("all/vf/up");
  std::filesystem::create_directory_symlink("nowhere", "all/vf/nowhere");
  EXPECT_EQ(called({"ccd", "all", "--seconds", "0"}).code, 0);
}

}  // namespace
}  // namespace kbvh::experiments::options_test
