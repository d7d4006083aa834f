// Result files, keys, times and tables.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <map>

#include "complaint.hpp"
#include "experiments/results/record.hpp"
#include "experiments/results/results.hpp"
#include "experiments/results/table.hpp"
#include "experiments/study/measure.hpp"
#include "temporary_folder.hpp"

namespace kbvh::experiments::results_test {
namespace {

using nlohmann::json;

// --- results ------------------------------------------------------------------------------------------

TEST(Results, ResumeAfterATruncatedLine) {
  const TemporaryFolder folder;
  const auto out = folder / "deep/er";
  {
    ResultStore store(out);
    EXPECT_EQ(store.records(), 0u);
    store.append({{"key", "a"}, {"value", 1}});
    store.append({{"key", "b"}, {"value", 2}});
    ASSERT_NE(store.find("a"), nullptr);
  }
  const std::string whole = text_of_file(out / "results.jsonl");
  for (std::size_t cut = 1; cut < 10; ++cut) {
    write_text(out / "results.jsonl", whole.substr(0, whole.size() - cut));
    ResultStore store(out);
    EXPECT_NE(store.find("a"), nullptr);
    // Without its newline the last line is still whole; with less it is not.
    EXPECT_EQ(store.find("b") != nullptr, cut == 1) << cut;
    EXPECT_EQ(store.unreadable_lines(), cut == 1 ? 0u : 1u);
    store.append({{"key", "c"}});
    ResultStore again(out);
    EXPECT_NE(again.find("c"), nullptr);
    EXPECT_NE(again.find("a"), nullptr);
    EXPECT_EQ(again.unreadable_lines(), cut == 1 ? 0u : 1u);
  }
}

TEST(Results, NewestOfAKeyCountsAndNothingIsLost) {
  const TemporaryFolder folder;
  ResultStore store(folder.path());
  store.append({{"key", "a"}, {"value", 1}});
  store.append({{"key", "a"}, {"value", 2}});
  ResultStore again(folder.path());
  EXPECT_EQ(again.find("a")->at("value"), 2);
  EXPECT_EQ(again.records(), 2u);
}

TEST(Results, NestingWithoutEndIsNoRecord) {
  const TemporaryFolder folder;
  const std::string open(300000, '['), close(300000, ']');
  write_text(folder / "results.jsonl", open + "\n" + open + close + "\n{\"key\": \"a\", \"x\": " + open +
                                           close + "}\n{\"key\": \"b\", \"x\": \"[[\\\"[\"}\n");
  ResultStore store(folder.path());
  EXPECT_EQ(store.unreadable_lines(), 3u);
  EXPECT_NE(store.find("b"), nullptr);
  EXPECT_FALSE(json_or_nothing(std::string(100, '[') + std::string(100, ']')).is_discarded());
  EXPECT_TRUE(json_or_nothing(std::string(101, '[') + std::string(101, ']')).is_discarded());
}

TEST(Results, LinksToNothingAreSeenBeforeAnythingIsMeasured) {
  const TemporaryFolder folder;
  for (const char* target : {"nowhere", "results.jsonl"}) {
    const auto out = folder / target;
    std::filesystem::create_directories(out);
    std::filesystem::create_symlink(target, out / "results.jsonl");
    EXPECT_TRUE(contains(complaint([&] { ResultStore store(out); }), "is a link that leads to no file"))
        << target;
  }
}

TEST(Results, AFolderThatCannotBeMade) {
  const TemporaryFolder folder;
  write_text(folder / "file", "x");
  EXPECT_TRUE(contains(complaint([&] { ResultStore store(folder / "file/out"); }), "cannot be made"));
}

json example_scene() {
  return {{"hash", "1"}, {"scalar", "float"}, {"per_keyframe", 10}, {"frames", 591}, {"frame_times", "2"}};
}
json example_strategy() {
  return {{"id", "x"}, {"params", {{"queue", "avl"}}}, {"builder", {{"width", 2}}}, {"title", "X"}};
}
const json example_machine{{"cpu", "c"},       {"compiler", "g"}, {"flags", "-O2"}, {"build_type", "Release"},
                           {"kernels", "sse"}, {"os", "d"}};

TEST(Results, KeysAreStableAndSeeWhatMatters) {
  const Study study;
  const auto key = [&](const json& scene, const json& strategy) {
    return configuration_key(Harness::rounds, "abc", scene, strategy, study, example_machine);
  };
  const std::string usual = key(example_scene(), example_strategy());
  // Pinned: a change of this value makes every stored result be measured again.
  EXPECT_EQ(usual, "369dfdff041a777b");
  json scene = example_scene(), strategy = example_strategy();
  strategy["title"] = "another title";
  EXPECT_EQ(key(scene, strategy), usual);
  // A table and a report are of scenes by name: what was measured under another one is not in them.
  scene["name"] = "another name";
  EXPECT_NE(key(scene, example_strategy()), usual);
  scene = example_scene();
  scene["hash"] = "2";
  EXPECT_NE(key(scene, example_strategy()), usual);
  strategy["params"]["queue"] = "binary_heap";
  EXPECT_NE(key(example_scene(), strategy), usual);
  Study more = study;
  more.repetitions = 4;
  EXPECT_NE(
      configuration_key(Harness::rounds, "abc", example_scene(), example_strategy(), more, example_machine),
      usual);
  json other_kernels = example_machine;
  other_kernels["kernels"] = "portable";
  EXPECT_NE(
      configuration_key(Harness::rounds, "abc", example_scene(), example_strategy(), study, other_kernels),
      usual);
  EXPECT_NE(
      configuration_key(Harness::rounds, "abd", example_scene(), example_strategy(), study, example_machine),
      usual);
  EXPECT_NE(configuration_key(Harness::google_benchmark, "abc", example_scene(), example_strategy(), study,
                              example_machine),
            usual);
}

// --- times and tables ---------------------------------------------------------------------------------

TEST(Times, QuantilesAreOfTheMedianRepetition) {
  Measured measured;
  for (const double scale : {3.0, 1.0, 2.0}) {
    ClipTimes clip;
    for (int frame = 1; frame <= 100; ++frame) clip.frames.push_back({5, scale * frame * 1e-3, 0, 0, 0});
    measured.repetitions.push_back(clip);
  }
  const json record = times_record(measured);
  EXPECT_DOUBLE_EQ(record.at("total_p50"), 100);
  EXPECT_DOUBLE_EQ(record.at("total_p99"), 198);
  EXPECT_DOUBLE_EQ(record.at("total_worst"), 200);
  EXPECT_EQ(record.at("repetitions").size(), 3u);
  EXPECT_DOUBLE_EQ(record.at("repetitions")[0].at("update"), 151.5);
  // 16 parts of 6 or 7 frames each, of the median repetition: its frames take 2, 4, 6... ms.
  const json& parts = record.at("over_time");
  ASSERT_EQ(parts.size(), 16u);
  EXPECT_EQ(parts[0].at("begin"), 0);
  EXPECT_DOUBLE_EQ(parts[0].at("update"), 7);
  EXPECT_EQ(parts[0].at("query"), 0);
  EXPECT_DOUBLE_EQ(parts[15].at("begin"), 0.93);
  EXPECT_DOUBLE_EQ(parts[15].at("update"), 194);
}

TEST(Times, MeansHaveEveryPhase) {
  ClipTimes clip;
  clip.frames = {{1, 2, 3, 4, 5, 6}, {3, 4, 5, 6, 7, 8}};
  const PhaseTimes mean = clip.mean();
  EXPECT_EQ(mean.motion, 2);
  EXPECT_EQ(mean.update, 3);
  EXPECT_EQ(mean.traversal, 4);
  EXPECT_EQ(mean.triangle_tests, 5);
  EXPECT_EQ(mean.plan_changes, 6);
  EXPECT_EQ(mean.geometry_changes, 7);
  EXPECT_DOUBLE_EQ(2 * mean.total(), clip.total());
  Measured measured;
  measured.repetitions = {clip};
  EXPECT_DOUBLE_EQ(times_record(measured).at("repetitions")[0].at("geometry_changes"), 7e3);
  const json parts = times_record(measured).at("over_time");
  ASSERT_EQ(parts.size(), 2u);
  EXPECT_EQ(parts[1].at("begin"), 0.5);
  EXPECT_DOUBLE_EQ(parts[1].at("update"), 4e3);
  EXPECT_DOUBLE_EQ(parts[1].at("query"), 11e3);
}

json example_record(const std::string& id, const std::string& family, double update) {
  json repetitions = json::array();
  for (const double factor : {1.0, 3.0, 2.0})
    repetitions.push_back({{"motion", 1.0},
                           {"update", factor * update},
                           {"traversal", 0.0},
                           {"triangle_tests", 0.0},
                           {"plan_changes", 0.0}});
  return {
      {"run", "r"},
      {"scene", {{"name", "s"}, {"per_keyframe", 10}, {"scalar", "float"}, {"frames", 5}, {"primitives", 7}}},
      {"strategy", {{"id", id}, {"label", id}, {"family", family}}},
      {"verified",
       {{"missed", 0}, {"extra", 1}, {"audited", true}, {"protrusion", 0.0}, {"looseness", 0.25}}},
      {"times", {{"repetitions", repetitions}}}};
}

TEST(Table, RatiosAreAgainstTheBestRefit) {
  json broken = example_record("wrong", "refit", 0.01);
  broken["times"] = nullptr;
  broken["refused"] = "it is wrong";
  const std::vector<json> records{example_record("slow", "refit", 8), example_record("fast", "refit", 4),
                                  example_record("own", "kinetic", 2), broken};
  EXPECT_EQ(best_refit(records), &records[1]);
  EXPECT_EQ(
      results_table(records),
      "s, l = 10, float: 5 frames, 7 primitives\n"
      "strategy   motion  update  query  code  x refit  with motion  missed  extra  protrusion  looseness\n"
      "slow            1      16      0     -      0.5        0.529       0      1           0       0.25\n"
      "fast            1       8      0     -        1            1       0      1           0       0.25\n"
      "own             1       4      0     -        2          1.8       0      1           0       0.25\n"
      "wrong     refused                                                  0      1           0       0.25\n"
      "  x refit and with motion: against fast, the baseline with the shortest clip\n"
      "  wrong is refused a time: it is wrong\n");
}

TEST(Table, SaysHowManyPairsThereAre) {
  std::vector<json> records{example_record("threw", "refit", 1), example_record("fast", "refit", 4)};
  records[0]["verified"].update({{"frames", 1u}, {"pairs", 2u}});
  records[1]["verified"].update({{"frames", 4u}, {"pairs", 35u}});
  const auto title = [&] { return results_table(records).substr(0, results_table(records).find('\n')); };
  EXPECT_EQ(title(), "s, l = 10, float: 5 frames, 7 primitives, 35 true pairs in 4 compared frames");
  records[1]["verified"].update({{"frames", 1u}, {"pairs", 1u}});
  records[0]["verified"]["pairs"] = 1u;
  EXPECT_EQ(title(), "s, l = 10, float: 5 frames, 7 primitives, 1 true pair in 1 compared frame");
  for (json& record : records) record["scene"]["rays"] = "coherent:4:closest";
  EXPECT_EQ(title(), "s, l = 10, float: 5 frames, 7 primitives, 1 true hit in 1 compared frame");
  for (json& record : records) record["verified"]["frames"] = "damaged";
  EXPECT_EQ(title(), "s, l = 10, float: 5 frames, 7 primitives");
}

// A refit of one's own is shown in the table, and no ratio is against it unless it is declared a baseline.
TEST(Table, OnlyDeclaredBaselinesAreTheDenominator) {
  std::vector<json> records{example_record("mine", "refit", 1), example_record("bottom_up", "refit", 4),
                            example_record("new", "other", 2)};
  records[0]["strategy"]["baseline"] = false;
  records[1]["strategy"]["baseline"] = true;
  records[2]["strategy"]["baseline"] = false;
  EXPECT_EQ(best_refit(records), &records[1]);
  EXPECT_NE(results_table(records).find("\nmine            1       2      0     -        4"),
            std::string::npos)
      << results_table(records);
  records[2]["strategy"]["baseline"] = true;
  EXPECT_EQ(best_refit(records), &records[2]);
}

// One denominator for all phases: a baseline that does its work in the query, or fetches its positions, does
// not become the other side of updates alone.
TEST(Table, TheBestRefitHasTheShortestClip) {
  std::vector<json> records{example_record("lazy", "refit", 1), example_record("plain", "refit", 4)};
  for (json& repetition : records[0]["times"]["repetitions"])
    repetition.update({{"motion", 0.0}, {"traversal", 9.0}});
  EXPECT_EQ(best_refit(records), &records[1]) << "its update is longer, its clip is shorter";
  for (json& repetition : records[0]["times"]["repetitions"]) repetition["traversal"] = 6.5;
  EXPECT_EQ(best_refit(records), &records[0]) << "2 + 6.5 is longer than 8, by less than its positions";
}

// The program, the analysis and the explorer choose the same denominator from the same file: the two others
// are held to it by tests/analysis/test_ratios.py and test_explore.py.
TEST(Table, TheBestRefitIsThatOfTheAnalysis) {
  const std::filesystem::path folder = std::filesystem::path(KBVH_PLANS) / "../../tests/support/results";
  std::map<std::string, std::vector<json>> tables;
  std::ifstream file(folder / "denominators.jsonl");
  for (std::string line; std::getline(file, line);) {
    json record = json::parse(line);
    tables[std::to_string(record.at("scene").at("per_keyframe").get<int>())].push_back(std::move(record));
  }
  const json expected = json::parse(std::ifstream(folder / "denominators.json"));
  ASSERT_EQ(tables.size(), expected.size());
  for (const auto& [l, records] : tables) {
    const json* found = best_refit(records);
    EXPECT_EQ(found == nullptr ? json() : found->at("strategy").at("id"), expected.at(l)) << "l = " << l;
  }
}

TEST(Table, CodeAndVersionsOfPeersAreShown) {
  std::vector<json> records{example_record("bottom_up", "refit", 4), example_record("bottom_up", "refit", 4),
                            example_record("peer", "embree", 8)};
  for (json& record : records) record["machine"] = {{"kernels", "avx512"}};
  records[1]["strategy"]["params"] = {{"kernels", "sse"}};
  records[2]["strategy"].update(
      {{"version", "Peer 3.2.1"}, {"instructions", "sse2"}, {"remark", "its update lies elsewhere"}});
  EXPECT_EQ(instructions_of(records[0]), "avx512");
  EXPECT_EQ(instructions_of(records[1]), "sse");
  EXPECT_EQ(instructions_of(records[2]), "sse2");
  const std::string table = results_table(records);
  EXPECT_NE(table.find("    sse2  "), std::string::npos) << table;
  EXPECT_NE(table.find("\n  peer is Peer 3.2.1: its update lies elsewhere\n"), std::string::npos) << table;
}

TEST(Table, CountersOfAStrategysOwnAreShown) {
  std::vector<json> records{example_record("mine", "refit", 1)};
  records[0]["counters"] = {{"box_tests", 5}, {"restarts", 7}, {"never", 0}};
  EXPECT_NE(results_table(records).find("  mine counted restarts 7\n"), std::string::npos)
      << results_table(records);
}

TEST(Table, ColumnsCountCharacters) {
  EXPECT_EQ(columns({{"ä", "b"}, {"long", "2"}}), "ä     b\nlong  2\n");
}

}  // namespace
}  // namespace kbvh::experiments::results_test
