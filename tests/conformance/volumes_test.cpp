// The generic refit with every kind of volume over every synthetic scene.

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>

#include "tests/conformance/check.hpp"

namespace kbvh::test::volumes_test {
namespace {

/// Returns the violations in both scalars; nothing if there are none, or if the scene is unsuitable.
std::string violations(const StrategyEntry& entry, const std::string& scene, std::uint32_t l,
                       const std::map<std::string, std::string>& params) {
  const BuilderConfig& builder = entry.info.topology.preferred;
  return check(entry, synthetic_scene<float>(scene, l), l, params, builder) + "|" +
         (in_both_scalars() ? check(entry, synthetic_scene<double>(scene, l), l, params, builder) : "");
}

std::vector<std::string> volume_words() {
  for (const Parameter& parameter : find_strategy("bottom_up_volumes").info.parameters)
    if (parameter.name == "volume") return parameter.allowed;
  return {};
}

class EveryVolume : public testing::TestWithParam<std::tuple<std::string, std::string>> {};

TEST_P(EveryVolume, ConformsOnEveryScene) {
  const auto& [volume, scene] = GetParam();
  const StrategyEntry& entry = find_strategy("bottom_up_volumes");
  EXPECT_EQ(violations(entry, scene, 3, {{"volume", volume}}), "|");
}

INSTANTIATE_TEST_SUITE_P(Registry, EveryVolume,
                         testing::Combine(testing::ValuesIn(volume_words()),
                                          testing::ValuesIn(all_synthetic_names())),
                         [](const auto& test) {
                           return std::get<0>(test.param) + "_on_" + std::get<1>(test.param);
                         });

// Boxes and k-DOPs are tight, although the strategy as a whole declares only that it is conservative; and the
// boxes are those of the reference refit.
TEST(EveryVolume, OfFixedDirectionsIsTight) {
  for (const std::string volume : {"aabb", "dop14", "dop18", "dop26"})
    for (const std::string scene : {"soups", "sheets", "pure_translation_far", "integer_ties"}) {
      const auto test = synthetic_scene<float>(scene, 3);
      const StrategyEntry& entry = find_strategy("bottom_up_volumes");
      Session<float> session(test.scene, {&entry, {{"volume", volume}}, entry.info.topology.preferred});
      Oracle<float> oracle(test.scene);
      const Verification result = verify(session, std::span<const double>(test.frames), oracle);
      EXPECT_TRUE(result.audited);
      EXPECT_EQ(result.audit.not_tight, 0u) << volume << " on " << scene;
      EXPECT_EQ(result.audit.looseness(), 0) << volume << " on " << scene;
    }
}

TEST(EveryVolume, BoxesAreThoseOfTheOtherRefit) {
  const auto test = synthetic_scene<double>("soups", 3);
  const BuilderConfig builder{.method = BuildMethod::median, .width = 2, .leaf_size = 2};
  const StrategyEntry &plain = find_strategy("bottom_up_volumes"), &fast = find_strategy("bottom_up");
  Session<double> one(test.scene, {&plain, {{"volume", "aabb"}}, builder});
  Session<double> other(test.scene, {&fast, {}, builder});
  PhaseTimes times;
  one.reset(test.frames[0]);
  other.reset(test.frames[0]);
  for (const double t : test.frames) {
    one.advance(t, times);
    other.advance(t, times);
    for (std::uint32_t body = 0; body < test.scene.bodies.size(); ++body)
      EXPECT_EQ(one.strategy().audit_view(body)->boxes, other.strategy().audit_view(body)->boxes);
  }
}

// The purpose of these kinds: fewer candidates, for more work.
TEST(EveryVolume, KDopsLeaveFewerCandidatesThanBoxes) {
  const auto candidates = [](const std::string& volume) {
    const auto test = synthetic_scene<float>("soups", 3);
    const StrategyEntry& entry = find_strategy("bottom_up_volumes");
    Session<float> session(test.scene, {&entry, {{"volume", volume}}, entry.info.topology.preferred});
    Oracle<float> oracle(test.scene);
    return verify(session, std::span<const double>(test.frames), oracle).candidates;
  };
  const std::uint64_t box = candidates("aabb"), dop14 = candidates("dop14"), dop26 = candidates("dop26");
  EXPECT_LT(dop14, box);
  EXPECT_LT(dop26, dop14);
  EXPECT_LT(candidates("obb"), box);
}

}  // namespace
}  // namespace kbvh::test::volumes_test
