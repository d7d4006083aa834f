// Answers as changes, of every registered strategy and adapter on every synthetic scene: their sum equals the
// strategy's full answers and the truth. Some frames are skipped, different ones for candidates and for
// pairs; full answers are requested in between; the clip is played up to a frame, and then again from the
// start.

#include <gtest/gtest.h>

#include <set>

#include "core/judge/sort_pairs.hpp"
#include "core/judge/verify_changes.hpp"
#include "core/scene/pair_difference.hpp"
#include "tests/conformance/check.hpp"

namespace kbvh::test {
namespace {

template <class S>
std::string check_changes(const StrategyEntry& entry, const TestScene<S>& test, std::uint32_t l,
                          const std::map<std::string, std::string>& params, const BuilderConfig& builder,
                          VerifyChangesOptions::Calls calls = VerifyChangesOptions::Calls::mixed) {
  if (!skipped(entry, test).empty()) return {};
  const std::vector<double> frames = test.frames.empty() ? frame_times(test.scene, l) : test.frames;
  const PlanScript<S>* const script = test.script.steps.empty() ? nullptr : &test.script;
  Session<S> session(test.scene, {&entry, params, builder});
  // A reset forgets the reported pairs, and changes of plans and of geometry.
  const std::size_t some = std::min<std::size_t>(frames.size(), 5);
  for (const std::size_t played : {some, frames.size()}) {
    const ChangesVerification result =
        verify_changes<S>(session, {frames.data(), played}, shared_oracle(test), script, {1, calls});
    if (!result.first_violation.empty()) return result.first_violation;
  }
  return {};
}

class Changes : public testing::TestWithParam<std::pair<std::string, std::string>> {};

TEST_P(Changes, AddUpToTheAnswers) {
  const auto& [scene_name, id] = GetParam();
  const StrategyEntry& entry = find_strategy(id);
  const BuilderConfig builder = entry.info.topology.preferred;
  // All strategies share one function that compares full answers: few frames suffice to test it.
  const bool compares = !entry.info.can.changes;
  const std::uint32_t l = compares ? 2 : scene_name.find("geometry") != std::string::npos ? 3 : 7;
  const auto in_float = synthetic_scene<float>(scene_name, l);
  const auto in_double = synthetic_scene<double>(scene_name, l);
  EXPECT_EQ(check_changes(entry, in_float, l, {}, builder), "") << id << " on " << scene_name << ", float";
  EXPECT_EQ(check_changes(entry, in_double, l, {}, builder), "") << id << " on " << scene_name << ", double";
}

// Strategies with their own changes, in other configurations: leaves of one primitive, every word of every
// parameter, segments of many frames and of one, a query at every frame.
TEST_P(Changes, OfOwnMaking) {
  const auto& [scene_name, id] = GetParam();
  const StrategyEntry& entry = find_strategy(id);
  if (!entry.info.can.changes) GTEST_SKIP() << "compares full answers";
  const bool scripted = scene_name.find("changes") != std::string::npos;
  const auto expect = [&](std::uint32_t l, const std::map<std::string, std::string>& params,
                          const BuilderConfig& builder, VerifyChangesOptions::Calls calls) {
    const auto in_float = synthetic_scene<float>(scene_name, l);
    const auto in_double = synthetic_scene<double>(scene_name, l);
    std::string where = id + " on " + scene_name + ", l = " + std::to_string(l);
    for (const auto& [key, value] : params) where += ", " + key + " = " + value;
    EXPECT_EQ(check_changes(entry, in_float, l, params, builder, calls), "") << where << ", float";
    EXPECT_EQ(check_changes(entry, in_double, l, params, builder, calls), "") << where << ", double";
  };
  using Calls = VerifyChangesOptions::Calls;
  const BuilderConfig preferred = entry.info.topology.preferred;
  BuilderConfig small = preferred;
  small.leaf_size = std::max(1u, entry.info.topology.min_leaf_size);
  for (const std::uint32_t l : {1u, 20u}) {
    if (scripted && l > 1) continue;
    expect(l, {}, preferred, Calls::mixed);
    expect(l, {}, small, Calls::every_frame);
  }
  for (const Parameter& parameter : entry.info.parameters)
    for (const std::string& word : parameter.allowed)
      expect(scripted ? 2 : 7, {{parameter.name, word}}, preferred, Calls::mixed);
}

std::vector<std::pair<std::string, std::string>> scenes_with_contestants() {
  std::vector<std::pair<std::string, std::string>> cases;
  for (const std::string& scene : all_synthetic_names()) {
    const auto in_float = synthetic_scene<float>(scene);
    const auto in_double = synthetic_scene<double>(scene);
    for (const StrategyEntry& entry : registry())
      if (skipped(entry, in_float).empty() || skipped(entry, in_double).empty())
        cases.emplace_back(scene, entry.info.id);
  }
  return cases;
}

INSTANTIATE_TEST_SUITE_P(Registry, Changes, testing::ValuesIn(scenes_with_contestants()),
                         [](const auto& test) { return test.param.second + "_on_" + test.param.first; });

// --- the replay and the comparison of answers can fail

PrimitivePair pair_of(std::uint32_t a, std::uint32_t b) {
  return {0, a, 1, b};
}

TEST(ChangeReplay, FindsFaults) {
  ChangeReplay replay;
  EXPECT_EQ(replay.add({pair_of(3, 1), pair_of(1, 1)}, {}), "");
  EXPECT_EQ(replay.pairs(), (PairBuffer{pair_of(1, 1), pair_of(3, 1)}));
  EXPECT_EQ(replay.add({pair_of(2, 2), pair_of(2, 2)}, {}), "pair (0:2, 1:2) begins twice");
  EXPECT_EQ(replay.add({pair_of(1, 1)}, {}), "pair (0:1, 1:1) begins while it lasts");
  EXPECT_EQ(replay.add({pair_of(1, 1)}, {pair_of(1, 1)}), "pair (0:1, 1:1) begins while it lasts");
  EXPECT_EQ(replay.add({}, {pair_of(1, 1), pair_of(1, 1)}), "pair (0:1, 1:1) ends twice");
  EXPECT_EQ(replay.add({}, {pair_of(4, 4)}), "pair (0:4, 1:4) ends without a begin");
  EXPECT_EQ(replay.add({pair_of(4, 4)}, {pair_of(4, 4)}), "pair (0:4, 1:4) ends without a begin");
  EXPECT_EQ(replay.add({pair_of(4, 4)}, {pair_of(1, 1)}), "");
  EXPECT_EQ(replay.pairs(), (PairBuffer{pair_of(3, 1), pair_of(4, 4)}));
}

enum class Fault : std::uint8_t {
  none,
  lost_end,
  begins_twice,
  lost_begin,
  end_of_nothing,
  stale_after_reset
};

/// Tests all pairs of primitives, and finds changes in its own way, with a fault in the fourth answer.
template <class S, Fault fault>
class FaultyChanges : public CountedStrategy<S>, public AnswersChanges<S> {
 public:
  static constexpr Foresight foresight = Foresight::none;
  FaultyChanges(const SceneView<S>& scene, const SampledMotion<S>& motion, Topologies, const Params&)
      : CountedStrategy<S>(scene, motion) {}
  void reset_to(double /*t*/) override {
    if (fault == Fault::stale_after_reset) return;
    last_[0].clear();
    last_[1].clear();
  }
  void advance_to(double /*t*/) override {}
  QueryStatus find_candidates(double /*t*/, PairBuffer& out, const Budget& /*none*/) override {
    for (const BodyPair& pair : this->scene_.pairs())
      for (std::uint32_t a = 0; a < this->scene_.primitives(pair.first).count(); ++a)
        for (std::uint32_t b = 0; b < this->scene_.primitives(pair.second).count(); ++b)
          out.push_back({pair.first, a, pair.second, b});
    return {};
  }
  void find_changes(double t, Answer answer, PairBuffer& begun, PairBuffer& ended) override {
    PairBuffer now, &last = last_[std::size_t(answer)];
    find_candidates(t, now, {});
    if (answer == Answer::pairs) this->confirm_candidates(t, now);
    PairDifference().find(last, now, begun, ended);
    last = now;
    if (answer != Answer::pairs) return;
    if (fault == Fault::lost_end && !ended.empty() && ++faults_ == 2) ended.pop_back();
    if (fault == Fault::begins_twice && !begun.empty() && ++faults_ == 3) begun.push_back(begun.front());
    if (fault == Fault::lost_begin && !begun.empty() && ++faults_ == 3) begun.pop_back();
    if (fault == Fault::end_of_nothing && !begun.empty() && ++faults_ == 3) ended.push_back(begun.front());
  }
  std::size_t bytes() const override { return 0; }

 private:
  PairBuffer last_[2];
  int faults_ = 0;
};

template <Fault fault>
std::string violation() {
  static const StrategyEntry entry = [] {
    StrategyEntry made;
    made.info = {.id = "faulty_changes", .title = "faulty", .family = "oracle"};
    made.make_double = [](const SceneView<double>& scene, Playback<double>& playback, Topologies topologies,
                          const Params& params) -> std::unique_ptr<Strategy<double>> {
      return std::make_unique<FaultyChanges<double, fault>>(scene, SampledMotion<double>(playback),
                                                            std::move(topologies), params);
    };
    return made;
  }();
  const auto test = synthetic_scene<double>("soups", 7);
  return check_changes(entry, test, 7, {}, {.method = BuildMethod::median, .width = 8, .leaf_size = 4},
                       VerifyChangesOptions::Calls::every_frame);
}

TEST(ChangesFaults, AreCaught) {
  EXPECT_EQ(violation<Fault::none>(), "");
  const auto expect = [](const std::string& violation, const char* words) {
    EXPECT_NE(violation.find(words), std::string::npos) << "'" << violation << "', not '" << words << "'";
  };
  expect(violation<Fault::lost_end>(), "has not ended");
  expect(violation<Fault::begins_twice>(), "begins twice");
  expect(violation<Fault::lost_begin>(), "has not begun");
  expect(violation<Fault::end_of_nothing>(), "ends without a begin");
  expect(violation<Fault::stale_after_reset>(), "ends without a begin");
}

// --- comparison of two answers

PairBuffer sorted(PairBuffer pairs) {
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

// Short and long lists, in which pairs differ in every byte or only in a few.
TEST(SortPairs, EqualsTheStandardSort) {
  Random random(11);
  for (const std::size_t size : {0, 1, 2, 127, 128, 129, 1000, 5000})
    for (const std::uint32_t mask : {0xffffffffu, 0x00ff00ffu, 0x80000001u, 3u}) {
      PairBuffer pairs;
      const auto word = [&] { return (random.below(1u << 16) << 16 | random.below(1u << 16)) & mask; };
      for (std::size_t i = 0; i < size; ++i) pairs.push_back({word(), word(), word(), word()});
      const PairBuffer expected = sorted(pairs);
      sort_pairs(pairs);
      ASSERT_EQ(pairs, expected) << size;
    }
}

/// Random answers of several lengths, in equal and in different orders, with few and many differences.
TEST(PairDifference, EqualsThatOfSets) {
  Random random(7);
  PairDifference difference;
  for (int round = 0; round < 400; ++round) {
    const std::uint32_t range = 1 + random.below(round % 2 == 0 ? 60 : 5000);
    std::set<PrimitivePair> all;
    for (std::uint32_t i = random.below(2 * range); i-- > 0;)
      all.insert({random.below(2), random.below(range), 2 + random.below(2), random.below(range)});
    PairBuffer order(all.begin(), all.end()), before, after;
    for (std::size_t i = order.size(); round % 3 != 0 && i > 1; --i)
      std::swap(order[i - 1], order[random.below(std::uint32_t(i))]);
    const std::uint32_t out_of = 2 + random.below(200);
    for (const PrimitivePair& pair : order) {
      if (random.below(out_of) != 0) before.push_back(pair);
      if (random.below(out_of) != 0) after.push_back(pair);
    }
    if (round % 5 == 0) std::rotate(after.begin(), after.begin() + after.size() / 3, after.end());
    if (round % 7 == 0) std::reverse(after.begin(), after.end());
    PairBuffer begun, ended, expected_begun, expected_ended;
    difference.find(before, after, begun, ended);
    const PairBuffer a = sorted(before), b = sorted(after);
    std::set_difference(b.begin(), b.end(), a.begin(), a.end(), std::back_inserter(expected_begun));
    std::set_difference(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(expected_ended));
    ASSERT_EQ(sorted(begun), expected_begun) << round;
    ASSERT_EQ(sorted(ended), expected_ended) << round;
  }
}

TEST(PairSet, EqualsTheStandardOne) {
  Random random(11);
  PairSet set;
  std::set<PrimitivePair> expected;
  for (int round = 0; round < 20000; ++round) {
    if (round % 7000 == 6999) {
      set.clear();
      expected.clear();
    }
    const PrimitivePair pair{0, random.below(30), 1, random.below(30)};
    if (random.below(2) == 0)
      ASSERT_EQ(set.insert(pair), expected.insert(pair).second);
    else
      ASSERT_EQ(set.erase(pair), expected.erase(pair) == 1);
    ASSERT_EQ(set.size(), expected.size());
    if (round % 100 != 0) continue;
    PairBuffer all;
    set.append_to(all);
    ASSERT_EQ(sorted(all), PairBuffer(expected.begin(), expected.end()));
  }
}

}  // namespace
}  // namespace kbvh::test
