// A verification reports exactly the errors that were made: by a contestant that loses known pairs at known
// frames, by one that adds some, and for triangles of known penetration. With all dials at zero, approximate
// contestants are exact.

#include <gtest/gtest.h>

#include <cmath>

#include "core/families/wide/stored_hierarchy.hpp"
#include "core/judge/penetration.hpp"
#include "tests/conformance/check.hpp"

namespace kbvh::test::error_measures {
namespace {

/// A scene with the times of its frames.
template <class S>
TestScene<S> scene_with_frames(const std::string& name, std::uint32_t l) {
  TestScene<S> test = synthetic_scene<S>(name, l);
  if (test.frames.empty()) test.frames = frame_times(test.scene, l);
  return test;
}

enum class Error { loses_the_last_from_the_third_frame_on, adds_one_at_every_frame };

/// An exact refit that confirms too few pairs, or one too many.
template <class S, Error error>
class Wrong : public StoredHierarchyStrategy<S> {
  using Base = StoredHierarchyStrategy<S>;

 public:
  static constexpr Foresight foresight = Foresight::none;
  using Base::Base;
  void reset_to(double t) override {
    frame_ = 0;
    Base::reset_to(t);
  }
  void advance_to(double t) override {
    ++frame_;
    Base::advance_to(t);
  }
  void confirm_candidates(double t, PairBuffer& pairs) override {
    const PairBuffer candidates = pairs;
    Base::confirm_candidates(t, pairs);
    std::sort(pairs.begin(), pairs.end());
    if (error == Error::loses_the_last_from_the_third_frame_on) {
      if (frame_ >= 3 && !pairs.empty()) pairs.resize(pairs.size() - 1);
      return;
    }
    for (const PrimitivePair& pair : candidates)
      if (!std::binary_search(pairs.begin(), pairs.end(), pair)) return pairs.push_back(pair);
  }

 private:
  void update(std::uint32_t body) override { this->refit(body); }
  std::uint64_t frame_ = 0;
};
template <class S>
using Loses = Wrong<S, Error::loses_the_last_from_the_third_frame_on>;
template <class S>
using Adds = Wrong<S, Error::adds_one_at_every_frame>;

Info info() {
  return {.id = "wrong",
          .title = "wrong",
          .family = "approximate",
          .citation = "this test",
          .guarantee = Guarantee::approximate,
          .topology = {.preferred = {.width = 2, .leaf_size = 1}}};
}

template <class S>
Verification verified(const StrategyEntry& entry, const TestScene<S>& test, std::uint64_t every = 1,
                      const std::map<std::string, std::string>& params = {}) {
  Session<S> session(test.scene, {&entry, params, entry.info.topology.preferred});
  return verify<S>(session, std::span<const double>(test.frames), shared_oracle(test), nullptr,
                   {.every_nth_frame = every, .areas = Areas::left_out});
}

template <class S>
void expect_known_errors() {
  const TestScene<S> test = scene_with_frames<S>("soups", 3);
  Oracle<S>& oracle = shared_oracle(test);
  // The lost pairs, computed from the truth itself: the last pair of every frame with pairs, from the third
  // on.
  Playback<S> playback(test.scene);
  std::uint64_t lost = 0, first = 0, pairs = 0;
  Penetration deepest;
  double sum = 0;
  for (std::size_t f = 0; f < test.frames.size(); ++f) {
    playback.seek(test.frames[f]);
    playback.evaluate_all();
    const PairBuffer& truth = oracle.pairs(playback);
    pairs += truth.size();
    if (f < 3 || truth.empty()) continue;
    if (lost++ == 0) first = f;
    const Penetration one = penetration(test.scene, playback, truth.back());
    deepest = {std::max(deepest.depth, one.depth), std::max(deepest.in_edges, one.in_edges)};
    sum += one.depth;
  }
  ASSERT_GT(lost, 5u);
  const Verification found = verified(make_entry<Loses>(info()), test);
  EXPECT_EQ(found.pairs, pairs);
  EXPECT_EQ(found.missed, lost);
  EXPECT_EQ(found.extra, 0u);
  EXPECT_EQ(found.missed_candidates, 0u);
  EXPECT_EQ(found.wrong_frames, lost);
  EXPECT_EQ(found.first_missed, first);
  EXPECT_EQ(found.missed_deepest.depth, deepest.depth);
  EXPECT_EQ(found.missed_deepest.in_edges, deepest.in_edges);
  EXPECT_EQ(found.missed_depth_sum, sum);
  EXPECT_GT(found.missed_deepest.depth, 0);
  EXPECT_TRUE(found.holds()) << "an approximate contestant promises nothing";

  // The unit is frames, not comparisons.
  const Verification sampled = verified(make_entry<Loses>(info()), test, 5);
  ASSERT_TRUE(sampled.first_missed.has_value());
  EXPECT_EQ(*sampled.first_missed % 5, 0u);
  EXPECT_GE(*sampled.first_missed, first);
  EXPECT_LT(sampled.missed, lost);

  const Verification added = verified(make_entry<Adds>(info()), test);
  EXPECT_EQ(added.missed, 0u);
  EXPECT_FALSE(added.first_missed.has_value());
  EXPECT_GT(added.extra, 5u);
  EXPECT_EQ(added.extra, added.wrong_frames);
  EXPECT_EQ(added.missed_depth_sum, 0);
}

TEST(ErrorMeasures, CountWhatWasLostAndAdded) {
  expect_known_errors<float>();
  expect_known_errors<double>();
}

using Triangle = double[3][3];

TEST(ErrorMeasures, PenetrationOfTrianglesIsTheShortestWayOut) {
  const Triangle floor = {{-10, -10, 0}, {10, -10, 0}, {0, 10, 0}};
  for (const double depth : {0.25, 1e-6, 2.0}) {
    const Triangle spike = {{0, 0, -depth}, {0.5, 0, 5}, {-0.5, 0, 5}};
    EXPECT_DOUBLE_EQ(penetration_depth(floor, spike), depth);
    EXPECT_DOUBLE_EQ(penetration_depth(spike, floor), depth);
    // Far away, the way out is the same up to roundings.
    Triangle a, b;
    for (int i = 0; i < 3; ++i)
      for (int axis = 0; axis < 3; ++axis) {
        a[i][axis] = floor[i][axis] * 1e60;
        b[i][axis] = spike[i][axis] * 1e60;
      }
    EXPECT_NEAR(penetration_depth(a, b) / 1e60, depth, depth * 1e-9);
  }
  // Across an edge of each: a blade over the edge of another, 0.125 deep.
  const Triangle roof = {{-4, 0, 0}, {4, 0, 0}, {0, 0, -8}},
                 blade = {{0, -4, -0.125}, {0, 4, -0.125}, {0, 0, 8}};
  EXPECT_DOUBLE_EQ(penetration_depth(roof, blade), 0.125);
  // Contact in a point, apart, coplanar, and without an area.
  const Triangle touching = {{0, 0, 0}, {1, 0, 5}, {-1, 0, 5}}, above = {{0, 0, 1}, {1, 0, 5}, {-1, 0, 5}},
                 inside = {{-1, -1, 0}, {1, -1, 0}, {0, 1, 0}}, point = {{1, 1, 0}, {1, 1, 0}, {1, 1, 0}};
  EXPECT_EQ(penetration_depth(floor, touching), 0);
  EXPECT_EQ(penetration_depth(floor, above), 0);
  EXPECT_EQ(penetration_depth(floor, inside), 0);
  EXPECT_EQ(penetration_depth(floor, point), 0);
}

// A translation slightly longer than the way out separates, a slightly shorter one does not, by the exact
// test.
TEST(ErrorMeasures, PenetrationAgreesWithTheExactTest) {
  std::uint64_t state = 7, tried = 0;
  const auto next = [&] {
    state = state * 6364136223846793005ULL + 1442695040888963407ULL;
    return double(state >> 11) / 9007199254740992.0;
  };
  while (tried < 200) {
    Triangle a, b;
    for (auto* triangle : {&a, &b})
      for (auto& corner : *triangle)
        for (double& x : corner) x = next();
    if (!triangles_intersect<double>(a[0], a[1], a[2], b[0], b[1], b[2])) {
      EXPECT_EQ(penetration_depth(a, b), 0);
      continue;
    }
    ++tried;
    const double depth = penetration_depth(a, b);
    // No direction is a shorter way out.
    for (int direction = 0; direction < 50; ++direction) {
      double way[3], length = 0;
      for (double& x : way) {
        x = next() - 0.5;
        length += x * x;
      }
      length = std::sqrt(length);
      Triangle moved;
      for (int i = 0; i < 3; ++i)
        for (int axis = 0; axis < 3; ++axis) moved[i][axis] = b[i][axis] + way[axis] / length * depth * 0.999;
      EXPECT_TRUE(triangles_intersect<double>(a[0], a[1], a[2], moved[0], moved[1], moved[2]));
    }
  }
}

/// The settings at which each approximate strategy is exact.
const std::vector<std::pair<std::string, std::map<std::string, std::string>>> exact_dials{
    {"reduced_refit", {}},
    {"reduced_refit", {{"query", "slabs"}}},
    {"reduced_refit", {{"margin", "0.25"}}},
    {"reduced_refit", {{"boxes", "float"}, {"rounding", "outward"}}},
    {"reduced_refit", {{"boxes", "bfloat16"}, {"rounding", "outward"}}},
    {"reduced_refit",
     {{"boxes", "bfloat16"}, {"rounding", "outward"}, {"margin", "0.25"}, {"query", "slabs"}}},
    {"bottom_up_approximate", {{"positions", "rounded"}}},
    {"bottom_up_approximate", {{"positions", "rounded"}, {"tests", "own"}}},
    {"drift_boxes_approximate", {{"believed", "1"}}},
};

template <class S>
void expect_exact(const TestScene<S>& test, const std::string& where) {
  for (const auto& [id, params] : exact_dials) {
    const auto entry = std::find_if(registry().begin(), registry().end(),
                                    [&](const StrategyEntry& one) { return one.info.id == id; });
    if (entry == registry().end()) continue;  // a program with other strategies
    StrategyEntry exact = *entry;
    exact.info.guarantee = Guarantee::exact;
    std::string dials;
    for (const auto& [name, value] : params) dials += " " + name + "=" + value;
    const std::string violation = check(exact, test, 3, params, exact.info.topology.preferred);
    if (violation.rfind("skipped", 0) == 0) continue;
    EXPECT_EQ(violation, "") << id << dials << " on " << where;
  }
}

class DialsAtZero : public testing::TestWithParam<std::string> {};

TEST_P(DialsAtZero, AreExact) {
  expect_exact(synthetic_scene<float>(GetParam(), 3), GetParam() + ", float");
  expect_exact(synthetic_scene<double>(GetParam(), 3), GetParam() + ", double");
}
INSTANTIATE_TEST_SUITE_P(Registry, DialsAtZero, testing::ValuesIn([] {
                           std::vector<std::string> names = synthetic_scene_names();
                           names.insert(names.end(), self_scene_names().begin(), self_scene_names().end());
                           return names;
                         }()),
                         [](const auto& test) { return test.param; });

// When turned up, each dial costs pairs.
TEST(Dials, CostPairsWhenTurned) {
  const TestScene<double> test = scene_with_frames<double>("soups", 7);
  const std::vector<std::pair<std::string, std::map<std::string, std::string>>> turned{
      {"reduced_refit", {{"refit_every", "4"}}},
      {"reduced_refit", {{"refit_every", "4"}, {"query", "slabs"}}},
      {"bottom_up_approximate", {{"boxes", "bfloat16"}, {"tests", "own"}}},
      {"drift_boxes_approximate", {{"believed", "0"}}},
  };
  for (const auto& [id, params] : turned) {
    const Verification found = verified(find_strategy(id), test, 1, params);
    EXPECT_GT(found.missed, 0u) << id;
    EXPECT_TRUE(found.first_missed.has_value()) << id;
    EXPECT_EQ(found.extra > 0, params.count("tests") != 0) << id;
  }
  // Boxes of few digits leave vertices outside; whether this costs a pair is a matter of chance.
  EXPECT_GT(verified(find_strategy("reduced_refit"), test, 1, {{"boxes", "bfloat16"}}).audit.protrusion, 0);
  // A margin recovers some of them, and rarer refits miss more.
  const auto missed = [&](const char* every, const char* margin) {
    return verified(find_strategy("reduced_refit"), test, 1, {{"refit_every", every}, {"margin", margin}})
        .missed;
  };
  EXPECT_LT(missed("4", "1"), missed("4", "0"));
  EXPECT_LT(missed("2", "0"), missed("8", "0"));
}

}  // namespace
}  // namespace kbvh::test::error_measures
