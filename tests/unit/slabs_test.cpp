// Queries with slabs at the leaves lose no pair of triangles that share a point, for every width, leaf size
// and set of kernels, even where surfaces touch in a tilted plane far from the origin, so that only the slack
// for rounding keeps them; slabs that are stale, or of another leaf, lose some.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/families/slabs/slab_query.hpp"
#include "tests/support/play.hpp"
#include "tests/support/synthetic_scenes.hpp"
#include "tests/support/wide_bodies.hpp"
#include "tests/unit/slab_scenes.hpp"

namespace kbvh::test::slabs_test {
namespace {

template <class S>
struct SlabbedBodies : WideBodies<S> {
  SlabbedBodies(const Scene<S>& of, const BuilderConfig& builder, KernelSet set)
      : WideBodies<S>(of, builder, set), slabs(this->view), blocks(of.bodies.size()) {}
  enum class Blocks : std::uint8_t { current, stale };
  void seek(double t, Blocks what = Blocks::current) {
    WideBodies<S>::seek(t);
    if (what == Blocks::stale) return;
    for (SlabBlocks<S>& one : blocks) one.positions_changed();
  }
  PairBuffer by_boxes() {
    std::uint64_t tests = 0;
    return this->candidates(tests);
  }
  typename SlabQuery<S>::Side slab_side(std::uint32_t body) {
    return {&this->hierarchies[body], body, &blocks[body], this->playback.positions(body)};
  }
  PairBuffer by_slabs(S rounding = SlabQuery<S>::enough_rounding) {
    PairBuffer pairs;
    std::uint64_t tests = 0;
    for (const BodyPair& pair : this->scene.pairs)
      slabs.run(slab_side(pair.first), slab_side(pair.second), pairs, tests, {}, rounding);
    std::sort(pairs.begin(), pairs.end());
    return pairs;
  }
  PairBuffer confirmed(PairBuffer pairs) {
    TriangleTestStats stats;
    confirm_pairs(this->view, this->motion, pairs, stats);
    return pairs;
  }

  SlabQuery<S> slabs;
  std::vector<SlabBlocks<S>> blocks;
};

template <class S>
bool all_triangular(const Scene<S>& scene) {
  return std::all_of(scene.bodies.begin(), scene.bodies.end(),
                     [](const Body<S>& body) { return SlabQuery<S>::accepts(body.primitives); });
}

template <class S>
class SlabsTest : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(SlabsTest, Scalars);

TYPED_TEST(SlabsTest, LosesNoContact) {
  using S = TypeParam;
  Random random(3);
  std::size_t found = 0, candidates = 0, kept = 0;
  std::vector<std::string> names = synthetic_scene_names();
  names.insert(names.end(), self_scene_names().begin(), self_scene_names().end());
  for (const std::string& name : names) {
    const auto test = synthetic_scene<S>(name);
    if (test.script.changes_geometry() || !all_triangular(test.scene)) continue;
    const BuilderConfig builders[] = {{.method = BuildMethod::median, .width = 2, .leaf_size = 3},
                                      {.method = BuildMethod::sah, .width = 4, .leaf_size = 7},
                                      {.method = BuildMethod::median, .width = 8, .leaf_size = 16}};
    for (const BuilderConfig& builder : builders) {
      PairBuffer of_first_set;
      const double t = test.frames[random.below(std::uint32_t(test.frames.size()))];
      for (const KernelSet set : supported_kernel_sets()) {
        SlabbedBodies<S> bodies(test.scene, builder, set);
        bodies.seek(test.frames[0]);
        bodies.by_slabs();
        bodies.seek(t);
        const PairBuffer boxes = bodies.by_boxes(), slabs = bodies.by_slabs();
        ASSERT_TRUE(std::includes(boxes.begin(), boxes.end(), slabs.begin(), slabs.end())) << name;
        ASSERT_EQ(bodies.confirmed(slabs), bodies.confirmed(boxes)) << name << ", width " << builder.width;
        if (set == KernelSet::portable)
          of_first_set = slabs;
        else
          ASSERT_EQ(slabs, of_first_set) << name;
        found += bodies.confirmed(slabs).size();
        candidates += boxes.size();
        kept += slabs.size();
      }
    }
  }
  EXPECT_GT(found, 100U);
  EXPECT_LT(kept, candidates);
}

TYPED_TEST(SlabsTest, SlackKeepsWhatTouches) {
  using S = TypeParam;
  std::size_t lost_without = 0;
  for (const double far : {0.0, 8.0, 512.0})
    for (const std::uint32_t leaf : {4U, 16U}) {
      SlabbedBodies<S> bodies(touching_sheets<S>(far),
                              {.method = BuildMethod::median, .width = 8, .leaf_size = leaf},
                              active_kernel_set());
      bodies.seek(0);
      const PairBuffer truth = bodies.confirmed(bodies.by_boxes());
      EXPECT_GT(truth.size(), 100U);
      EXPECT_EQ(bodies.confirmed(bodies.by_slabs()), truth) << far;
      lost_without += truth.size() - bodies.confirmed(bodies.by_slabs(0)).size();
    }
  EXPECT_GT(lost_without, 0U) << "the fault without slack is not seen";
}

// Rows are padded with the last triangle, which must not count more than the others.
TYPED_TEST(SlabsTest, SlabsAreAcrossTheSumOfTheNormalsOfTheirTriangles) {
  using S = TypeParam;
  const Scene<S> scene = crossing_waves<S>();
  SlabbedBodies<S> bodies(scene, {.method = BuildMethod::median, .width = 8, .leaf_size = 11},
                          active_kernel_set());
  bodies.seek(0);
  bodies.by_slabs();
  const WideHierarchy<S>& hierarchy = bodies.hierarchies[0];
  const S* const positions = bodies.playback.positions(0);
  const SlabLeaves<S> leaves = bodies.blocks[0].of(bodies.hierarchies[0], positions);
  std::size_t padded_leaves = 0;
  for (std::uint32_t leaf = 0; leaf < hierarchy.leaf_count(); ++leaf) {
    if (leaves.stamps[leaf] != leaves.stamp) continue;
    double sum[3] = {0, 0, 0};
    const auto primitives = bodies.hierarchies[0].leaf_primitives(leaf);
    for (const std::uint32_t primitive : primitives) {
      const auto corners = scene.bodies[0].primitives[primitive];
      const S* const p[3] = {positions + std::size_t(3) * corners[0], positions + std::size_t(3) * corners[1],
                             positions + std::size_t(3) * corners[2]};
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const std::size_t j = (axis + 1) % 3, k = (axis + 2) % 3;
        sum[axis] += (double(p[1][j]) - p[0][j]) * (double(p[2][k]) - p[0][k]) -
                     (double(p[1][k]) - p[0][k]) * (double(p[2][j]) - p[0][j]);
      }
    }
    const double size = std::abs(sum[0]) + std::abs(sum[1]) + std::abs(sum[2]);
    const S* const direction = leaves.blocks + leaf * SlabBlock::scalars(hierarchy.padded_leaf_size()) +
                               SlabBlock::rows * hierarchy.padded_leaf_size();
    for (std::size_t axis = 0; axis < 3; ++axis) EXPECT_NEAR(double(direction[axis]), sum[axis] / size, 1e-4);
    padded_leaves += primitives.size() < hierarchy.padded_leaf_size();
  }
  EXPECT_GT(padded_leaves, 10U);
}

TYPED_TEST(SlabsTest, StaleSlabsAndThoseOfOtherLeavesLosePairs) {
  using S = TypeParam;
  const Scene<S> scene = crossing_waves<S>();
  const BuilderConfig builder{.method = BuildMethod::median, .width = 8, .leaf_size = 8};
  using Blocks = typename SlabbedBodies<S>::Blocks;
  std::size_t stale = 0, exchanged = 0;
  for (const double t : {0.5, 1.0, 2.2, 3.0}) {
    SlabbedBodies<S> bodies(scene, builder, active_kernel_set());
    bodies.seek(0);
    bodies.by_slabs();
    bodies.seek(t, Blocks::stale);
    const PairBuffer truth = bodies.confirmed(bodies.by_boxes());
    stale += truth.size() - bodies.confirmed(bodies.by_slabs()).size();
    bodies.seek(t);
    ASSERT_EQ(bodies.confirmed(bodies.by_slabs()), truth);
    const SlabLeaves<S> leaves = bodies.blocks[0].of(bodies.hierarchies[0], bodies.playback.positions(0));
    const std::uint32_t padded = bodies.hierarchies[0].padded_leaf_size();
    const auto slab = [&](std::uint32_t leaf) {
      return leaves.blocks + leaf * SlabBlock::scalars(padded) + SlabBlock::rows * padded;
    };
    const std::uint32_t half = bodies.hierarchies[0].leaf_count() / 2;
    for (std::uint32_t leaf = 0; leaf < half; ++leaf)
      std::swap_ranges(slab(leaf), slab(leaf) + 5, slab(leaf + half));
    exchanged += truth.size() - bodies.confirmed(bodies.by_slabs()).size();
  }
  EXPECT_GT(stale, 0U);
  EXPECT_GT(exchanged, 0U);
}

}  // namespace
}  // namespace kbvh::test::slabs_test
