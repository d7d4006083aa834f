// Result files, keys and times.
#include <gtest/gtest.h>

#include <filesystem>
#include <set>

#include "complaint.hpp"
#include "experiments/results/record.hpp"
#include "experiments/results/results.hpp"
#include "experiments/results/table.hpp"
#include "experiments/run/rounds.hpp"
#include "experiments/study/measure.hpp"
#include "experiments/study/times_record.hpp"
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
    return configuration_key("abc", scene, strategy, study, example_machine);
  };
  const std::string usual = key(example_scene(), example_strategy());
  // Pinned: if this value changes, every stored result is measured again.
  EXPECT_EQ(usual, "2416c175ab5b7e21");
  json scene = example_scene(), strategy = example_strategy();
  strategy["title"] = "another title";
  EXPECT_EQ(key(scene, strategy), usual);
  // A table and a report show scenes by name: measurements under another name are not included.
  scene["name"] = "another name";
  EXPECT_NE(key(scene, example_strategy()), usual);
  scene = example_scene();
  scene["hash"] = "2";
  EXPECT_NE(key(scene, example_strategy()), usual);
  strategy["params"]["queue"] = "binary_heap";
  EXPECT_NE(key(example_scene(), strategy), usual);
  Study more = study;
  more.repetitions = 4;
  EXPECT_NE(configuration_key("abc", example_scene(), example_strategy(), more, example_machine), usual);
  json other_kernels = example_machine;
  other_kernels["kernels"] = "portable";
  EXPECT_NE(configuration_key("abc", example_scene(), example_strategy(), study, other_kernels), usual);
  EXPECT_NE(configuration_key("abd", example_scene(), example_strategy(), study, example_machine), usual);
  Study narrow = study, longer = study;
  narrow.interval_width = 0.01;
  longer.seconds = 60;
  for (const Study& other : {narrow, longer})
    EXPECT_NE(configuration_key("abc", example_scene(), example_strategy(), other, example_machine), usual);
}

// --- times -------------------------------------------------------------------------------------------

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
  EXPECT_DOUBLE_EQ(record.at("repetitions")[0].at("p99"), 297);
  EXPECT_DOUBLE_EQ(record.at("repetitions")[1].at("worst"), 100);
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
  const PhaseTimes sum = clip.sum();
  EXPECT_EQ(sum.motion, 4);
  EXPECT_EQ(sum.update, 6);
  EXPECT_EQ(sum.traversal, 8);
  EXPECT_EQ(sum.triangle_tests, 10);
  EXPECT_EQ(sum.plan_changes, 12);
  EXPECT_EQ(sum.geometry_changes, 14);
  EXPECT_DOUBLE_EQ(sum.total(), clip.total());
  Measured measured;
  measured.repetitions = {clip};
  const json repetition = times_record(measured).at("repetitions")[0];
  EXPECT_DOUBLE_EQ(repetition.at("geometry_changes"), 7e3);
  EXPECT_EQ(repetition.at("totals"), (json{20e3, 30e3}));
  EXPECT_EQ(repetition.at("motions"), (json{1e3, 3e3}));
  const json parts = times_record(measured).at("over_time");
  ASSERT_EQ(parts.size(), 2u);
  EXPECT_EQ(parts[1].at("begin"), 0.5);
  EXPECT_DOUBLE_EQ(parts[1].at("update"), 4e3);
  EXPECT_DOUBLE_EQ(parts[1].at("query"), 11e3);
}

/// A clip of frames of the given lengths, the same for update and query.
ClipTimes clip_of(const std::vector<double>& frames, double motion = 1) {
  ClipTimes clip;
  for (const double frame : frames) clip.frames.push_back({1e-3 * motion, 5e-4 * frame, 5e-4 * frame, 0});
  return clip;
}

// Frame 1 of the second repetition, frame 2 of the third and the whole last one were disturbed.
TEST(Times, ADisturbedFrameDoesNotCount) {
  Measured measured;
  measured.steady_from = 2;
  for (const std::vector<double>& frames : std::vector<std::vector<double>>{
           {8, 2, 4, 2}, {8, 90, 4, 2}, {8, 2, 70, 2}, {8, 2, 4, 2}, {80, 20, 40, 20}})
    measured.repetitions.push_back(clip_of(frames));
  const RawTimes times = raw_times(measured, "s");
  EXPECT_DOUBLE_EQ(time_of(times, "total"), 4) << "(8 + 2 + 4 + 2) / 4";
  EXPECT_DOUBLE_EQ(time_of(times, "update"), 2) << "phases are scaled to the total";
  EXPECT_DOUBLE_EQ(time_of(times, "query"), 2);
  EXPECT_DOUBLE_EQ(time_of(times, "motion"), 1);
  EXPECT_DOUBLE_EQ(time_of(times, "total_with_motion"), 5);
  EXPECT_DOUBLE_EQ(time_of(times, "total", Part::steady), 3);
  RawTimes by_clips = times;
  by_clips.by = By::clips;
  EXPECT_DOUBLE_EQ(time_of(by_clips, "total"), 82.0 / 4) << "the median clip: 16, 104, 82, 16 or 160";
  // The same from the record, in which numbers are rounded.
  const json record{{"run", "s"}, {"scene", {{"frames", 4}}}, {"times", times_record(measured)}};
  EXPECT_EQ(unusable(json{{"times", times_record(measured)}}).find("times."), std::string::npos);
  EXPECT_DOUBLE_EQ(time_of(record, "total"), 4);
  EXPECT_DOUBLE_EQ(time_of(record, "update"), 2);
  EXPECT_EQ(record.at("times").at("repetitions")[4].at("steady").at("update"), 15);
}

// A neighbour that shares memory takes no time slices, but slows down whole repetitions.
TEST(Times, RepetitionsThatDifferAreDisturbed) {
  const auto times = [](const std::vector<double>& clips) {
    Measured measured;
    for (const double clip : clips) measured.repetitions.push_back(clip_of({clip, clip}, 0));
    return raw_times(measured, "s");
  };
  EXPECT_EQ(doubts(times({4, 4.9, 4.1, 4, 5}), ""), "") << "quartiles: 4 and 4.9";
  EXPECT_EQ(doubts(times({4, 5.2, 4.1, 4, 5.3}), ""), "its repetitions differ by a factor of 1.30");
  EXPECT_EQ(doubts(times({4, 4, 4, 4, 40}), "9 involuntary switches"), "9 involuntary switches");
  EXPECT_EQ(doubts(times({4, 40, 4, 40, 40}), "9 involuntary switches"),
            "9 involuntary switches, its repetitions differ by a factor of 10.00");
  EXPECT_EQ(doubts(times({4, 40, 4, 40}), ""), "") << "four have no quartiles";
  const auto record = [&](const RawTimes& raw) {
    json one{{"run", "s"}, {"scene", {{"frames", 2}}}, {"times", {{"disturbed", ""}, {"by", "frames"}}}};
    for (std::size_t r = 0; r < raw.repetitions(); ++r)
      one["times"]["repetitions"].push_back({{"motion", 0},
                                             {"update", raw.totals[r][0]},
                                             {"traversal", 0},
                                             {"triangle_tests", 0},
                                             {"totals", raw.totals[r]},
                                             {"motions", raw.motions[r]}});
    return one;
  };
  EXPECT_EQ(disturbed(record(times({4, 4, 4, 4, 40}))), "");
  EXPECT_EQ(disturbed(record(times({4, 5.2, 4.1, 4, 5.3}))), "its repetitions differ by a factor of 1.30");
}

// If one side is counted by clips, both are.
TEST(Times, RatiosCountBothSidesTheSameWay) {
  Measured one, two;
  for (const double last : {2.0, 2.0, 30.0, 30.0, 30.0}) one.repetitions.push_back(clip_of({2, last}));
  for (const double first : {40.0, 40.0, 4.0, 4.0, 4.0}) two.repetitions.push_back(clip_of({first, 4}));
  const RawTimes frames = raw_times(one, "s");
  RawTimes other = raw_times(two, "s");
  EXPECT_DOUBLE_EQ(ratio_of({frames, "total"}, {other, "total"})->middle, 32.0 / 8);
  other.by = By::clips;
  EXPECT_DOUBLE_EQ(ratio_of({frames, "total"}, {other, "total"})->middle, 32.0 / 8);
  RawTimes shifted = other;
  for (std::size_t r = 0; r < 5; ++r) shifted.totals[r] = {r % 2 == 0 ? 9.0 : 1.0, r % 2 == 0 ? 1.0 : 9.0};
  shifted.by = By::frames;
  EXPECT_DOUBLE_EQ(time_of(shifted, "total"), 5);
  shifted.totals[0] = {1, 1};
  shifted.totals[1] = {1, 1};
  EXPECT_DOUBLE_EQ(ratio_of({shifted, "total"}, {frames, "total"})->middle, 2.0 / 32);
  EXPECT_DOUBLE_EQ(ratio_of({shifted, "total"}, {other, "total"})->middle, 10.0 / 8);
}

TEST(Times, FewerThanFiveRepetitionsHaveARange) {
  const auto times = [](std::size_t repetitions, double first) {
    Measured measured;
    for (std::size_t r = 0; r < repetitions; ++r)
      measured.repetitions.push_back(clip_of({r == 0 ? first : 4.0}));
    return raw_times(measured, "s");
  };
  const auto within = [&](std::size_t repetitions) {
    return ratio_of({times(repetitions, 4), "total"}, {times(repetitions, 8), "total"})->within;
  };
  EXPECT_FALSE(within(1).has_value());
  for (const std::size_t few : {2u, 3u, 4u}) {
    ASSERT_TRUE(within(few).has_value());
    EXPECT_FALSE(within(few)->is_interval);
    EXPECT_DOUBLE_EQ(within(few)->low, 0.5);
    EXPECT_DOUBLE_EQ(within(few)->high, 1);
  }
  ASSERT_TRUE(within(9).has_value());
  EXPECT_TRUE(within(9)->is_interval);
  EXPECT_DOUBLE_EQ(within(9)->low, 1) << "one of nine repetitions is never the median of a resample";
  EXPECT_DOUBLE_EQ(within(9)->high, 1);
}

TEST(Rounds, AreShuffledBySeed) {
  std::set<std::vector<std::size_t>> orders;
  for (std::uint32_t round = 0; round < 20; ++round) {
    std::vector<std::size_t> order = shuffled(6, 7, round);
    EXPECT_EQ(order, shuffled(6, 7, round));
    EXPECT_NE(order, shuffled(6, 8, round)) << round;
    orders.insert(order);
    std::sort(order.begin(), order.end());
    EXPECT_EQ(order, (std::vector<std::size_t>{0, 1, 2, 3, 4, 5}));
  }
  EXPECT_GT(orders.size(), 15u);
  // Pinned: a different order is a different measurement.
  EXPECT_EQ(shuffled(6, 7, 0), (std::vector<std::size_t>{3, 4, 2, 0, 1, 5}));
}

TEST(Rounds, GoOnUntilIntervalsAreNarrow) {
  const auto times = [](std::size_t repetitions, double scatter) {
    Measured measured;
    for (std::size_t r = 0; r < repetitions; ++r)
      measured.repetitions.push_back(clip_of({4 + scatter * double(r % 3), 4 + scatter * double(r % 2)}));
    return raw_times(measured, "s");
  };
  const auto narrow = [&](std::size_t repetitions, double scatter, double width) {
    const RawTimes both[] = {times(repetitions, 0), times(repetitions, scatter)};
    const std::uint8_t baselines[] = {1, 0};
    return narrow_enough(both, baselines, width);
  };
  EXPECT_TRUE(narrow(5, 0, 0.05));
  EXPECT_FALSE(narrow(4, 0, 0.05)) << "too few for an interval";
  EXPECT_FALSE(narrow(5, 4, 0.05));
  EXPECT_TRUE(narrow(5, 4, 5));
  const RawTimes alone[] = {times(5, 4)};
  const std::uint8_t none[] = {0};
  EXPECT_FALSE(narrow_enough(alone, none, 0.05));
  EXPECT_TRUE(narrow_enough(alone, none, 5));
}

TEST(Times, ABeginningIsPaidForFromAFrameOn) {
  Measured own, refit;
  own.repetitions = {clip_of({10, 1, 1, 1, 7, 1, 1, 1, 1})};
  refit.repetitions = {clip_of({4, 4, 4, 4, 4, 4, 4, 4, 4})};
  const RawTimes a = raw_times(own, "s"), b = raw_times(refit, "s");
  EXPECT_EQ(paid_from(a, 0, b, 0), std::optional<std::size_t>(2));
  EXPECT_EQ(paid_from(a, 1, b, 0), std::optional<std::size_t>(5)) << "frame 4 takes back what 3 had paid";
  EXPECT_EQ(paid_from(a, 100, b, 0), std::nullopt);
  EXPECT_EQ(paid_from(b, 0, b, 0), std::optional<std::size_t>(0));
}

TEST(Effort, SaysWhyTimesAreDisturbed) {
  Effort effort{.wall = 1, .processor = 0.999, .thread = 0.999};
  EXPECT_EQ(disturbance(effort), "");
  effort.switches = 25;
  EXPECT_EQ(disturbance(effort), "25 involuntary switches, 25 a second");
  effort = {.wall = 1, .processor = 0.5, .thread = 0.5};
  EXPECT_EQ(disturbance(effort), "it waited for a processor 50 % of the time");
  effort.processor = 1.5;
  EXPECT_EQ(disturbance(effort), "") << "several threads wait for each other";
  effort.steal = 0.02;
  EXPECT_EQ(disturbance(effort), "a hypervisor withheld processors for 20 ms");
}

}  // namespace
}  // namespace kbvh::experiments::results_test
