// The suite can fail for refits of moving regions: one in its simplest form, without a fault and with a
// seeded fault. (family_faults_test.cpp: other families.)

#include <gtest/gtest.h>

#include "core/families/wide/moving_region.hpp"
#include "core/families/wide/stored_hierarchy.hpp"
#include "tests/conformance/check.hpp"
#include "tests/support/grids.hpp"

namespace kbvh::test::region_faults_test {
namespace {

enum class RegionFault : std::uint8_t {
  none,
  forgotten_end,   // vertices that moved in the previous segment do not reach its end
  no_parents,      // only nodes with leaves are refitted
  early_region,    // the region of a segment is used in the next one
  missing_corner,  // every fourth marked node is left out
};

template <RegionFault fault>
struct Regions {
  template <class S>
  class Strategy : public StoredHierarchyStrategy<S> {
    using Base = StoredHierarchyStrategy<S>;

   public:
    static constexpr Foresight foresight = Foresight::whole_clip;
    Strategy(const SceneView<S>& scene, const ClipMotion<S>& motion, Topologies topologies,
             const Params& params)
        : Base(scene, motion, std::move(topologies), params), motion_(motion), regions_(scene.body_count()) {
      for (std::uint32_t body = 0; body < scene.body_count(); ++body)
        regions_[body].assign(this->hierarchies_[body], scene.vertex_count(body));
    }

   private:
    /// Refits, at each frame, what moves in the segments of this and of the last frame.
    void update(std::uint32_t body) override {
      auto& hierarchy = this->hierarchies_[body];
      if (hierarchy.empty()) return;
      const FlightPlans<S>& plans = motion_.plans(body);
      const auto times = plans.keyframe_times();
      const std::size_t before = plans.segment_at(this->previous_time()),
                        now = plans.segment_at(this->time());
      marks_.assign(hierarchy.node_count(), 0);
      for (std::size_t k = fault == RegionFault::forgotten_end ? now : before; k <= now; ++k) {
        const std::size_t from = fault == RegionFault::early_region && k > 0 ? k - 1 : k;
        if (from + 1 == times.size()) continue;
        regions_[body].mark(hierarchy, plans.keyframe(from), plans.keyframe(from + 1), one_);
        for (std::size_t node = 0; node < marks_.size(); ++node) marks_[node] |= one_[node];
      }
      const WideNode* const nodes = hierarchy.arrays().nodes;
      for (std::size_t node = 0; node < marks_.size(); ++node) {
        if (fault == RegionFault::no_parents && nodes[node].leaf_count < nodes[node].count) marks_[node] = 0;
        if (fault == RegionFault::missing_corner && node % 4 == 3) marks_[node] = 0;
      }
      regions_[body].take(hierarchy, marks_);
      regions_[body].refit(hierarchy, this->sampled_.positions(body));
    }
    ClipMotion<S> motion_;
    std::vector<MovingRegion<S>> regions_;
    typename MovingRegion<S>::Marks marks_, one_;
  };
};

/// Two crossing sheets; in each segment, ten of 289 vertices of each move.
template <class S>
TestScene<S> moving_in_places() {
  constexpr std::uint32_t side = 17, keyframes = 6;
  TestScene<S> test;
  for (int b = 0; b < 2; ++b) {
    Random random(std::uint64_t(3 + b));
    std::vector<S> row, positions;
    for (std::uint32_t i = 0; i < side * side; ++i) {
      const double x = i % side, y = i / side;
      for (const double value : {x, b == 0 ? y : 8.3, b == 0 ? 0.1 : y - 8.1})
        row.push_back(S(value + 0.05 * random.unit()));
    }
    std::vector<double> times;
    for (std::uint32_t k = 0; k < keyframes; ++k) {
      times.push_back(k / 30.0);
      positions.insert(positions.end(), row.begin(), row.end());
      for (int i = 0; i < 10; ++i)
        for (std::uint32_t v = random.below(side * side), axis = 0; axis < 3; ++axis)
          row[3 * v + axis] = S(double(row[3 * v + axis]) + 1.5 * random.unit());
    }
    Body<S> body;
    body.name = "sheet";
    body.plans = FlightPlans<S>(side * side, times, std::move(positions));
    add_grid_triangles(body.primitives, side - 1);
    test.scene.bodies.push_back(std::move(body));
  }
  test.scene.pairs = all_pairs(test.scene.bodies);
  return test;
}

/// Returns the first violation.
template <class S, RegionFault fault>
std::string violation(std::uint32_t width) {
  Info info;
  info.id = "faulty";
  info.topology.preferred = {.method = BuildMethod::median, .width = width, .leaf_size = 2};
  return check(make_entry<Regions<fault>::template Strategy>(info), moving_in_places<S>(), 7, {},
               info.topology.preferred);
}
template <RegionFault fault>
void expect_caught() {
  for (const std::uint32_t width : {2u, 8u}) {
    EXPECT_NE((violation<float, fault>(width)), "") << width;
    EXPECT_NE((violation<double, fault>(width)), "") << width;
  }
}

TEST(RegionFaults, SoundRegionsPass) {
  for (const std::uint32_t width : {2u, 4u, 8u}) {
    EXPECT_EQ((violation<float, RegionFault::none>(width)), "") << width;
    EXPECT_EQ((violation<double, RegionFault::none>(width)), "") << width;
  }
}
TEST(RegionFaults, WhatMovedBeforeDoesNotReachItsEnd) {
  expect_caught<RegionFault::forgotten_end>();
}
TEST(RegionFaults, BoxesAboveAreNotRefitted) {
  expect_caught<RegionFault::no_parents>();
}
TEST(RegionFaults, TheRegionOfTheSegmentBefore) {
  expect_caught<RegionFault::early_region>();
}
TEST(RegionFaults, NodesLeftOut) {
  expect_caught<RegionFault::missing_corner>();
}

}  // namespace
}  // namespace kbvh::test::region_faults_test
