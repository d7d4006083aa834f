// kbvh merge: nothing is lost, nothing counts twice, and damaged input is refused before anything is written.
#include "binary.hpp"

namespace kbvh::experiments::merge_test {
namespace {

json record(const std::string& key, const std::string& run, const std::string& when);

TEST_F(Binary, ADayThatDoesNotExistIsNotTheNewest) {
  for (const std::string wrong : {"2999-13-45", "2999-13-45T00:00:00Z", "2999-02-29T00:00:00Z",
                                  "2999-01-01T24:00:00Z", "2999-01-01 00:00:00Z", "tomorrow", ""}) {
    SCOPED_TRACE(wrong);
    write_text(folder_ / "a.jsonl", record("k", "r1", "2026-01-01T00:00:00Z").dump() + "\n");
    write_text(folder_ / "b.jsonl", record("k", "r2", wrong).dump() + "\n");
    for (const std::string order : {"a.jsonl b.jsonl", "b.jsonl a.jsonl"}) {
      std::filesystem::remove_all(folder_ / "m");
      const Outcome merged = kbvh("merge " + order + " --out m");
      EXPECT_EQ(merged.code, 0) << merged.err;
      EXPECT_NE(
          merged.err.find("1 record of b.jsonl has no valid time (b.jsonl line 1), and counts as older"),
          std::string::npos)
          << merged.err;
      ASSERT_EQ(records("m/results.jsonl").size(), 2u);
      EXPECT_EQ(records("m/results.jsonl").back().at("run"), "r1");
    }
  }
}

/// A record with the fields that the program checks.
json record(const std::string& key, const std::string& run, const std::string& when) {
  return {{"schema", 1},
          {"key", key},
          {"kind", "run"},
          {"run", run},
          {"when", when},
          {"commit", "c1"},
          {"machine", {{"cpu", "one"}, {"memory_gb", 16}}},
          {"scene",
           {{"name", "s"},
            {"scalar", "float"},
            {"per_keyframe", 10},
            {"frames", 11},
            {"primitives", 2},
            {"bodies", json::array()}}},
          {"strategy", {{"id", "a"}, {"label", "a"}, {"family", "refit"}, {"params", json::object()}}},
          {"verified",
           {{"holds", true},
            {"missed", 0},
            {"extra", 0},
            {"audited", true},
            {"protrusion", 0},
            {"looseness", 0}}},
          {"times", nullptr}};
}

class Merge : public Binary {
 protected:
  void write(const std::string& folder, const std::vector<json>& list, const std::string& end = "") {
    std::filesystem::create_directories(folder_ / folder);
    std::string text;
    for (const json& one : list) text += one.dump() + "\n";
    write_text(folder_ / folder / "results.jsonl", text + end);
  }
  std::string text(const std::string& file) { return text_of_file(folder_ / file); }
  /// The runs of the records with this key, in the order of the file.
  std::vector<std::string> runs(const std::string& key, const std::string& file = "c/results.jsonl") {
    std::vector<std::string> found;
    for (const json& one : records(file))
      if (one.at("key") == key) found.push_back(one.at("run"));
    return found;
  }
  void expect_refused(const std::string& arguments, const std::string& reason) {
    const Outcome outcome = kbvh("merge " + arguments);
    EXPECT_EQ(outcome.code, 2) << outcome.err;
    EXPECT_NE(outcome.err.find(reason), std::string::npos) << outcome.err;
  }
};

TEST_F(Merge, AddsWordForWordAndOnlyOnce) {
  write("a", {record("k1", "r1", "2026-01-01T00:00:00Z"), record("k2", "r1", "2026-01-01T00:00:01Z")});
  write("b", {record("k3", "r2", "2026-01-02T00:00:00Z"), record("k1", "r1", "2026-01-01T00:00:00Z")});
  const std::string a = text("a/results.jsonl"), b = text("b/results.jsonl");
  const Outcome first = kbvh("merge a b --out c");
  ASSERT_EQ(first.code, 0) << first.err;
  EXPECT_NE(first.out.find("3 records, 3 added, 1 was there already; 1 machine, 1 commit"), std::string::npos)
      << first.out;
  EXPECT_EQ(text("c/results.jsonl"), a + b.substr(0, b.find('\n') + 1));
  EXPECT_EQ(text("a/results.jsonl"), a);
  const std::string merged = text("c/results.jsonl");
  const Outcome second = kbvh("merge b a --out c");
  ASSERT_EQ(second.code, 0) << second.err;
  EXPECT_EQ(text("c/results.jsonl"), merged);
  // One of the inputs may be the folder itself.
  ASSERT_EQ(kbvh("merge a b --out a").code, 0);
  EXPECT_EQ(text("a/results.jsonl"), merged);
}

TEST_F(Merge, TheNewestFinishedRecordOfAKeyCounts) {
  json unfinished = record("k1", "r3", "2026-01-03T00:00:00Z");
  unfinished["unfinished"] = true;
  write("old", {record("k1", "r1", "2026-01-01T00:00:00Z")});
  write("new", {record("k1", "r2", "2026-01-02T00:00:00Z"), record("k2", "r2", "2026-01-02T00:00:01Z")});
  write("failed", {unfinished});
  ASSERT_EQ(kbvh("merge failed new old --out c").code, 0);
  EXPECT_EQ(runs("k1"), (std::vector<std::string>{"r3", "r1", "r2"}));
  EXPECT_EQ(runs("k2"), std::vector<std::string>{"r2"});
  // A record that the folder already has is repeated after older records, and only then.
  ASSERT_EQ(kbvh("merge new --out d").code, 0);
  ASSERT_EQ(kbvh("merge old --out d").code, 0);
  EXPECT_EQ(runs("k1", "d/results.jsonl"), (std::vector<std::string>{"r2", "r1", "r2"}));
  const std::string merged = text("d/results.jsonl");
  ASSERT_EQ(kbvh("merge old new --out d").code, 0);
  EXPECT_EQ(text("d/results.jsonl"), merged);
  ASSERT_EQ(kbvh("merge failed --out d").code, 0);
  EXPECT_EQ(runs("k1", "d/results.jsonl"), (std::vector<std::string>{"r2", "r1", "r2", "r3", "r2"}));
}

TEST_F(Merge, ToldOfMachinesThatShareAKey) {
  json other = record("k1", "r2", "2026-01-02T00:00:00Z");
  other["machine"]["memory_gb"] = 64;
  write("a", {record("k1", "r1", "2026-01-01T00:00:00Z")});
  write("b", {other});
  const Outcome outcome = kbvh("merge a b --out c");
  EXPECT_EQ(outcome.code, 0);
  EXPECT_NE(outcome.out.find("2 machines"), std::string::npos) << outcome.out;
  EXPECT_NE(outcome.err.find("1 configuration was measured on several machines"), std::string::npos)
      << outcome.err;
}

TEST_F(Merge, UnreadableLinesOfKilledStudiesAreSkippedWithANote) {
  write("a", {record("k1", "r1", "2026-01-01T00:00:00Z")}, R"({"schema": 1, "key": "k2", "ru)");
  write("b", {record("k3", "r2", "2026-01-02T00:00:00Z")});
  const Outcome outcome = kbvh("merge b --out a");
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_NE(outcome.err.find("a/results.jsonl line 2 is skipped: it breaks off"), std::string::npos)
      << outcome.err;
  // The broken line is terminated, and stays.
  EXPECT_NE(text("a/results.jsonl").find("\"ru\n{"), std::string::npos);
  EXPECT_EQ(kbvh("merge a --out c").code, 0);
  EXPECT_EQ(records("c/results.jsonl").size(), 2u);
}

TEST_F(Merge, WrongInputIsRefusedBeforeAnythingIsWritten) {
  write("a", {record("k1", "r1", "2026-01-01T00:00:00Z")});
  json newer = record("k2", "r1", "2026-01-01T00:00:00Z");
  newer["schema"] = 3;
  write("newer", {record("k2", "r1", "2026-01-01T00:00:00Z"), newer});
  expect_refused("a newer --out c",
                 "newer/results.jsonl line 2: has schema 3, but this program merges schemas 1 to 2");
  json altered = record("k1", "r1", "2026-01-01T00:00:00Z");
  altered["verified"]["missed"] = 1;
  write("altered", {altered});
  expect_refused("a altered --out c",
                 "altered/results.jsonl line 1: is the same measurement as a/results.jsonl line 1");
  write("empty", {}, "\n");
  expect_refused("a empty --out c", "empty/results.jsonl: has no record of results");
  write("other", {}, "{\"x\": 1}\n");
  expect_refused("a other --out c", "other/results.jsonl line 1: is no record of results: it has no schema");
  expect_refused("a nowhere --out c", "there is no folder of results nowhere");
  expect_refused("a --out a", "there is nothing to merge");
  write_text(folder_ / "a/targets.json", "{}");
  expect_refused("a --out c", "a/targets.json: is not a list of targets");
  EXPECT_FALSE(std::filesystem::exists(folder_ / "c/results.jsonl"));
}

TEST_F(Merge, KeepsTheFilesBesideTheRecords) {
  write("a", {record("k1", "r1", "2026-01-01T00:00:00Z")});
  write("b", {record("k2", "r2", "2026-01-02T00:00:00Z")});
  write_text(folder_ / "a/theory.json", "{\"of\": \"a\"}");
  write_text(folder_ / "b/theory.json", "{\"of\": \"b\"}");
  write_text(folder_ / "a/targets.json", R"([{"plan": "p", "what": "x"}])");
  write_text(folder_ / "b/targets.json", R"([{"plan": "p", "what": "x"}, {"plan": "q", "what": "y"}])");
  std::filesystem::create_directories(folder_ / "b/scenes/s-1");
  write_text(folder_ / "b/scenes/s-1/card.json", "{}");
  const Outcome outcome = kbvh("merge a b --out c");
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_NE(outcome.err.find("b/theory.json is kept as theory-2.json"), std::string::npos) << outcome.err;
  EXPECT_EQ(text("c/theory.json"), "{\"of\": \"a\"}");
  EXPECT_EQ(text("c/theory-2.json"), "{\"of\": \"b\"}");
  EXPECT_EQ(json::parse(text("c/targets.json")).size(), 2u);
  EXPECT_EQ(text("c/scenes/s-1/card.json"), "{}");
  ASSERT_EQ(kbvh("merge a b --out c").code, 0);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "c/theory-3.json"));
}

TEST_F(Merge, AFullDiskLeavesTheResultsAsTheyWere) {
  write("a", {record("k1", "r1", "2026-01-01T00:00:00Z")});
  const std::string before = text("a/results.jsonl");
  std::vector<json> many;
  for (int i = 0; i < 200; ++i) many.push_back(record("m" + std::to_string(i), "r2", "2026-01-02T00:00:00Z"));
  write("b", many);
  // A shell limit on file sizes, in blocks of 1,024 bytes, stands in for the disk.
  const Outcome outcome = shell("ulimit -f 40; trap '' XFSZ; '" KBVH_PROGRAM "' merge b --out a");
  EXPECT_NE(outcome.code, 0);
  EXPECT_NE(outcome.err.find("cannot be written"), std::string::npos) << outcome.err;
  EXPECT_EQ(text("a/results.jsonl"), before);
}

// --- the plan of a single configuration -----------------------------------------------------------------

TEST_F(Binary, ARecordLeadsBackToItsConfiguration) {
  std::filesystem::create_directories(folder_ / "plans");
  write_text(folder_ / "plans/plan.json", R"({"name": "my question", "description": "Is it so?",
    "scenes": [{"builtin": "waving_sheet", "triangles": [100, 200], "keyframes": 3, "order": "shuffled", "seed": 7},
      {"name": "two", "bodies": ["tri.obj,name=flat", {"shape": "sphere", "triangles": 30}], "optional": true}],
    "strategies": [{"id": "bottom_up", "builder": {"leaf_size": 2}}, "kinetic_aabb"], "l": [1, 2], "repetitions": 2,
    "frames_limit": 3, "oracle_every": 2})");
  write_text(folder_ / "plans/tri.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  ASSERT_EQ(kbvh("run --plan plans/plan.json --out out").code, 0);
  const auto list = records();
  ASSERT_EQ(list.size(), 12u);
  for (const json& one : list) {
    SCOPED_TRACE(one.at("again").dump());
    EXPECT_EQ(one.at("plan"), (json{{"name", "my question"}, {"description", "Is it so?"}}));
    write_text(folder_ / "again.json", one.at("again").dump());
    std::filesystem::remove_all(folder_ / "again");
    const Outcome outcome = kbvh("run --plan again.json --out again");
    ASSERT_EQ(outcome.code, 0) << outcome.err;
    const auto again = records("again/results.jsonl");
    ASSERT_EQ(again.size(), 1u);
    EXPECT_EQ(again[0].at("key"), one.at("key"));
    EXPECT_EQ(again[0].at("again"), one.at("again"));
  }
}

}  // namespace
}  // namespace kbvh::experiments::merge_test
