// Tables on standard output, and the estimate of the time that a plan still takes.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <sstream>

#include "complaint.hpp"
#include "experiments/results/table.hpp"
#include "experiments/run/time_left.hpp"

namespace kbvh::experiments::table_test {
namespace {

using nlohmann::json;

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
  std::vector<json> records{example_record("slow", "refit", 8), example_record("fast", "refit", 4),
                            example_record("own", "kinetic", 2), broken};
  records[2]["times"]["total_p99"] = 6.0;
  EXPECT_EQ(best_refit(records), &records[1]);
  EXPECT_EQ(results_table(records),
            "s, l = 10, float: 5 frames, 7 primitives, 3 repetitions\n"
            "strategy  x refit       range  update  query  motion  extra   family\n"
            "own             2      2 to 2       4      0       1      1  kinetic\n"
            "fast            1           -       8      0       1      1    refit\n"
            "slow          0.5  0.5 to 0.5      16      0       1      1    refit\n"
            "wrong     refused                                         1    refit\n"
            "\n"
            "strategy  with motion  p99  paid from  missed  extra  protrusion  looseness  code\n"
            "own               1.8    6          -       0      1           0       0.25     -\n"
            "fast                1    -          -       0      1           0       0.25     -\n"
            "slow            0.529    -          -       0      1           0       0.25     -\n"
            "wrong                                       0      1           0       0.25     -\n"
            "  x refit: against fast, the baseline with the shortest clip\n"
            "  wrong is refused a time: it is wrong\n");
}

TEST(Table, SaysHowManyPairsThereAre) {
  std::vector<json> records{example_record("threw", "refit", 1), example_record("fast", "refit", 4)};
  records[0]["verified"].update({{"frames", 1u}, {"pairs", 2u}});
  records[1]["verified"].update({{"frames", 4u}, {"pairs", 35u}});
  const auto title = [&] { return results_table(records).substr(0, results_table(records).find('\n')); };
  EXPECT_EQ(title(),
            "s, l = 10, float: 5 frames, 7 primitives, 3 repetitions, 35 true pairs in 4 compared frames");
  records[1]["verified"].update({{"frames", 1u}, {"pairs", 1u}});
  records[0]["verified"]["pairs"] = 1u;
  EXPECT_EQ(title(),
            "s, l = 10, float: 5 frames, 7 primitives, 3 repetitions, 1 true pair in 1 compared frame");
  for (json& record : records) record["scene"]["rays"] = "coherent:4:closest";
  EXPECT_EQ(title(),
            "s, l = 10, float: 5 frames, 7 primitives, 3 repetitions, 1 true hit in 1 compared frame");
  for (json& record : records) record["verified"]["frames"] = "damaged";
  EXPECT_EQ(title(), "s, l = 10, float: 5 frames, 7 primitives, 3 repetitions");
}

TEST(Table, DisturbedRatiosLookDifferent) {
  std::vector<json> records{example_record("refit", "refit", 4), example_record("own", "kinetic", 2)};
  for (json& record : records) record["times"]["disturbed"] = "";
  EXPECT_NE(results_table(records).find("\n  quiet\n"), std::string::npos) << results_table(records);
  records[1]["times"]["disturbed"] = "9 involuntary switches, 30 a second";
  const std::string table = results_table(records);
  EXPECT_EQ(table.find("quiet"), std::string::npos) << table;
  EXPECT_NE(table.find("       2?"), std::string::npos) << table;
  EXPECT_NE(table.find("\n  ? disturbed: own: 9 involuntary switches, 30 a second\n"), std::string::npos)
      << table;
}

// A user's own refit is shown in the table, but no ratio refers to it unless it is declared a baseline.
TEST(Table, OnlyDeclaredBaselinesAreTheDenominator) {
  std::vector<json> records{example_record("mine", "refit", 1), example_record("bottom_up", "refit", 4),
                            example_record("new", "other", 2)};
  records[0]["strategy"]["baseline"] = false;
  records[1]["strategy"]["baseline"] = true;
  records[2]["strategy"]["baseline"] = false;
  EXPECT_EQ(best_refit(records), &records[1]);
  EXPECT_NE(results_table(records).find("\nmine             4  4 to 4"), std::string::npos)
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

// The program, the analysis and the explorer choose the same denominator from the same file: for the other
// two, tests/analysis/test_ratios.py and test_explore.py check this.
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

/// Returns the numbers of a ratio, and whether its ends are those of an interval.
json ratio_json(const std::optional<RatioOfTimes>& ratio) {
  if (!ratio) return nullptr;
  if (!ratio->within) return json::array({ratio->middle});
  return {ratio->middle, ratio->within->low, ratio->within->high, ratio->within->is_interval};
}

// The program computes ratios and their intervals, so does the analysis (tests/analysis/test_ratios.py): by
// frames and by clips, with paired rounds and with others, with few repetitions, with plan changes.
TEST(Table, RatiosAreThoseOfTheAnalysis) {
  const std::filesystem::path folder = std::filesystem::path(KBVH_PLANS) / "../../tests/support/results";
  std::vector<json> records;
  std::ifstream file(folder / "ratios.jsonl");
  for (std::string line; std::getline(file, line);) records.push_back(json::parse(line));
  const json* refit = best_refit(records);
  ASSERT_NE(refit, nullptr);
  json found;
  for (const json& record : records)
    for (const char* phase : {"total", "total_with_motion", "upkeep", "query"})
      found[record.at("strategy").at("id").get<std::string>()][phase] =
          ratio_json(ratio_of(*refit, phase, record, phase));
  const json expected = json::parse(std::ifstream(folder / "ratios.json")).flatten();
  const json flat = found.flatten();
  ASSERT_EQ(flat.size(), expected.size()) << found.dump();
  for (const auto& [path, value] : expected.items()) {
    ASSERT_TRUE(flat.contains(path)) << path;
    if (value.is_number())
      EXPECT_NEAR(flat.at(path).get<double>() / value.get<double>(), 1, 1e-9) << path;
    else
      EXPECT_EQ(flat.at(path), value) << path;
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
  EXPECT_NE(table.find("    sse2\n"), std::string::npos) << table;
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

std::size_t longest_of(const std::string& text) {
  std::size_t longest = 0;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) longest = std::max(longest, line.size());
  return longest;
}

TEST(Table, ALongNameHasALineOfItsOwn) {
  const std::vector<std::vector<std::string>> rows{{"a", "b"}, {"short", "2"}, {"nineteen characters", "3"}};
  EXPECT_EQ(columns(rows), "a                    b\nshort                2\nnineteen characters  3\n");
  EXPECT_EQ(columns(rows, 15), "a      b\nshort  2\nnineteen characters\n       3\n");
}

TEST(Table, TextIsBrokenBetweenWords) {
  EXPECT_EQ(wrapped("one two three", "  ", 9), "  one two\n    three\n");
  EXPECT_EQ(wrapped("one two three", "  ", 20), "  one two three\n");
  EXPECT_EQ(wrapped("unbreakable", "", 4), "unbreakable\n");
}

/// Twenty contestants of four families, the last of them wrong on purpose and the fastest of all.
std::vector<json> many_records() {
  std::vector<json> records;
  for (int i = 0; i < 20; ++i) {
    const std::string family = i % 4 == 0   ? "refit"
                               : i % 4 == 1 ? "kinetic"
                               : i % 4 == 2 ? "rebuild"
                                            : "peer";
    records.push_back(example_record("own_" + std::to_string(i), family, 20 - i));
    records.back()["strategy"]["label"] =
        "own_" + std::to_string(i) +
        " (queue avl, candidates searched, planes start, boxes inherited, width 2)";
  }
  records.push_back(example_record("guess", "peer", 0.5));
  records.back()["strategy"]["guarantee"] = "approximate";
  records.back()["verified"]["missed"] = 12345;
  return records;
}

TEST(Table, OfManyTheFastestOfEachFamilyIsShown) {
  const std::vector<json> records = many_records();
  const std::string table = results_table(records, Shown::fastest);
  // The refit is the best one, and its family's fastest; the approximate contestant does not hide an exact
  // one.
  std::vector<std::string> shown;
  std::istringstream lines(table);
  for (std::string line; std::getline(lines, line);)
    if (line.rfind("own_", 0) == 0) shown.push_back(line.substr(0, line.find(' ')));
  EXPECT_EQ(shown, (std::vector<std::string>{"own_19", "own_18", "own_17", "own_16"})) << table;
  EXPECT_EQ(table.find("guess"), std::string::npos) << table;
  EXPECT_TRUE(contains(table, "peer, of 6\n"));
  EXPECT_TRUE(contains(table, "refit, of 5\n"));
  EXPECT_TRUE(contains(table, "--names shows all 21\n"));
  const std::string all = results_table(records, Shown::all);
  for (const json& record : records)
    EXPECT_TRUE(contains(all, record.at("strategy").at("label").get<std::string>()));
  EXPECT_EQ(all.find("--names"), std::string::npos);
}

TEST(Table, AFewAreAllShown) {
  std::vector<json> records = many_records();
  records.erase(records.begin() + 12, records.end());
  const std::string table = results_table(records, Shown::fastest);
  for (int i = 0; i < 12; ++i) EXPECT_TRUE(contains(table, "\nown_" + std::to_string(i) + " (")) << i;
  EXPECT_EQ(table.find("looseness"), std::string::npos) << table;
}

TEST(Table, NoLineIsLongerThanAPage) {
  std::vector<json> records = many_records();
  for (std::size_t i = 0; i < records.size(); ++i) {
    json& record = records[i];
    record["times"]["disturbed"] = i % 2 == 0 ? "9 involuntary switches, 30 a second" : "";
    record["strategy"].update(
        {{"version", "Peer 3.2.1"}, {"remark", "what it does in its update, it does late"}});
    record["verified"].update({{"frames", 5u}, {"pairs", 123456789u}});
    record["choice"] =
        "another one in 17 of 591 frames, because the motion of its bodies is not what it was before";
  }
  for (const Shown shown : {Shown::fastest, Shown::all}) {
    const std::string table = results_table(records, shown);
    EXPECT_LE(longest_of(table), longest_line) << table;
  }
}

/// Three scenes of equal work: two tables of 8 steps each.
Plan plan_of_three() {
  Plan plan;
  plan.studies.resize(2);
  for (Study& study : plan.studies) {
    study.per_keyframe = {5};
    study.scalars = {"float", "double"};
    study.repetitions = 5;
    SceneSpec scene;
    scene.builtin = "tablecloth";
    study.scenes.assign(&study == &plan.studies[0] ? 2 : 1, scene);
  }
  return plan;
}

TEST(TimeLeft, IsThatOfTheWorkSoFar) {
  double now = 1000;
  TimeLeft left(plan_of_three(), {1, 1}, [&now] { return now; });
  EXPECT_LT(left.seconds(), 0);
  EXPECT_EQ(left.said(), "");
  left.begin_scene();
  left.begin_table(8);
  left.made(4);
  now += 1;
  EXPECT_EQ(left.said(), "") << "too short for an estimate";
  now += 39;
  EXPECT_DOUBLE_EQ(left.seconds(), 5.5 * 80);
  EXPECT_EQ(left.said(), "about 7 min left: ");
  left.made(100);
  EXPECT_DOUBLE_EQ(left.seconds(), 5 * 40) << "more steps than a table has do not count";
  left.begin_table(8);
  left.made(8);
  now += 20;
  EXPECT_DOUBLE_EQ(left.seconds(), 4 * 30);
  // The next scene is known from an earlier run: it takes no time, and tells nothing about the rest.
  left.begin_scene();
  left.begin_table(8);
  EXPECT_DOUBLE_EQ(left.seconds(), 4 * 30);
  left.begin_scene();
  EXPECT_DOUBLE_EQ(left.seconds(), 2 * 30) << "its second table is skipped";
  EXPECT_EQ(left.said(), "about 60 s left: ");
  left.begin_table(8);
  left.made(8);
  now += 30;
  left.begin_table(8);
  left.made(8);
  now += 30;
  EXPECT_NEAR(left.seconds(), 0, 1e-9);
  EXPECT_EQ(left.said(), "about 10 s left: ");
}

}  // namespace
}  // namespace kbvh::experiments::table_test
