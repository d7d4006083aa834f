// Small studies by the kbvh binary, from end to end: what is measured, recorded, refused and not measured
// again.
#include <algorithm>
#include <map>
#include <set>

#include "binary.hpp"
#include "complaint.hpp"
#include "core/kernels/kernel_set.hpp"

namespace kbvh::experiments::study_test {
namespace {

TEST_F(Binary, RunsRecordsAndResumes) {
  const std::string run = "run " + tiny + "--strategies all --out out";
  const Outcome first = kbvh(run);
  ASSERT_EQ(first.code, 0) << first.err << first.out;
  EXPECT_NE(first.out.find("bottom_up"), std::string::npos);
  const auto list = records();
  ASSERT_FALSE(list.empty());
  for (const json& record : list) {
    SCOPED_TRACE(record.at("strategy").at("id"));
    EXPECT_EQ(record.at("schema"), 2);
    EXPECT_EQ(record.at("kind"), "run");
    EXPECT_EQ(record.at("scene").at("frames"), 5);
    EXPECT_TRUE(record.at("verified").at("holds"));
    EXPECT_EQ(record.at("times").at("repetitions").size(), 2u);
    EXPECT_EQ(record.at("times").at("frames"), 5u);
    EXPECT_GT(record.at("verified").at("pairs"), 0u);
    EXPECT_EQ(record.at("bytes"), record.at("counters").at("bytes"));
  }
  const std::string before = text_of_file(folder_ / "out/results.jsonl");
  const Outcome second = kbvh(run);
  EXPECT_EQ(second.code, 0);
  EXPECT_NE(second.err.find("already"), std::string::npos) << second.err;
  EXPECT_EQ(text_of_file(folder_ / "out/results.jsonl"), before);
  EXPECT_EQ(second.out, first.out);
  // Like a run killed in the middle of the last record: only that record is made again.
  write_text(folder_ / "out/results.jsonl", before.substr(0, before.size() - 20));
  const Outcome third = kbvh(run);
  EXPECT_EQ(third.code, 0);
  EXPECT_NE(third.err.find("1 configuration measured"), std::string::npos) << third.err;
}

TEST_F(Binary, BenchIsRunForOneMoreRelease) {
  const std::string options = tiny + "--strategies bottom_up --leaf-size 1,4 --out out";
  const Outcome bench = kbvh("bench " + options);
  ASSERT_EQ(bench.code, 0) << bench.err;
  EXPECT_NE(bench.err.find("`kbvh bench` is `kbvh run` now"), std::string::npos) << bench.err;
  EXPECT_EQ(records().size(), 2u);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "out/benchmark.json"));
  const Outcome run = kbvh("run " + options);
  EXPECT_NE(run.err.find("0 configurations measured, 2 were in"), std::string::npos) << run.err;
}

// Each body is a file of the scene's card, and the report could not draw thousands.
TEST_F(Binary, ScenesOfThousandsOfBodiesAreNotWritten) {
  const auto plan = [&](int bodies) {
    json list = json::array();
    for (int i = 0; i < bodies; ++i)
      list.push_back({{"shape", "box"}, {"translate", {0, 0, 3 * i}}, {"name", "b" + std::to_string(i)}});
    write_text(folder_ / "plan.json", json{{"scenes", {{{"name", "many"}, {"bodies", list}}}},
                                           {"strategies", "bottom_up"},
                                           {"frames_limit", 2},
                                           {"repetitions", 1}}
                                          .dump());
    const std::string out = "out" + std::to_string(bodies);
    const Outcome run = kbvh("run --plan plan.json --out " + out);
    EXPECT_EQ(run.code, 0) << run.err;
    return std::filesystem::exists(folder_ / out / "scenes");
  };
  EXPECT_TRUE(plan(3));
  EXPECT_FALSE(plan(1001));
}

double middle_of(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

/// Returns the time of a phase by the medians of frames, for a record with an odd number of repetitions;
/// "clip" sums all phases.
double middle(const json& record, const std::string& phase) {
  const json& repetitions = record.at("times").at("repetitions");
  const auto medians = [&](const auto& number) {
    std::vector<double> values;
    for (const json& repetition : repetitions) values.push_back(number(repetition));
    return middle_of(values);
  };
  const std::size_t frames = repetitions[0].at("totals").size();
  double total = 0, sum = 0, share = 0;
  for (std::size_t f = 0; f < frames; ++f)
    total += medians([f](const json& one) { return one.at("totals")[f].get<double>(); }) / double(frames);
  for (const char* name : {"update", "traversal", "triangle_tests", "plan_changes", "geometry_changes"}) {
    const double one = medians([&](const json& repetition) { return repetition.at(name).get<double>(); });
    sum += one;
    if (phase == name || (phase == "query" && (name[0] == 't'))) share += one;
  }
  if (phase != "clip") return total * share / sum;
  for (std::size_t f = 0; f < frames; ++f)
    total += medians([f](const json& one) { return one.at("motions")[f].get<double>(); }) / double(frames);
  return total;
}

TEST_F(Binary, TargetsFollowFromTheRecords) {
  const json sides = {{"numerator", {{"strategy", "bottom_up_period"}, {"phase", "update"}}},
                      {"denominator", {{"strategy", "bottom_up"}, {"phase", "update"}}},
                      {"scenes", {"small", "large"}},
                      {"scalar", "float"},
                      {"l", 2}};
  json first = sides, second = sides, third = sides;
  first.update({{"what", "update"}, {"at_least", 1e-6}, {"aim", 1e9}});
  second.update({{"what", "query"}, {"at_least", 1e9}, {"aim", 1e9}, {"scenes", "small-shuffled"}});
  for (const char* side : {"numerator", "denominator"}) second[side]["phase"] = "query";
  second["denominator"]["builder"] = {{"leaf_size", 4}};
  third.update({{"what", "peer"}, {"at_least", 1}, {"aim", 1}});
  third["numerator"]["strategy"] = "peer";
  const json plan{{"name", "tiny"},
                  {"scenes",
                   {{{"name", "small"},
                     {"builtin", "waving_sheet"},
                     {"triangles", 50},
                     {"keyframes", 2},
                     {"order", {"given", "shuffled"}}},
                    {{"name", "large"}, {"builtin", "waving_sheet"}, {"triangles", 98}, {"keyframes", 2}}}},
                  {"strategies",
                   {"bottom_up_period",
                    {{"id", "bottom_up"}, {"builder", {{"leaf_size", {1, 4}}}}},
                    {{"id", "peer"}, {"optional", true}}}},
                  {"l", 2},
                  {"repetitions", 3},
                  {"targets", {first, second, third}}};
  write_text(folder_ / "plan.json", plan.dump());
  for (const std::string command : {"run", "run"}) {
    const Outcome run = kbvh(command + " --plan plan.json --out out");
    ASSERT_EQ(run.code, 0) << run.err;  // a missed target is no error
    EXPECT_NE(run.out.find("Targets"), std::string::npos);
    EXPECT_NE(run.out.find("peer: not measured: small: this program was built without peer"),
              std::string::npos)
        << run.out;
    const json rows = json::parse(text_of_file(folder_ / "out/targets.json"));
    ASSERT_TRUE(rows.is_array());
    ASSERT_EQ(rows.size(), 3u);
    // The same from the records; those of the last command come last for each scene and label.
    std::map<std::string, std::map<std::string, json>> known;
    for (const json& record : records())
      known[record.at("scene").at("name")][record.at("strategy").at("label")] = record;
    ASSERT_EQ(known.size(), 3u);
    const auto ratio = [&](const std::string& scene, const std::string& phase, bool any_leaf_size) {
      double above = 0, below = 0, shortest = 1e300;
      for (const auto& [label, record] : known.at(scene)) {
        const json& strategy = record.at("strategy");
        if (strategy.at("id") == "bottom_up_period") above = middle(record, phase);
        if (strategy.at("id") == "bottom_up" &&
            (any_leaf_size || strategy.at("builder").at("leaf_size") == 4) &&
            middle(record, "clip") < shortest) {
          shortest = middle(record, "clip");
          below = middle(record, phase);
        }
      }
      return above / below;
    };
    const auto expect_measured = [](const json& row, double expected) {
      EXPECT_NEAR(row.at("measured").get<double>(), expected, 1e-9 * expected);
    };
    expect_measured(rows[0], std::min(ratio("small", "update", true), ratio("large", "update", true)));
    EXPECT_EQ(rows[0].at("verdict"), "reached");
    EXPECT_EQ(rows[0].at("per_scene").size(), 3u);
    expect_measured(rows[1], ratio("small-shuffled", "query", false));
    EXPECT_EQ(rows[1].at("verdict"), "missed");
    EXPECT_EQ(rows[1].at("scene"), "small-shuffled");
    EXPECT_EQ(rows[2].at("verdict"), "unmeasured");
    for (const json& row : {rows[0], rows[1]}) {
      EXPECT_TRUE(row.at("confidence_interval").is_null()) << "three repetitions have a range";
      EXPECT_LE(row.at("range")[0], row.at("measured"));
      EXPECT_GE(row.at("range")[1], row.at("measured"));
      EXPECT_EQ(row.at("machine"), records()[0].at("machine"));
      EXPECT_EQ(row.at("commit"), records()[0].at("commit"));
    }
  }
  // Without a folder there is only the table; a wrong target ends the run before any measurement.
  EXPECT_NE(kbvh("run --plan plan.json").out.find("Targets"), std::string::npos);
  json wrong = plan;
  wrong["targets"][0]["scenes"] = "nowhere";
  write_text(folder_ / "plan.json", wrong.dump());
  const Outcome refused = kbvh("run --plan plan.json --out other");
  EXPECT_EQ(refused.code, 2);
  EXPECT_NE(refused.err.find("plan.json: targets[0]: scenes: no study has a scene of the name 'nowhere'"),
            std::string::npos)
      << refused.err;
  EXPECT_EQ(refused.out, "");
}

TEST_F(Binary, APlanSaysWhatTheCommandLineSays) {
  const std::string arguments =
      "--body waving_sheet:triangles=50,keyframes=3 --body "
      "sphere:triangles=80,centre=0:0:0.1,radius=0.4,scale=0.9 "
      "--name pair --strategies bottom_up --l 1,2 --scalar double --leaf-size 2 --repetitions 1 --order "
      "shuffled ";
  const Outcome plan = kbvh("run " + arguments + "--print-plan");
  ASSERT_EQ(plan.code, 0) << plan.err;
  write_text(folder_ / "plan.json", plan.out);
  ASSERT_EQ(kbvh("run " + arguments + "--out out").code, 0);
  const Outcome same = kbvh("run --plan plan.json --out out");
  EXPECT_EQ(same.code, 0);
  EXPECT_NE(same.err.find("0 configurations measured, 2 were in"), std::string::npos) << same.err;
  EXPECT_EQ(records()[0].at("scene").at("name"), "pair-shuffled");
}

TEST_F(Binary, StudiesOfAPlanCanBeRunOneByOne) {
  write_text(folder_ / "ball.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  write_text(folder_ / "plan.json", R"({"name": "whole", "strategies": "bottom_up", "repetitions": 1, "l": 1,
      "scenes": [{"builtin": "waving_sheet", "triangles": 50, "keyframes": 2}],
      "studies": [{"name": "small"}, {"name": "large", "l": 2}, {"name": "large", "l": 3}, {"scenes": [
        {"name": "mine", "bodies": [{"file": "ball.obj"}, "waving_sheet:triangles=50,keyframes=2"]},
        {"name": "shape", "bodies": ["box", "waving_sheet:triangles=50,keyframes=2"]}]}],
      "targets": [{"what": "t", "scenes": "mine", "scalar": "float", "l": 1, "at_least": 1, "aim": 2,
        "numerator": {"strategy": "bottom_up", "phase": "update"},
        "denominator": {"strategy": "bottom_up", "phase": "update"}}]})");
  const Outcome large = kbvh("run --plan plan.json --study large --out out");
  ASSERT_EQ(large.code, 0) << large.err;
  auto list = records();
  ASSERT_EQ(list.size(), 2u);
  EXPECT_EQ(list[0].at("scene").at("per_keyframe"), 2);
  EXPECT_EQ(list[1].at("scene").at("per_keyframe"), 3);
  EXPECT_EQ(large.out.find("Targets"), std::string::npos);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "out/targets.json"));
  // A study without a name has the plan's; existing results are not measured again.
  const Outcome two = kbvh("run --plan plan.json --study whole --study large --out out");
  ASSERT_EQ(two.code, 0) << two.err;
  EXPECT_NE(two.err.find("2 configurations measured, 2 were in"), std::string::npos) << two.err;
  list = records();
  ASSERT_EQ(list.size(), 4u);
  EXPECT_EQ(list[0].at("scene").at("origin"), "built_in");
  EXPECT_EQ(list[2].at("scene").at("origin"), "files");
  EXPECT_EQ(list[3].at("scene").at("origin"), "shapes");
  const Outcome wrong = kbvh("run --plan plan.json --study huge");
  EXPECT_EQ(wrong.code, 2);
  EXPECT_NE(wrong.err.find("plan.json: there is no study 'huge'; known are small, large, whole"),
            std::string::npos)
      << wrong.err;
  EXPECT_EQ(kbvh("run --study small").code, 2) << "--study is about a plan";
}

TEST_F(Binary, OrdersAreDifferentScenesOfTheSameGeometry) {
  const Outcome run =
      kbvh("run " + tiny + "--strategies bottom_up --order given,shuffled,renumbered --out out");
  ASSERT_EQ(run.code, 0) << run.err;
  const auto list = records();
  ASSERT_EQ(list.size(), 3u);
  EXPECT_EQ(list[2].at("scene").at("name"), "waving_sheet-98-renumbered");
  for (const json& record : list) {
    EXPECT_EQ(record.at("verified").at("pairs"), list[0].at("verified").at("pairs"));
  }
  EXPECT_NE(list[1].at("scene").at("hash"), list[0].at("scene").at("hash"));
  EXPECT_NE(list[2].at("scene").at("hash"), list[0].at("scene").at("hash"));
}

TEST_F(Binary, OptionalScenesMayBeAbsent) {
  write_text(folder_ / "plan.json", R"({"strategies": "bottom_up", "repetitions": 1, "scenes": [
      {"name": "away", "optional": true, "bodies": [{"file": "away.obj"}, "box"]},
      {"builtin": "waving_sheet", "triangles": 50, "keyframes": 2}]})");
  const Outcome run = kbvh("run --plan plan.json");
  EXPECT_EQ(run.code, 0) << run.err;
  EXPECT_NE(run.err.find("'away' is skipped"), std::string::npos) << run.err;
}

TEST_F(Binary, BrokenGuaranteesAreRefusedATime) {
  for (const char* command : {"run "}) {
    const std::string out = std::string(1, command[0]) + "-out";
    const std::string arguments =
        command + tiny +
        "--strategies honest,loses,admits_to_lose,repeats,throws,needs_memory,aborts,only_near,only_small,"
        "only_double --out " +
        out;
    const Outcome run = kbvh(arguments, "", KBVH_FAULTY_PROGRAM);
    EXPECT_EQ(run.code, 1) << run.err;
    EXPECT_NE(run.err.find("3 configurations in which"), std::string::npos) << run.err;
    EXPECT_NE(run.err.find("only_small is left out"), std::string::npos) << run.err;
    EXPECT_NE(run.err.find("only_double is left out"), std::string::npos) << run.err;
    EXPECT_NE(run.out.find("throws is refused a time: it threw: out of luck"), std::string::npos) << run.out;
    std::map<std::string, json> by_id;
    for (const json& record : records(out + "/results.jsonl")) by_id[record.at("strategy").at("id")] = record;
    ASSERT_EQ(by_id.size(), 8u);
    for (const char* id : {"loses", "repeats", "throws"}) {
      EXPECT_TRUE(by_id.at(id).at("times").is_null()) << id;
      EXPECT_FALSE(by_id.at(id).at("verified").at("holds")) << id;
      EXPECT_EQ(by_id.at(id).at("refused"), by_id.at(id).at("verified").at("first_violation")) << id;
    }
    for (const char* id : {"honest", "admits_to_lose", "aborts", "only_near"})
      EXPECT_TRUE(by_id.at(id).at("times").is_object()) << id;
    EXPECT_GT(by_id.at("admits_to_lose").at("verified").at("missed"), 0u);
    EXPECT_GT(by_id.at("repeats").at("verified").at("repeated"), 0u);
    // Known failures are still failures when nothing is measured again.
    EXPECT_EQ(kbvh(arguments, "", KBVH_FAULTY_PROGRAM).code, 1);
  }
}

// Work at the beginning of a clip counts, whether `reset` or the first answer does it.
TEST_F(Binary, TheBeginningOfAClipIsChargedFor) {
  const Outcome run =
      kbvh("run " + tiny + "--strategies honest,works_in_reset,works_in_first_query --out out", "",
           KBVH_FAULTY_PROGRAM);
  ASSERT_EQ(run.code, 0) << run.err;
  const auto list = records();
  ASSERT_EQ(list.size(), 3u);
  for (const json& record : list) {
    const std::string id = record.at("strategy").at("id");
    const json& times = record.at("times");
    EXPECT_EQ(times.at("frames"), 5);
    EXPECT_EQ(times.at("steady_from"), 2) << "three keyframes, two frames each";
    const bool works = id != "honest";
    for (const json& repetition : times.at("repetitions")) {
      SCOPED_TRACE(id);
      ASSERT_EQ(repetition.at("totals").size(), 5u);
      // It works for 30 ms, which is longer than any other frame of 100 triangles.
      EXPECT_EQ(repetition.at("totals")[0].get<double>() > 25, works);
      EXPECT_EQ(repetition.at(id == "works_in_reset" ? "update" : "traversal").get<double>() > 5, works);
      EXPECT_EQ(repetition.at("reset").at("update").get<double>() > 25, id == "works_in_reset");
      EXPECT_LT(repetition.at("steady").at("update").get<double>(), 5);
      EXPECT_LT(repetition.at("steady").at("traversal").get<double>(), 5);
    }
  }
}

TEST_F(Binary, WhoAnswersOtherwiseWhileItIsTimedIsRefused) {
  for (const std::string more : {"", "--changes pairs ", "--rays incoherent:64 ", "--continuous "}) {
    const std::string out = "out" + std::to_string(more.size());
    const Outcome run = kbvh("run " + tiny + more + "--strategies honest,lazy_when_timed --out " + out, "",
                             KBVH_FAULTY_PROGRAM);
    EXPECT_EQ(run.code, 1) << more << run.err;
    EXPECT_NE(run.out.find("lazy_when_timed is refused a time: frame "), std::string::npos)
        << more << run.out;
    EXPECT_TRUE(contains(unwrapped(run.out), "in the replay of the same calls"));
    const auto list = records(out + "/results.jsonl");
    ASSERT_EQ(list.size(), 2u) << more;
    EXPECT_TRUE(list[0].at("times").is_object()) << more;
    EXPECT_TRUE(list[1].at("times").is_null()) << more;
  }
  // Queried as `verify` does, it answers everything; with other calls in between, as in timing, it does not.
  const Outcome run = kbvh("run " + tiny + "--strategies lazy_unless_judged --oracle-every 2 --out judged",
                           "", KBVH_FAULTY_PROGRAM);
  EXPECT_EQ(run.code, 1) << run.err;
  EXPECT_NE(run.out.find("in the replay of the timed calls, pair"), std::string::npos) << run.out;
}

TEST_F(Binary, RoundsAreShuffledAndRecorded) {
  const Outcome run = kbvh(
      "run --scene waving_sheet --triangles 100 --keyframes 3 --l 2 --strategies family:refit --repetitions "
      "6 "
      "--seconds 0 --out out");
  ASSERT_EQ(run.code, 0) << run.err;
  const auto list = records();
  ASSERT_GT(list.size(), 3u);
  for (std::size_t round = 0; round < 6; ++round) {
    std::set<std::size_t> places;
    for (const json& record : list) {
      const json& repetition = record.at("times").at("repetitions").at(round);
      EXPECT_EQ(repetition.at("round"), round);
      EXPECT_EQ(record.at("shuffle"), list[0].at("shuffle"));
      places.insert(repetition.at("place").get<std::size_t>());
    }
    EXPECT_EQ(places.size(), list.size());
    EXPECT_EQ(*places.rbegin(), list.size() - 1);
  }
}

TEST_F(Binary, ForcedKernelsAreAnotherConfiguration) {
  const std::string run = "run " + tiny + "--strategies bottom_up --out out";
  const std::string widest = name(supported_kernel_sets().back());
  EXPECT_EQ(kbvh(run, "KBVH_KERNELS=" + widest).code, 0);
  EXPECT_EQ(kbvh(run, "KBVH_KERNELS=portable").code, 0);
  const auto list = records();
  ASSERT_EQ(list.size(), supported_kernel_sets().size() > 1 ? 2u : 1u);
  EXPECT_EQ(list.front().at("machine").at("kernels"), widest);
  EXPECT_EQ(list.back().at("machine").at("kernels"), "portable");
  const Outcome wrong = kbvh(run, "KBVH_KERNELS=mmx");
  EXPECT_EQ(wrong.code, 2);
  EXPECT_EQ(wrong.err, "kbvh: KBVH_KERNELS: unknown kernels 'mmx'; known are portable, sse, avx2, avx512\n");
}

}  // namespace
}  // namespace kbvh::experiments::study_test
