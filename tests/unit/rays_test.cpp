// Rays: the exact test against rational arithmetic, slabs that never lose a box, and searches whose answers
// do not depend on the order of faces. (wide_rays_test.cpp: the wide traversal.)

#include "core/scene/rays.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <optional>
#include <random>
#include <span>
#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "core/geometry/ray_box.hpp"
#include "core/judge/probe_oracle.hpp"
#include "core/scene/playback.hpp"
#include "core/scene/scene.hpp"
#include "tests/support/rational_geometry.hpp"

namespace kbvh::rays_test {
namespace {

using test::exact;
using test::Rational;

/// Returns the first parameter of the ray at which it meets the triangle, by definition: the least s of the
/// points o + s d = a + u (b - a) + v (c - a) with s, u, v >= 0 and u + v <= 1. The minimum is at a corner of
/// this set, where some of the four conditions hold with equality and the solution is unique.
std::optional<Rational> first_meeting(const RayLine& ray, const double* corners) {
  Rational rows[7][4];  // coefficients of s, u, v, and the right side
  for (int axis = 0; axis < 3; ++axis) {
    rows[axis][0] = exact(ray.direction[axis]);
    rows[axis][1] = exact(corners[axis]) - exact(corners[3 + axis]);
    rows[axis][2] = exact(corners[axis]) - exact(corners[6 + axis]);
    rows[axis][3] = exact(corners[axis]) - exact(ray.origin[axis]);
  }
  for (int k = 0; k < 3; ++k)
    for (int c = 0; c < 4; ++c) rows[3 + k][c] = c == k ? 1 : 0;
  rows[6][0] = 0;
  for (int c = 1; c < 4; ++c) rows[6][c] = 1;
  std::optional<Rational> least;
  for (unsigned active = 0; active < 16; ++active) {
    std::vector<std::array<Rational, 4>> system;
    for (unsigned row = 0; row < 7; ++row)
      if (row < 3 || (active >> (row - 3) & 1) != 0)
        system.push_back({rows[row][0], rows[row][1], rows[row][2], rows[row][3]});
    std::size_t rank = 0;
    for (std::size_t column = 0; column < 3; ++column) {
      std::size_t pivot = rank;
      while (pivot < system.size() && system[pivot][column] == 0) ++pivot;
      if (pivot == system.size()) break;
      std::swap(system[pivot], system[rank]);
      for (std::size_t row = 0; row < system.size(); ++row) {
        if (row == rank || system[row][column] == 0) continue;
        const Rational factor = system[row][column] / system[rank][column];
        for (std::size_t c = 0; c < 4; ++c) system[row][c] -= factor * system[rank][c];
      }
      ++rank;
    }
    if (rank < 3) continue;
    bool solved = true;
    for (std::size_t row = 3; row < system.size(); ++row) solved = solved && system[row][3] == 0;
    if (!solved) continue;
    const Rational s = system[0][3] / system[0][0], u = system[1][3] / system[1][1],
                   v = system[2][3] / system[2][2];
    if (s < 0 || u < 0 || v < 0 || u + v > 1) continue;
    if (!least || s < *least) least = s;
  }
  if (least && std::isfinite(ray.length) && *least > exact(ray.length)) return {};
  return least;
}

/// Numbers for rays and triangles, from whole numbers with many coincidences to full mantissas and wide
/// ranges.
class Numbers {
 public:
  Numbers(std::uint32_t seed, int kind) : random_(seed), kind_(kind) {}
  double operator()() {
    switch (kind_) {
      case 0:
        return double(int(random_() % 3)) - 1;
      case 1:
        return double(int(random_() % 9)) - 4;
      case 2:
        return double(float(unit()));
      case 3:
        return unit();
      case 4:
        return std::ldexp(unit(), int(random_() % 60) - 30);
      default:
        return random_() % 4 == 0 ? 0
                                  : std::ldexp(double(int(random_() % 7)) - 3, int(random_() % 300) - 150);
    }
  }
  double unit() { return double(random_()) / double(1U << 31) - 1 + std::ldexp(double(random_()), -60); }
  std::uint32_t below(std::uint32_t n) { return random_() % n; }

 private:
  std::mt19937 random_;
  int kind_;
};

struct Case {
  RayLine ray;
  double corners[2][9];
};

Case make_case(Numbers& number) {
  Case made{};
  for (auto& triangle : made.corners)
    for (double& x : triangle) x = number();
  for (int axis = 0; axis < 3; ++axis) {
    made.ray.origin[axis] = number();
    made.ray.direction[axis] = number();
  }
  made.ray.length = HUGE_VAL;
  const std::uint32_t shape = number.below(8);
  double* first = made.corners[0];
  if (shape < 3)  // at a corner, or at a point of an edge or near it
    for (int axis = 0; axis < 3; ++axis) {
      const double on = shape == 0 ? first[axis] : (first[axis] + first[3 + axis]) / 2;
      made.ray.direction[axis] = on - made.ray.origin[axis];
    }
  if (shape == 3) std::copy_n(first, 3, made.ray.origin);
  if (shape == 4) std::copy_n(first + 3, 3, first + 6);    // a segment
  if (shape == 5) std::copy_n(first, 6, made.corners[1]);  // a common edge
  if (number.below(3) == 0) made.ray.length = std::fabs(number());
  if (number.below(8) == 0) made.ray.length = 1;
  return made;
}

TEST(RayTriangle, DecidesLikeRationalArithmetic) {
  TriangleTestStats stats;
  std::uint64_t met = 0, ties = 0, compared = 0;
  for (int kind = 0; kind < 6; ++kind) {
    Numbers number(std::uint32_t(kind) + 1, kind);
    for (int i = 0; i < 4000; ++i) {
      const Case made = make_case(number);
      std::optional<Rational> truth[2];
      bool both = true;
      for (int k = 0; k < 2; ++k) {
        truth[k] = first_meeting(made.ray, made.corners[k]);
        RayMeeting meeting;
        const bool meets = ray_meets_triangle(made.ray, made.corners[k], meeting, stats);
        ASSERT_EQ(meets, truth[k].has_value()) << "kind " << kind << ", case " << i;
        both = both && meets;
        if (!meets) continue;
        ++met;
        const Rational difference = exact(meeting.parameter) - *truth[k];
        ASSERT_LE(abs(difference), exact(meeting.error)) << "kind " << kind << ", case " << i;
        if (meeting.parameter > 1e-290) {
          ASSERT_LE(meeting.error, 0x1p-41 * meeting.parameter);
        }
      }
      if (!both) continue;
      ++compared;
      const int order = compare_meetings(made.ray, made.corners[0], made.corners[1]);
      ties += order == 0 ? 1 : 0;
      ASSERT_EQ(order < 0, *truth[0] < *truth[1]) << "kind " << kind << ", case " << i;
      ASSERT_EQ(order > 0, *truth[0] > *truth[1]) << "kind " << kind << ", case " << i;
    }
  }
  // The test covers every branch.
  EXPECT_GT(met, 4000U);
  EXPECT_GT(compared, 500U);
  EXPECT_GT(ties, 50U);
  EXPECT_GT(stats.exact, 3000U);
  EXPECT_GT(stats.filtered, 3000U);
}

TEST(RayTriangle, IsSymmetricInItsCorners) {
  TriangleTestStats stats;
  Numbers number(7, 1);
  for (int i = 0; i < 3000; ++i) {
    const Case made = make_case(number);
    RayMeeting first;
    const bool meets = ray_meets_triangle(made.ray, made.corners[0], first, stats);
    std::array<std::size_t, 3> order{0, 1, 2};
    do {
      double turned[9];
      for (std::size_t c = 0; c < 3; ++c) std::copy_n(made.corners[0] + 3 * order[c], 3, turned + 3 * c);
      RayMeeting other;
      ASSERT_EQ(ray_meets_triangle(made.ray, turned, other, stats), meets) << i;
      if (meets) {
        ASSERT_EQ(compare_meetings(made.ray, made.corners[0], turned), 0) << i;
      }
    } while (std::next_permutation(order.begin(), order.end()));
  }
}

TEST(RaySlabs, NeverLoseABox) {
  std::uint64_t met = 0, left_out = 0;
  for (int kind = 0; kind < 6; ++kind) {
    Numbers number(std::uint32_t(kind) + 11, kind);
    for (int i = 0; i < 20000; ++i) {
      const Case made = make_case(number);
      Box<double> box;
      box.extend(made.corners[0]);
      box.extend(made.corners[0] + 3);
      Rational first = 0;
      std::optional<Rational> last;
      if (std::isfinite(made.ray.length)) last = exact(made.ray.length);
      bool meets = true;
      for (int axis = 0; axis < 3; ++axis) {
        const Rational d = exact(made.ray.direction[axis]), o = exact(made.ray.origin[axis]);
        const Rational lower = exact(box.lower[axis]), upper = exact(box.upper[axis]);
        if (d == 0) {
          meets = meets && lower <= o && o <= upper;
          continue;
        }
        Rational enter = (lower - o) / d, leave = (upper - o) / d;
        if (enter > leave) std::swap(enter, leave);
        if (enter > first) first = enter;
        if (!last || leave < *last) last = leave;
      }
      meets = meets && (!last || first <= *last);
      double near = 0;
      const bool found = RaySlabs(made.ray).meet(box, made.ray.length, near);
      ASSERT_TRUE(found || !meets) << "kind " << kind << ", case " << i;
      if (meets && first < Rational(1e300)) {
        ASSERT_TRUE(RaySlabs::within(near, first.convert_to<double>() * (1 + 0x1p-52))) << kind << ", " << i;
      }
      met += meets ? 1 : 0;
      left_out += found ? 0 : 1;
    }
  }
  EXPECT_GT(met, 20000U);
  EXPECT_GT(left_out, 20000U);
}

TEST(RaySearch, OfEqualHitsTheSmallestCounts) {
  const float positions[] = {0, 0, 1, 2, 0, 1, 0, 2, 1};
  const std::vector<std::uint32_t> triangle{0, 1, 2};
  TriangleTestStats stats;
  const Ray<float> ray{{0.5F, 0.5F, 0}, {0, 0, 2}};
  RaySearch<float> search(ray, RayQuery::closest);
  for (const auto& [body, primitive] : {std::pair(1U, 3U), {1U, 2U}, {2U, 0U}, {1U, 4U}})
    EXPECT_FALSE(search.offer(body, primitive, PolygonTriangles(triangle), positions, stats));
  EXPECT_EQ(search.hit(), (RayHit{1, 2, 0.5}));
  RaySearch<float> any(ray, RayQuery::any);
  EXPECT_TRUE(any.offer(4, 4, PolygonTriangles(triangle), positions, stats));
  EXPECT_EQ(any.hit(), (RayHit{4, 4, 0.5}));
}

/// Triangles on shared vertices, several times: `sides` lists each face again with another first corner and
/// in the other direction, `copies` are bodies with their own vertices.
Scene<float> flat_grid(std::uint32_t n, std::uint32_t sides, std::uint32_t copies) {
  Scene<float> scene;
  for (std::uint32_t copy = 0; copy < copies; ++copy) {
    Body<float> body;
    std::vector<float> positions;
    for (std::uint32_t y = 0; y <= n; ++y)
      for (std::uint32_t x = 0; x <= n; ++x)
        positions.insert(positions.end(), {0.3F * float(x), 0.7F * float(y), 0.1F});
    for (std::uint32_t side = 0; side < sides; ++side)
      for (std::uint32_t y = 0; y < n; ++y)
        for (std::uint32_t x = 0; x < n; ++x) {
          const std::uint32_t a = y * (n + 1) + x, b = a + 1, c = a + n + 1, d = c + 1;
          for (const auto& [p, q, r] : {std::tuple(a, b, c), {b, d, c}})
            body.primitives.add(side % 2 == 0 ? std::vector{p, q, r} : std::vector{q, p, r});
        }
    body.plans = FlightPlans<float>((n + 1) * (n + 1), {0}, std::move(positions));
    scene.bodies.push_back(std::move(body));
  }
  return scene;
}

/// Answers a ray by all faces in some order, and counts exact decisions.
RayHit hit_by_all(const Scene<float>& scene, const Ray<float>& ray, std::uint32_t seed,
                  TriangleTestStats& stats) {
  std::vector<std::pair<std::uint32_t, std::uint32_t>> faces;
  for (std::uint32_t body = 0; body < scene.bodies.size(); ++body)
    for (std::uint32_t p = 0; p < scene.bodies[body].primitives.count(); ++p) faces.emplace_back(body, p);
  if (seed == 1) std::reverse(faces.begin(), faces.end());
  if (seed > 1) std::shuffle(faces.begin(), faces.end(), std::mt19937(seed));
  RaySearch<float> search(ray, RayQuery::closest);
  for (const auto& [body, p] : faces)
    search.offer(body, p, scene.bodies[body].primitives.triangles(p), scene.bodies[body].plans.keyframe(0),
                 stats);
  return search.hit();
}

/// Faces that a ray meets at the same place because they share its corners need no arithmetic.
TEST(RaySearch, DecidesFewOfEqualFacesExactly) {
  constexpr std::uint32_t n = 6;
  struct Way {
    const char* name;
    std::uint32_t sides, copies;
  };
  for (const Way& way :
       {Way{"one side", 1, 1}, {"two sides", 2, 1}, {"ten copies", 1, 10}, {"ten of two sides", 2, 10}}) {
    const Scene<float> scene = flat_grid(n, way.sides, way.copies);
    const float* const positions = scene.bodies[0].plans.keyframe(0);
    const auto at = [&](std::uint32_t x, std::uint32_t y) {
      return positions + std::size_t(3) * (y * (n + 1) + x);
    };
    std::vector<Ray<float>> rays[4];  // through interiors, edges, vertices; in the plane
    for (std::uint32_t y = 1; y < n; ++y)
      for (std::uint32_t x = 1; x < n; ++x) {
        const float *v = at(x, y), *w = at(x + 1, y);
        rays[0].push_back({{v[0] + 0.1F, v[1] + 0.1F, 3}, {0.01F, 0.02F, -1}});
        rays[1].push_back({{v[0] + (w[0] - v[0]) / 2, v[1], 3}, {0.03125F, 0, -1}});
        rays[2].push_back({{v[0], v[1], 3}, {0, 0, -2}});
        rays[3].push_back({{-1, v[1], v[2]}, {1, 0, 0}});
      }
    for (std::uint32_t kind = 0; kind < 4; ++kind) {
      TriangleTestStats stats;
      for (const Ray<float>& ray : rays[kind]) {
        TriangleTestStats here;
        const RayHit hit = hit_by_all(scene, ray, 0, kind == 0 ? stats : here);
        EXPECT_TRUE(hit);
        EXPECT_EQ(hit.body, 0U);
        for (std::uint32_t seed = 1; seed < 6; ++seed) EXPECT_EQ(hit_by_all(scene, ray, seed, here), hit);
        if (kind != 0) hit_by_all(scene, ray, 0, stats);
      }
      std::printf("%s, kind %u: %.3g exact decisions a ray\n", way.name, kind,
                  double(stats.ray_decisions) / double(rays[kind].size()));
      if (kind == 3) continue;  // each of the faces in the plane is decided on its own
      EXPECT_LE(stats.ray_decisions, kind == 0 ? 0 : rays[kind].size()) << way.name << ", kind " << kind;
    }
  }
}

/// Triangles over few places, so that many are met at shared corners and edges, equal, degenerate or in the
/// plane of the ray: the answer is the first in real arithmetic, among equals the smallest, in every order,
/// to the last bit.
TEST(RaySearch, AnswersDoNotDependOnTheOrder) {
  std::uint64_t ties = 0, hits = 0;
  TriangleTestStats stats;
  for (int kind = 0; kind < 3; ++kind) {
    std::mt19937 random(std::uint32_t(kind) + 3);
    const auto below = [&](std::uint32_t n) { return std::uint32_t(random() % n); };
    // Whole numbers; the same in units that are not powers of two; with full mantissas.
    const auto place = [&](std::uint32_t i) {
      const double x = double(i);
      return kind == 0 ? x : kind == 1 ? 0.1 * x + 0.7 : std::sqrt(x + 0.3);
    };
    for (int round = 0; round < 150; ++round) {
      std::vector<double> positions;
      for (int i = 0; i < 27; ++i)
        for (const int axis : {i % 3, i / 3 % 3, i / 9}) positions.push_back(place(std::uint32_t(axis)));
      std::vector<std::vector<std::uint32_t>> triangles;
      for (int i = 0; i < 24; ++i) {
        triangles.push_back({below(27), below(27), below(27)});
        if (i % 3 == 0) triangles.push_back({triangles.back()[2], triangles.back()[0], triangles.back()[1]});
        if (i % 5 == 0) triangles.push_back({triangles.back()[1], triangles.back()[0], triangles.back()[2]});
      }
      Ray<double> ray{};
      const double *from = &positions[3 * below(27)], *to = &positions[3 * below(27)];
      for (int axis = 0; axis < 3; ++axis) {
        ray.origin[axis] = round % 2 == 0 ? from[axis] - 2 * (to[axis] - from[axis]) : place(below(7)) - 2;
        ray.direction[axis] = to[axis] - ray.origin[axis];
      }
      if (round % 5 == 0) ray.length = 1;
      const RayLine line = RaySearch<double>(ray, RayQuery::closest).line();
      std::optional<Rational> first;
      std::uint32_t truth = RayHit::none;
      for (std::uint32_t p = 0; p < triangles.size(); ++p) {
        double corners[9];
        for (std::size_t c = 0; c < 3; ++c) std::copy_n(&positions[3 * triangles[p][c]], 3, corners + 3 * c);
        const auto found = first_meeting(line, corners);
        if (found && first && *found == *first) ++ties;
        if (!found || (first && *found >= *first)) continue;
        first = found;
        truth = p;
      }
      std::vector<std::uint32_t> order(triangles.size());
      for (std::uint32_t p = 0; p < order.size(); ++p) order[p] = p;
      RayHit hit;
      for (int shuffle = 0; shuffle < 8; ++shuffle) {
        RaySearch<double> search(ray, RayQuery::closest);
        for (const std::uint32_t p : order)
          search.offer(0, p, PolygonTriangles(triangles[p]), positions.data(), stats);
        if (shuffle == 0) hit = search.hit();
        ASSERT_EQ(search.hit(), hit) << "kind " << kind << ", round " << round << ", order " << shuffle;
        std::shuffle(order.begin(), order.end(), random);
      }
      ASSERT_EQ(hit.primitive, truth) << "kind " << kind << ", round " << round;
      hits += hit ? 1 : 0;
    }
  }
  EXPECT_GT(hits, 200U);
  EXPECT_GT(ties, 300U);
}

/// A parameter that a peer rounds is not a hit of another primitive: the two are counted apart.
TEST(ProbeCheck, TellsAnotherPrimitiveFromAnotherParameter) {
  const Scene<float> scene = flat_grid(1, 1, 1);
  Playback<float> playback(scene);
  playback.evaluate_all();
  const std::vector<Ray<float>> rays{{{0.05F, 0.05F, -0.9F}, {0, 0, 1}}, {{5, 5, 0}, {0, 0, 1}}};
  std::vector<RayHit> truth(2);
  brute_force_hits<float>(scene, playback, RayQuery::closest, rays, std::span<RayHit>(truth));
  ASSERT_EQ(truth[0].primitive, 0U);
  ASSERT_FALSE(truth[1]);
  const auto checked = [&](RayQuery query, const RayHit& first, const RayHit& second) {
    return compare_hits<float>(scene, playback, query, rays, std::vector{first, second}, truth);
  };
  RayHit later = truth[0], other = truth[0];
  later.parameter *= 1 + 0x1p-20;
  other.primitive = 1;
  for (const RayQuery query : {RayQuery::closest, RayQuery::any}) {
    EXPECT_TRUE(checked(query, truth[0], {}).holds());
    const ProbeCheck rounded = checked(query, later, {});
    EXPECT_EQ(std::tuple(rounded.missed, rounded.extra, rounded.misplaced, rounded.rounded),
              std::tuple(0U, 0U, 0U, 1U));
    EXPECT_NEAR(rounded.parameter_error, 0x1p-20, 0x1p-50);
    EXPECT_FALSE(rounded.holds());
    const ProbeCheck misplaced = checked(query, other, {});
    EXPECT_EQ(std::tuple(misplaced.misplaced, misplaced.rounded), std::tuple(1U, 0U));
    EXPECT_EQ(misplaced.parameter_error, 0);
    const ProbeCheck both = checked(query, {}, truth[0]);
    EXPECT_EQ(std::tuple(both.missed, both.extra, both.misplaced, both.rounded), std::tuple(1U, 1U, 0U, 0U));
  }
}

TEST(CheckRays, NamesTheRayAndTheValue) {
  const float nan = std::nanf(""), infinity = HUGE_VALF;
  const auto message = [](const Ray<float>& ray) -> std::string {
    const std::vector<Ray<float>> rays{{{0, 0, 0}, {1, 0, 0}}, ray};
    try {
      check_rays(std::span<const Ray<float>>(rays));
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return {};
  };
  EXPECT_EQ(message({{0, 0, 0}, {0, 0, 0}, 0}), "");
  EXPECT_NE(message({{0, nan, 0}, {1, 0, 0}}).find("ray 1: origin has nan on axis 1"), std::string::npos);
  EXPECT_NE(message({{0, 0, 0}, {1, 0, infinity}}).find("ray 1: direction has inf on axis 2"),
            std::string::npos);
  EXPECT_NE(message({{2e30F, 0, 0}, {1, 0, 0}}).find("origin"), std::string::npos);
  EXPECT_NE(message({{0, 0, 0}, {1, 0, 0}, -1}).find("length -1"), std::string::npos);
  EXPECT_NE(message({{0, 0, 0}, {1, 0, 0}, nan}).find("length nan"), std::string::npos);
}

}  // namespace
}  // namespace kbvh::rays_test
