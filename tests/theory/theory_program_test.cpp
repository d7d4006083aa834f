// `kbvh theory` from a shell's point of view: the run of CI, its table and its file.
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <nlohmann/json.hpp>

namespace {

using nlohmann::json;
namespace fs = std::filesystem;

std::string text_of(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

class TheoryProgram : public testing::Test {
 protected:
  void SetUp() override {
    std::string name = (fs::temp_directory_path() / "kbvh-theory-XXXXXX").string();
    ASSERT_NE(::mkdtemp(name.data()), nullptr);
    folder_ = name;
  }
  void TearDown() override { fs::remove_all(folder_); }
  /// Returns its exit code; its output is in `out` and `err`.
  int kbvh(const std::string& arguments) {
    const std::string command = "cd '" + folder_.string() +
                                "' && KBVH_CACHE=cache '" KBVH_PROGRAM "' theory " + arguments +
                                " >out.txt 2>err.txt";
    const int status = std::system(command.c_str());
    out = text_of(folder_ / "out.txt");
    err = text_of(folder_ / "err.txt");
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }
  fs::path folder_;
  std::string out, err;
};

TEST_F(TheoryProgram, QuickDecidesWhatItMeasures) {
  ASSERT_EQ(kbvh("--quick --out results"), 0) << err;
  const json report = json::parse(text_of(folder_ / "results" / "theory.json"));
  EXPECT_EQ(report.at("schema"), "kbvh-theory-1");
  for (const char* key : {"commit", "dirty", "scalar", "options", "counts", "fits", "frames", "notes"})
    EXPECT_TRUE(report.contains(key)) << key;
  EXPECT_GE(report.at("fits").size(), 3u);
  const std::map<std::string, std::string> expected{{"T1", "holds"},
                                                    {"T2", "holds"},
                                                    {"T3", "holds"},
                                                    {"T4", "holds with a condition"},
                                                    {"T7", "holds"},
                                                    {"T8", "holds with a condition"},
                                                    {"T9", "holds with a condition"},
                                                    {"T10", "holds with a condition"},
                                                    {"T11", "holds with a condition"},
                                                    {"T12", "holds"},
                                                    {"T15", "holds with a condition"},
                                                    {"T16", "does not hold"}};
  // The paper's theory, and what its last section proposes.
  ASSERT_EQ(report.at("claims").size(), 20u);
  for (std::size_t i = 0; i < 20; ++i) {
    const json& claim = report.at("claims")[i];
    const std::string id = claim.at("id");
    EXPECT_EQ(id, i < 16 ? "T" + std::to_string(i + 1) : "C" + std::to_string(i - 15));
    for (const char* key : {"claim", "statement", "citation", "counter", "bound", "measured", "verdict",
                            "condition", "why", "criteria", "data"})
      EXPECT_TRUE(claim.contains(key)) << id << " " << key;
    EXPECT_FALSE(claim.at("why").get<std::string>().empty()) << id;
    for (const json& criterion : claim.at("criteria"))
      for (const char* key : {"what", "measured", "relation", "bound", "tolerance", "role", "met"})
        EXPECT_TRUE(criterion.contains(key)) << id << " " << key;
    EXPECT_EQ(claim.at("criteria").empty(), claim.at("verdict") == "not decided here") << id;
    if (expected.contains(id)) {
      EXPECT_EQ(claim.at("verdict"), expected.at(id)) << claim.at("why");
    }
    if (i < 15) {
      EXPECT_NE(claim.at("verdict"), "does not hold") << claim.at("why");
    } else if (i > 15) {
      EXPECT_NE(claim.at("verdict"), "not decided here") << claim.at("why");
    }
    EXPECT_NE(out.find(id + " "), std::string::npos) << id;
  }
  for (const char* name : {"events-n", "events-l", "certificates", "steps"})
    for (const char* kind : {".png", ".pdf"})
      EXPECT_TRUE(fs::exists(folder_ / "results" / "figures" / (std::string("theory-") + name + kind)))
          << name;
  std::size_t begin = 0;
  for (std::size_t end; (end = out.find('\n', begin)) != std::string::npos; begin = end + 1)
    EXPECT_LE(end - begin, 120u) << out.substr(begin, end - begin);
}

TEST_F(TheoryProgram, GoesOnWhereItWasStopped) {
  const std::string tiny =
      "--scenes waving_sheet --sizes 60,100 --keyframes 5 --instants 5 --no-figures --out results";
  ASSERT_EQ(kbvh(tiny), 0) << err;
  const std::string table = out, records = text_of(folder_ / "results" / "theory.jsonl");
  const json report = json::parse(text_of(folder_ / "results" / "theory.json"));
  ASSERT_EQ(kbvh(tiny), 0) << err;
  EXPECT_EQ(out, table);
  EXPECT_EQ(json::parse(text_of(folder_ / "results" / "theory.json")), report);
  const auto lines = [](const std::string& text) { return std::count(text.begin(), text.end(), '{'); };
  EXPECT_EQ(lines(text_of(folder_ / "results" / "theory.jsonl")), lines(records));
}

TEST_F(TheoryProgram, WrongUseIsCodeTwoAndOneSentence) {
  std::ofstream(folder_ / "file") << "x";
  for (const char* arguments : {"--scenes nowhere --sizes 50", "--sizes many", "--sizes 0", "--keyframes 1",
                                "--quick --full", "--scenes waving_sheet --sizes 50 --out file/x"}) {
    EXPECT_EQ(kbvh(arguments), 2) << arguments << "\n" << err;
    EXPECT_EQ(std::count(err.begin(), err.end(), '\n'), 1) << arguments << "\n" << err;
    EXPECT_EQ(out, "") << arguments;
  }
}

}  // namespace
