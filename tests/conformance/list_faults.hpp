#pragma once
#include <gtest/gtest.h>

#include <string>
#include <utility>

#include "tests/conformance/check.hpp"

namespace kbvh::test {

/// Plays a scene with a strategy without a hierarchy, and returns the first violations in float and in
/// double.
template <template <class> class Strategy>
std::pair<std::string, std::string> violations_without_tree(const char* scene) {
  Info info;
  info.id = "faulty";
  info.tightness = Tightness::none;
  info.topology = {.own = true};
  const StrategyEntry entry = make_entry<Strategy>(info);
  constexpr std::uint32_t l = 7;
  return {check(entry, synthetic_scene<float>(scene, l), l, {}, {}),
          check(entry, synthetic_scene<double>(scene, l), l, {}, {})};
}

/// Expects that the strategy loses a candidate in the scene, in both scalars.
template <template <class> class Strategy>
void expect_lost_candidates(const char* scene) {
  const auto [in_float, in_double] = violations_without_tree<Strategy>(scene);
  EXPECT_NE(in_float.find("not among the candidates"), std::string::npos) << "in float: " << in_float;
  EXPECT_NE(in_double.find("not among the candidates"), std::string::npos) << "in double: " << in_double;
}

/// Expects that the strategy conforms in the scene, in both scalars.
template <template <class> class Strategy>
void expect_sound_candidates(const char* scene) {
  const auto [in_float, in_double] = violations_without_tree<Strategy>(scene);
  EXPECT_EQ(in_float, "") << scene;
  EXPECT_EQ(in_double, "") << scene;
}

}  // namespace kbvh::test
