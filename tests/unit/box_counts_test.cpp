// Counts of box tests: for one tree they are the same under every strategy that searches it in the same way.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>

#include "core/contract/registry.hpp"
#include "tests/support/moving_grids.hpp"

namespace kbvh::test::box_counts_test {
namespace {

constexpr auto waves = [](std::uint32_t i) { return 0.1 * std::sin(0.3 * i); };

/// Returns the box tests of the queries at t = 0, when every tree is new and every box tight, and at 0.5.
std::array<std::uint64_t, 2> box_tests(const std::string& id,
                                       const std::map<std::string, std::string>& params,
                                       const Scene<float>& scene, const Budget& budget = {}) {
  const StrategyEntry& entry = find_strategy(id);
  Session<float> session(scene,
                         {&entry, params, {.method = BuildMethod::median, .width = 8, .leaf_size = 8}});
  PhaseTimes times;
  PairBuffer pairs;
  std::array<std::uint64_t, 2> made{};
  std::uint64_t before = 0;
  session.reset(0);
  for (int frame = 0; frame < 2; ++frame) {
    if (frame == 1) session.advance(0.5, times);
    session.query(pairs, times, budget);
    const std::uint64_t now = session.strategy().counters()[Counter::box_tests];
    made[std::size_t(frame)] = now - before;
    before = now;
  }
  return made;
}

const char* const with_wide_boxes[] = {"bottom_up",
                                       "bottom_up_approximate",
                                       "hybrid",
                                       "special_regions",
                                       "rebuild",
                                       "drift_rebuild",
                                       "partial_rebuild",
                                       "selective_restructuring",
                                       "rotations",
                                       "kinetic_aabb",
                                       "kinetic_aabb_approximate",
                                       "kinetic_envelope",
                                       "kinetic_envelope_ahead",
                                       "kinetic_calendar",
                                       "top_down"};

TEST(BoxCounts, OneTreeOfBoxesTakesTheSameTests) {
  const Scene<float> scene = grids<float>(24, 0.2, waves);
  const auto expected = box_tests("bottom_up", {}, scene);
  EXPECT_GT(expected[1], 1000u);
  for (const char* const id : with_wide_boxes) EXPECT_EQ(box_tests(id, {}, scene), expected) << id;
}

// Trees of one leaf: for any volume, only the primitives' boxes are compared, after the roots. Eight-wide
// layouts, of boxes, spheres and oriented boxes, compare the leaf again as the child of its node, twice.
TEST(BoxCounts, TwoLeavesTakeTheSameTestsOfPrimitives) {
  const Scene<float> scene = grids<float>(2, 0.2, waves);
  const std::uint64_t primitives = 8 + 8 * 8;
  for (const char* const id : with_wide_boxes) EXPECT_EQ(box_tests(id, {}, scene)[0], 3 + primitives) << id;
  for (const char* const id : {"sphere_tree", "oriented_boxes"})
    EXPECT_EQ(box_tests(id, {}, scene)[0], 3 + primitives) << id;
  for (const char* const id : {"bottom_up_volumes", "kdop", "kinetic_kdop"})
    EXPECT_EQ(box_tests(id, {}, scene)[0], 1 + primitives) << id;
}

// Bodies far from each other cost the test of their roots, for any volume.
TEST(BoxCounts, RootsApartTakeOneTest) {
  const Scene<float> scene = grids<float>(24, 20, waves);
  std::vector<std::string> ids(std::begin(with_wide_boxes), std::end(with_wide_boxes));
  ids.insert(ids.end(),
             {"bottom_up_volumes", "kdop", "kinetic_kdop", "sphere_tree", "oriented_boxes", "lbvh", "ploc",
              "binned_sah", "implicit_tree", "dynamic_tree", "reinsertion", "front", "leaf_slabs"});
  for (const std::string& id : ids)
    EXPECT_EQ(box_tests(id, {}, scene), (std::array<std::uint64_t, 2>{1, 1})) << id;
  for (const char* const sides : {"14", "18", "26"})
    EXPECT_EQ(box_tests("kdop", {{"sides", sides}}, scene)[0], 1u) << sides;
}

// Searches of node pairs one by one stop within one pair of nodes or leaves of their budget, which includes
// the tests of primitives' boxes.
TEST(BoxCounts, ABudgetIncludesTheTestsOfPrimitives) {
  const Scene<float> scene = grids<float>(24, 0.2, waves);
  for (const char* const id : {"bottom_up_volumes", "kinetic_kdop"}) {
    const std::uint64_t all = box_tests(id, {}, scene)[1];
    EXPECT_GT(all, 5000u) << id;
    for (const std::uint64_t most : {all / 16, all / 4, all / 2}) {
      const std::uint64_t made = box_tests(id, {}, scene, {most})[1];
      EXPECT_GE(made, most) << id;
      EXPECT_LE(made, most + 8 + 8 * 8) << id << ", of " << all;
    }
  }
}

}  // namespace
}  // namespace kbvh::test::box_counts_test
