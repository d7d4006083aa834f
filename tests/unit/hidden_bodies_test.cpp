// Rays among many bodies: a body behind the hits of all rays is neither entered nor made.

#include <gtest/gtest.h>

#include <vector>

#include "core/families/wide/wide_hierarchy.hpp"
#include "core/families/wide/wide_probes.hpp"
#include "core/judge/probe_oracle.hpp"
#include "core/topology/builders.hpp"
#include "core/topology/probe_traversal.hpp"

namespace kbvh::hidden_bodies_test {
namespace {

/// Squares of side 2 across the axis z, one body each, at the given heights, and another one far to the side.
template <class S>
Scene<S> stacked_squares(const std::vector<S>& heights) {
  Scene<S> scene;
  const auto add = [&](S x, S z) {
    Body<S> body;
    body.primitives.add(std::vector<std::uint32_t>{0, 1, 2});
    body.primitives.add(std::vector<std::uint32_t>{0, 2, 3});
    body.plans = FlightPlans<S>(4, {0}, {x - 1, -1, z, x + 1, -1, z, x + 1, 1, z, x - 1, 1, z});
    scene.bodies.push_back(std::move(body));
  };
  for (const S height : heights) add(0, height);
  add(50, 0);
  return scene;
}

template <class S>
std::vector<Ray<S>> upward_rays(S x) {
  std::vector<Ray<S>> rays;
  for (int i = 0; i < 9; ++i) rays.push_back({{x + S(i % 3) / 4, S(i / 3) / 4, -1}, {0, S(0.01), 1}});
  return rays;
}

/// Records the nodes that calls make while they search, by body.
struct Asked {
  RayBodies bodies;
  std::vector<int> made;
};

template <class S>
Asked ask_wide(const Scene<S>& scene, RayQuery query, const std::vector<Ray<S>>& rays,
               std::vector<RayHit>& hits) {
  Playback<S> playback(scene);
  playback.evaluate_all();
  const SceneView<S> view(scene);
  Asked asked{{}, std::vector<int>(scene.bodies.size())};
  std::vector<WideHierarchy<S>> trees(scene.bodies.size());
  std::vector<std::vector<std::uint8_t>> stale(trees.size());
  std::vector<Box<S>> roots;
  for (std::uint32_t body = 0; body < trees.size(); ++body) {
    const auto boxes = primitive_boxes(view.primitives(body), playback.positions(body));
    trees[body].assign(build_topology<S>(boxes, {.width = 2, .leaf_size = 1}), view.primitives(body),
                       active_kernel_set());
    stale[body].assign(trees[body].node_count(), 1);  // and no box is made yet, not even the root's
    roots.push_back(boxes[0]);
    roots.back().extend(boxes[1]);
  }
  WideProbes<S> wide(view, SampledMotion<S>(playback));
  TriangleTestStats stats;
  std::uint64_t tests = 0;
  hits.assign(rays.size(), {});
  wide.answer(
      RayProbes<S>{query, rays, hits},
      [&](std::uint32_t body) {
        WideProbeSide<S> side(&trees[body], stale[body].data());
        side.root = roots[body];
        return side;
      },
      [&](std::uint32_t body, std::uint32_t node) {
        trees[body].refit(playback.positions(body));
        stale[body][node] = 0;
        ++asked.made[body];
      },
      stats, tests, &asked.bodies);
  return asked;
}

template <class S>
void check_stacked_squares() {
  const auto scene = stacked_squares<S>({4, 2, 1, 3, 1});
  Playback<S> playback(scene);
  playback.evaluate_all();
  for (const RayQuery query : {RayQuery::closest, RayQuery::any}) {
    const auto rays = upward_rays<S>(S(-0.4));
    std::vector<RayHit> hits;
    const Asked asked = ask_wide(scene, query, rays, hits);
    EXPECT_TRUE(check_hits<S>(scene, playback, query, std::span<const Ray<S>>(rays), hits).holds());
    // Of two squares in one place, both are entered, unless any hit suffices.
    const std::uint64_t entered = query == RayQuery::closest ? 2 : 1;
    EXPECT_EQ(asked.bodies.entered, entered);
    EXPECT_EQ(asked.bodies.hidden, 5 - entered);
    EXPECT_EQ(asked.bodies.unmet, 1U);
    for (const std::size_t body : {0U, 1U, 3U, 5U}) EXPECT_EQ(asked.made[body], 0) << body;
    EXPECT_EQ(asked.made[2] + asked.made[4], int(entered));

    // The same without wide hierarchies.
    const SceneView<S> view(scene);
    BodyOrder order;
    RayBodies counts;
    std::vector<int> followed(scene.bodies.size());
    std::vector<RayHit> found(rays.size());
    TriangleTestStats stats;
    answer_by_body(
        view, SampledMotion<S>(playback), Probes<S>(RayProbes<S>{query, rays, found}), order, &counts,
        [&](std::uint32_t body) {
          const auto boxes = primitive_boxes(view.primitives(body), playback.positions(body));
          Box<S> box = boxes[0];
          box.extend(boxes[1]);
          return box;
        },
        [&](std::uint32_t body, auto& search, std::uint64_t&) {
          ++followed[body];
          const Primitives& primitives = view.primitives(body);
          for (std::uint32_t p = 0; p < primitives.count(); ++p)
            if (search.offer(body, p, primitives.triangles(p), playback.positions(body), stats)) return true;
          return false;
        });
    EXPECT_TRUE(check_hits<S>(scene, playback, query, std::span<const Ray<S>>(rays), found).holds());
    EXPECT_EQ(counts.entered, entered);
    EXPECT_EQ(counts.hidden, 5 - entered);
    EXPECT_EQ(counts.unmet, 1U);
    for (const std::size_t body : {0U, 1U, 3U, 5U}) EXPECT_EQ(followed[body], 0) << body;
  }
}

TEST(BodiesBehindOthers, AreNeitherEnteredNorMade) {
  check_stacked_squares<float>();
  check_stacked_squares<double>();
}

// Rays that miss the square in front enter the one behind it.
TEST(BodiesBehindOthers, AreEnteredIfOneRayReachesThem) {
  const auto scene = stacked_squares<float>({1, 2});
  auto rays = upward_rays<float>(0);
  rays.push_back({{0, 0, 1.5F}, {0, 0, 1}});
  std::vector<RayHit> hits;
  const Asked asked = ask_wide(scene, RayQuery::closest, rays, hits);
  EXPECT_EQ(asked.bodies.entered, 2U);
  EXPECT_EQ(asked.bodies.hidden, 0U);
  EXPECT_EQ(hits.back().body, 1U);
}

}  // namespace
}  // namespace kbvh::hidden_bodies_test
