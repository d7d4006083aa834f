// The wide traversal of rays: every set of kernels, width and leaf size against all primitives, and blocks of
// rays that never lose a box.

#include "core/families/wide/wide_rays.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <cstdint>
#include <limits>
#include <random>
#include <span>
#include <vector>

#include "core/judge/probe_oracle.hpp"
#include "core/kernels/kernel_set.hpp"
#include "core/topology/builders.hpp"
#include "tests/support/polygon_soups.hpp"
#include "tests/support/ray_sets.hpp"

namespace kbvh::wide_rays_test {
namespace {

/// Answers of wide hierarchies over all bodies of a scene, made by one set of kernels.
template <class S>
std::vector<RayHit> wide_hits(const Scene<S>& scene, Playback<S>& playback, const BuilderConfig& builder,
                              KernelSet set, RayQuery query, std::span<const Ray<S>> rays,
                              std::uint64_t& tests) {
  const SceneView<S> view(scene);
  std::vector<WideHierarchy<S>> hierarchies(scene.bodies.size());
  for (std::uint32_t body = 0; body < hierarchies.size(); ++body) {
    const auto boxes = primitive_boxes(view.primitives(body), playback.positions(body));
    hierarchies[body].assign(build_topology<S>(boxes, builder), view.primitives(body), set);
    hierarchies[body].refit(playback.positions(body));
  }
  WideProbes<S> wide(view, SampledMotion<S>(playback));
  std::vector<RayHit> hits(rays.size());
  TriangleTestStats stats;
  wide.answer(
      RayProbes<S>{query, rays, hits},
      [&](std::uint32_t body) -> WideSide<S> {
        return {&hierarchies[body], body};
      },
      stats, tests);
  return hits;
}

template <class S>
void check_wide_rays() {
  std::uint64_t hit = 0;
  for (const std::uint32_t primitives : {1U, 7U, 90U}) {
    test::Random random(primitives);
    const Scene<S> scene = test::polygon_soups<S>(primitives, random);
    Playback<S> playback(scene);
    playback.evaluate_all();
    const std::vector<Ray<S>> rays = test::rays_at(scene, playback, 24, primitives);
    for (const std::uint32_t width : {2U, 4U, 8U})
      for (const std::uint32_t leaf : {1U, 3U, 5U, 16U})
        for (const RayQuery query : {RayQuery::closest, RayQuery::any}) {
          std::uint64_t first_tests = 0;
          for (const KernelSet set : supported_kernel_sets()) {
            std::uint64_t tests = 0;
            const std::vector<RayHit> hits =
                wide_hits<S>(scene, playback, {.method = BuildMethod::sah, .width = width, .leaf_size = leaf},
                             set, query, rays, tests);
            const ProbeCheck check =
                check_hits<S>(scene, playback, query, rays, std::span<const RayHit>(hits));
            ASSERT_TRUE(check.holds()) << name(set) << ", width " << width << ", leaf " << leaf << ", "
                                       << primitives << ": " << check.first_violation;
            hit += check.hits;
            // All sets of kernels visit the same boxes.
            if (first_tests == 0) first_tests = tests;
            ASSERT_EQ(tests, first_tests) << name(set);
          }
        }
  }
  EXPECT_GT(hit, 5000U);
}

TEST(WideProbes, EveryKernelAnswersLikeAllPrimitivesInFloat) {
  check_wide_rays<float>();
}
TEST(WideProbes, EveryKernelAnswersLikeAllPrimitivesInDouble) {
  check_wide_rays<double>();
}

/// Boxes and rays of small integers, on some axes in units so small that directions cannot be inverted: each
/// ray passes through a point of its block's box, and others miss it.
template <class S>
void screen_keeps_rays_that_meet() {
  std::mt19937 random(11);
  const auto between = [&](int low, int high) { return low + int(random() % unsigned(high - low + 1)); };
  const S small = std::numeric_limits<S>::denorm_min() * 16;
  for (const KernelSet set : supported_kernel_sets()) {
    std::size_t rejected = 0;
    for (int round = 0; round < 2000; ++round) {
      S unit[3];
      int lower[3], upper[3];
      std::vector<S> rows(48, std::numeric_limits<S>::infinity());
      for (int axis = 0; axis < 3; ++axis) {
        unit[axis] = between(0, 2) == 0 ? small : S(1);
        lower[axis] = between(-8, 8);
        upper[axis] = lower[axis] + between(0, 3);
        rows[std::size_t(axis) * 8] = S(lower[axis]) * unit[axis];
        rows[std::size_t(axis + 3) * 8] = -S(upper[axis]) * unit[axis];
      }
      WideRayBlock<S> rays{};
      std::uint64_t through = 0;
      for (std::size_t i = 0; i < rays.size; ++i) {
        const int steps = between(0, 5), aside = between(0, 3) == 0 ? 7 : 0;
        if (aside == 0) through |= std::uint64_t(1) << i;
        rays.length[i] = between(0, 1) == 0 ? std::numeric_limits<S>::infinity() : S(steps);
        for (std::size_t axis = 0; axis < 3; ++axis) {
          const int direction = between(-2, 2), point = between(lower[axis], upper[axis]) + aside;
          rays.direction[axis][i] = S(direction) * unit[axis];
          rays.origin[axis][i] = S(point - steps * direction) * unit[axis];
        }
      }
      const std::uint64_t met = wide_ray_kernels<S>(set).screen(rays, rows.data(), 1);
      ASSERT_EQ(through & ~met, 0u) << name(set) << ", round " << round;
      rejected += std::size_t(std::popcount(~met));
    }
    EXPECT_GT(rejected, 10000u) << name(set);
  }
}
TEST(WideProbes, BlocksKeepRaysThatMeetABoxInFloat) {
  screen_keeps_rays_that_meet<float>();
}
TEST(WideProbes, BlocksKeepRaysThatMeetABoxInDouble) {
  screen_keeps_rays_that_meet<double>();
}

}  // namespace
}  // namespace kbvh::wide_rays_test
