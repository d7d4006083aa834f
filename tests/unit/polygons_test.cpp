// Polygons of more than three corners: how they are cut, that the cut does not depend on the list, and that
// the union of the triangles is the polygon's even-odd region.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <set>

#include "core/geometry/polygon_cut.hpp"
#include "core/judge/oracle.hpp"
#include "core/judge/polygon_region.hpp"
#include "core/judge/probe_oracle.hpp"
#include "core/scene/cut_polygons.hpp"
#include "core/scene/geometry_change.hpp"
#include "core/topology/renumber.hpp"
#include "tests/support/rational_geometry.hpp"
#include "tests/support/synthetic_scenes.hpp"

namespace kbvh::polygons_test {
namespace {

using test::dot;
using test::exact;
using test::Random;
using Ids = std::vector<std::uint32_t>;
using Triangle = std::array<std::uint32_t, 3>;
using Points = std::vector<double>;  // [corner][3]

struct Polygon {
  Ids ids;
  Points points;  ///< [id][3]

  std::vector<std::array<double, 3>> corners() const {
    std::vector<std::array<double, 3>> list;
    for (const std::uint32_t id : ids)
      list.push_back({points[3 * id], points[3 * id + 1], points[3 * id + 2]});
    return list;
  }
};

Polygon polygon(Points points) {
  Polygon made{Ids(points.size() / 3), std::move(points)};
  std::iota(made.ids.begin(), made.ids.end(), 0U);
  return made;
}

/// The triangles as sets of ids.
std::multiset<Triangle> triangles_of(const PolygonCut& cut) {
  std::multiset<Triangle> made;
  for (std::size_t i = 0; i < cut.corners.size(); i += 3) {
    Triangle triangle{cut.corners[i], cut.corners[i + 1], cut.corners[i + 2]};
    std::sort(triangle.begin(), triangle.end());
    made.insert(triangle);
  }
  return made;
}

/// Twice the signed area of a list of corners, in the projection along a vector.
using Vector = test::RationalPoint;
Vector area_vector(const Polygon& polygon, std::span<const std::uint32_t> ids) {
  Vector sum;
  for (std::size_t i = 0; i < ids.size(); ++i)
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto at = [&](std::size_t corner, std::size_t a) {
        return exact(polygon.points[3 * ids[corner % ids.size()] + a % 3]);
      };
      sum[axis] += at(i, axis + 1) * at(i + 1, axis + 2) - at(i, axis + 2) * at(i + 1, axis + 1);
    }
  return sum;
}

/// Checks that all triangles turn with the polygon. Their boundaries add up to that of the polygon, so a
/// point inside a polygon that winds once lies in one of them, and a point outside in none.
::testing::AssertionResult turns_with_the_polygon(const Polygon& polygon, const PolygonCut& cut) {
  const Vector area = area_vector(polygon, polygon.ids);
  for (std::size_t i = 0; i < cut.corners.size(); i += 3)
    if (dot(area, area_vector(polygon, cut.corners.subspan(i, 3))) < 0)
      return ::testing::AssertionFailure() << "triangle " << i / 3 << " turns against the polygon";
  return ::testing::AssertionSuccess();
}

/// Checks k - 2 triangles that use all ids, and the same ones from every first corner in both directions.
void expect_cut_once(PolygonCutter& cutter, const Polygon& made) {
  const PolygonCut cut = cutter.cut(made.ids, made.points.data());
  ASSERT_EQ(cut.corners.size(), 3 * (made.ids.size() - 2));
  EXPECT_EQ(std::set<std::uint32_t>(cut.corners.begin(), cut.corners.end()),
            std::set<std::uint32_t>(made.ids.begin(), made.ids.end()));
  const auto expected = triangles_of(cut);
  const bool crosses = cut.crosses;
  Ids list = made.ids;
  for (int direction = 0; direction < 2; ++direction) {
    for (std::size_t i = 0; i < list.size(); ++i) {
      std::rotate(list.begin(), list.begin() + 1, list.end());
      const PolygonCut other = cutter.cut(list, made.points.data());
      ASSERT_EQ(triangles_of(other), expected) << "first corner " << list[0] << ", direction " << direction;
      ASSERT_EQ(other.crosses, crosses);
    }
    std::reverse(list.begin(), list.end());
  }
}

/// A polygon of small whole numbers in a plane z = a x + b y + c, in one of three orders of axes.
Polygon in_a_plane(Random& random, std::size_t corners, std::uint32_t grid) {
  const int a = int(random.below(5)) - 2, b = int(random.below(5)) - 2, c = int(random.below(3));
  const std::size_t turn = random.below(3);
  Points points;
  for (std::size_t i = 0; i < corners; ++i) {
    const int x = int(random.below(grid)), y = int(random.below(grid));
    const double p[3] = {double(x), double(y), double(a * x + b * y + c)};
    for (std::size_t axis = 0; axis < 3; ++axis) points.push_back(p[(axis + turn) % 3]);
  }
  Polygon made = polygon(std::move(points));
  for (std::size_t i = corners; i > 1; --i)
    std::swap(made.ids[i - 1], made.ids[random.below(std::uint32_t(i))]);
  return made;
}

/// Returns whether a point lies inside by even-odd; corners are [corner][2], none of them at the point's
/// height.
bool even_odd(const std::vector<std::array<long, 2>>& corners, const std::array<long, 2>& point) {
  bool inside = false;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const auto &a = corners[i], &b = corners[(i + 1) % corners.size()];
    const bool above_a = a[1] > point[1], above_b = b[1] > point[1];
    const long turn = (b[0] - a[0]) * (point[1] - a[1]) - (b[1] - a[1]) * (point[0] - a[0]);
    if (above_a != above_b && (above_b ? turn > 0 : turn < 0)) inside = !inside;
  }
  return inside;
}

/// Checks for a planar polygon of whole numbers that the union of its triangles is its even-odd region: at
/// one point of each unit square, seen along an axis.
void expect_union_by_even_odd(const Polygon& made, const PolygonCut& cut) {
  const Vector area = area_vector(made, made.ids);
  std::size_t axis = 0;
  while (axis < 3 && area[axis] == 0) ++axis;
  if (axis == 3) return;
  constexpr long scale = 1009;  // no line through the corners meets the points
  const auto seen = [&](std::uint32_t id) {
    return std::array{scale * long(made.points[3 * id + (axis + 1) % 3]),
                      scale * long(made.points[3 * id + (axis + 2) % 3])};
  };
  std::vector<std::array<long, 2>> corners;
  for (const std::uint32_t id : made.ids) corners.push_back(seen(id));
  const auto [left, right] = std::minmax_element(corners.begin(), corners.end());
  for (long x = (*left)[0] + 37; x < (*right)[0]; x += scale)
    for (long y = -40 * scale + 229; y < 40 * scale; y += scale) {
      bool in_one = false;
      for (std::size_t i = 0; i < cut.corners.size(); i += 3)
        in_one = in_one ||
                 even_odd({seen(cut.corners[i]), seen(cut.corners[i + 1]), seen(cut.corners[i + 2])}, {x, y});
      ASSERT_EQ(in_one, even_odd(corners, {x, y})) << x << ", " << y;
    }
}

/// A simple polygon of many corners on a spiral or a comb.
Polygon spiral(std::size_t corners) {
  Points points;
  for (int side = 0; side < 2; ++side)
    for (std::size_t i = 0; i < corners / 2; ++i) {
      const std::size_t j = side == 0 ? i : corners / 2 - 1 - i;
      const double angle = 0.05 * double(j), radius = 1 + 0.05 * double(j) + (side == 0 ? 0 : 0.3);
      points.insert(points.end(), {radius * std::cos(angle), radius * std::sin(angle), 0});
    }
  return polygon(std::move(points));
}
Polygon comb(std::size_t corners) {
  Points points;
  for (std::size_t i = 0; i + 2 < corners; ++i)
    points.insert(points.end(), {double(i), i % 2 == 0 ? 1.0 : 9.0, 0});
  points.insert(points.end(), {double(corners), 0, 0, 0, 0, 0});
  return polygon(std::move(points));
}

TEST(PolygonCut, OfAChevronKeepsItsNotch) {
  const Points chevron{0, 0, 0, 2, 3, 0, 0, 1, 0, -2, 3, 0};
  PolygonCutter cutter;
  const Polygon made = polygon(chevron);
  const PolygonCut cut = cutter.cut(made.ids, chevron.data());
  EXPECT_EQ(triangles_of(cut), (std::multiset<Triangle>{{0, 1, 2}, {0, 2, 3}}));
  EXPECT_FALSE(cut.crosses);
  EXPECT_EQ(cut.bent, 0);
  expect_cut_once(cutter, made);
}

TEST(PolygonCut, OfAConvexPolygonIsTheFanOfItsSmallestId) {
  Points points;
  for (int i = 0; i < 7; ++i) points.insert(points.end(), {double(i), double(i * i), 3.0 * i - i * i});
  PolygonCutter cutter;
  const Ids ids{3, 4, 5, 6, 0, 1, 2};
  std::multiset<Triangle> fan;
  for (std::uint32_t i = 1; i < 6; ++i) fan.insert({0, i, i + 1});
  EXPECT_EQ(triangles_of(cutter.cut(ids, points.data())), fan);
}

TEST(PolygonCut, DependsNeitherOnTheFirstCornerNorOnTheDirection) {
  PolygonCutter cutter;
  Random random(1);
  std::size_t simple = 0, crossing = 0, without_area = 0;
  for (int i = 0; i < 6000; ++i) {
    Polygon made = in_a_plane(random, 4 + random.below(i % 4 == 0 ? 2 : 6), 2 + random.below(6));
    if (i % 4 == 1)  // corners are repeated, in the list or by position
      for (std::uint32_t& id : made.ids)
        if (random.below(4) == 0) id = random.below(std::uint32_t(made.ids.size()));
    if (i % 4 == 2)  // bent
      for (double& x : made.points) x += double(random.below(3));
    if (i % 4 == 3)  // not whole: nearly planar
      for (double& x : made.points) x = x * 0.1 + 0.7;
    SCOPED_TRACE(i);
    expect_cut_once(cutter, made);
    if (HasFatalFailure()) return;
    const PolygonCut cut = cutter.cut(made.ids, made.points.data());
    if (i % 4 < 2 && !cut.crosses) expect_union_by_even_odd(made, cut);
    if (HasFatalFailure()) return;
    crossing += cut.crosses ? 1 : 0;
    without_area += area_vector(made, made.ids) == Vector{} ? 1 : 0;
    if (!PolygonRegion::of(made.corners())) continue;
    ++simple;
    ASSERT_FALSE(cut.crosses);
    ASSERT_TRUE(turns_with_the_polygon(made, cut));
  }
  EXPECT_GT(simple, 300U);
  EXPECT_GT(crossing, 500U);
  EXPECT_GT(without_area, 100U);
}

TEST(PolygonCut, AwkwardOnesHaveTheirTriangles) {
  PolygonCutter cutter;
  const double huge = 1e100, small = 5e-324;
  const std::vector<Points> all{
      {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0},                      // one point
      {0, 0, 0, 1, 1, 1, 2, 2, 2, 3, 3, 3, 1, 1, 1},             // one line
      {0, 0, 0, 2, 2, 0, 2, 0, 0, 0, 2, 0},                      // a bow tie without an area vector
      {0, 0, 0, 3, 3, 0, 3, 0, 0, 0, 2, 0},                      // with one
      {0, 0, 0, 1, 0, 0, 2, 0, 0, 2, 2, 0, 0, 2, 0},             // a flat corner
      {0, 0, 0, 2, 0, 0, 4, 0, 0, 2, 0, 0, 2, 2, 0},             // a spike
      {0, 0, 0, huge, 0, 0, huge, huge, 0, 0, huge, huge},       // of the largest numbers
      {0, 0, 0, small, 0, 0, small, small, 0, 0, small, 0},      // of the smallest
      {0, 0, 0, huge, 0, small, huge, huge, small, 0, huge, 0},  // of both
      {0, 0, 0, 1, 0, 1, 1, 1, 0, 0, 1, 1},                      // a saddle
      {0, 0, 0, 0.1, 0.1, 0.1, 0.2, 0.2, 0.2, 0.3, 0.3, 0.3, 0.7, 0.7, 0.7},  // nearly one line
  };
  for (const Points& points : all) {
    SCOPED_TRACE(&points - all.data());
    expect_cut_once(cutter, polygon(points));
  }
  const Polygon bow = polygon(all[2]), line = polygon(all[1]), saddle = polygon(all[9]);
  EXPECT_TRUE(cutter.cut(bow.ids, bow.points.data()).crosses);
  EXPECT_FALSE(cutter.cut(line.ids, line.points.data()).crosses);
  EXPECT_GT(cutter.cut(saddle.ids, saddle.points.data()).bent, 0.1);
  expect_cut_once(cutter, {{0, 0, 0, 0, 0}, {1, 2, 3}});
  // A hole, joined to the outside by a doubled edge: corners 0 and 4 are repeated.
  const Polygon hole{{0, 1, 2, 3, 0, 4, 7, 6, 5, 4}, {0, 0, 0, 9, 0, 0, 9, 9, 0, 0, 9, 0,  //
                                                      3, 3, 0, 6, 3, 0, 6, 6, 0, 3, 6, 0}};
  expect_cut_once(cutter, hole);
  const PolygonCut cut = cutter.cut(hole.ids, hole.points.data());
  EXPECT_FALSE(cut.crosses);
  EXPECT_TRUE(turns_with_the_polygon(hole, cut));
}

TEST(PolygonCut, TakesAsManyCornersAsThereMayBe) {
  PolygonCutter cutter;
  for (const Polygon& made : {spiral(4094), comb(4095)}) {
    const PolygonCut cut = cutter.cut(made.ids, made.points.data());
    ASSERT_EQ(cut.corners.size(), 3 * (made.ids.size() - 2));
    EXPECT_FALSE(cut.crosses);
    EXPECT_TRUE(turns_with_the_polygon(made, cut));
  }
}

// ---- The union is the polygon -----------------------------------------------------------------------------

template <class S>
Scene<S> scene_of(const std::vector<Polygon>& polygons) {
  Scene<S> scene;
  for (const Polygon& made : polygons) {
    Body<S> body;
    body.primitives.add(made.ids);
    body.plans = FlightPlans<S>(std::uint32_t(made.points.size() / 3), {0.0},
                                std::vector<S>(made.points.begin(), made.points.end()));
    scene.bodies.push_back(std::move(body));
  }
  scene.pairs = all_pairs(scene.bodies);
  validate(scene);
  cut_polygons(scene);
  return scene;
}

template <class S>
bool meet(const Scene<S>& scene, std::uint32_t a, std::uint32_t b) {
  TriangleTestStats stats;
  const auto position_of = [&](std::uint32_t body) {
    return [&, body](std::uint32_t v) { return scene.bodies[body].plans.keyframe(0) + std::size_t(3) * v; };
  };
  return polygons_intersect<S>(scene.bodies[a].primitives.triangles(0), position_of(a),
                               scene.bodies[b].primitives.triangles(0), position_of(b), stats);
}

TEST(Polygons, MeetAndAreMetByRaysLikeTheirRegions) {
  Random random(5);
  std::vector<Polygon> made;
  std::vector<PolygonRegion> regions;
  while (made.size() < 120) {
    Polygon next = in_a_plane(random, 3 + random.below(6), 7);
    auto region = PolygonRegion::of(next.corners());
    if (!region) continue;
    made.push_back(std::move(next));
    regions.push_back(std::move(*region));
  }
  const Scene<float> scene = scene_of<float>(made);
  std::size_t pairs = 0, hits = 0;
  for (std::uint32_t a = 0; a < made.size(); ++a)
    for (std::uint32_t b = a + 1; b < made.size(); ++b) {
      const bool truth = regions[a].meets(regions[b]);
      ASSERT_EQ(meet(scene, a, b), truth) << a << " and " << b;
      pairs += truth ? 1 : 0;
    }
  for (int i = 0; i < 400; ++i) {
    Ray<float> ray{};
    for (int axis = 0; axis < 3; ++axis) {
      ray.origin[axis] = float(random.below(9)) - 1;
      ray.direction[axis] = float(int(random.below(5)) - 2);
    }
    if (i % 3 == 0) ray.length = float(random.below(4));
    for (std::uint32_t a = 0; a < made.size(); ++a) {
      TriangleTestStats stats;
      RaySearch<float> search(ray, RayQuery::any);
      const bool truth = regions[a].meets(search.line());
      ASSERT_EQ(search.offer(0, 0, scene.bodies[a].primitives.triangles(0), scene.bodies[a].plans.keyframe(0),
                             stats),
                truth)
          << "ray " << i << ", polygon " << a;
      hits += truth ? 1 : 0;
    }
  }
  EXPECT_GT(pairs, 500U);
  EXPECT_GT(hits, 500U);
}

const Points chevron{0, 0, 0, 2, 3, 0, 0, 1, 0, -2, 3, 0};
/// The same chevron, rotated by one corner: 1 is the reflex corner.
const Points turned{2, 3, 0, 0, 1, 0, -2, 3, 0, 0, 0, 0};
const Points post{0, 2, -1, 0.125, 2, 1, -0.125, 2, 1};

TEST(Polygons, OfEveryFirstCornerHaveTheSamePairsAndHits) {
  Ids ids{0, 1, 2, 3};
  for (int direction = 0; direction < 2; ++direction) {
    for (int first = 0; first < 4; ++first) {
      std::rotate(ids.begin(), ids.begin() + 1, ids.end());
      const auto scene = scene_of<float>({{ids, chevron}, polygon(post)});
      Playback<float> playback(scene);
      EXPECT_TRUE(brute_force_pairs(scene, playback).empty()) << "first corner " << ids[0];
      const std::vector<Ray<float>> rays{{{0, 2, -1}, {0, 0, 1}, 1.5F}, {{0, 0.5F, -1}, {0, 0, 1}, 1.5F}};
      std::vector<RayHit> hits(rays.size());
      brute_force_hits<float>(scene, playback, RayQuery::closest, rays, std::span<RayHit>(hits));
      EXPECT_EQ(hits[0].body, 1U) << "first corner " << ids[0];  // the post, through the notch
      EXPECT_EQ(hits[1].body, 0U) << "first corner " << ids[0];
    }
    std::reverse(ids.begin(), ids.end());
  }
}

/// The oracle uses the cut, too, so check that a wrong cut does not pass.
TEST(Polygons, TheOracleFindsAWrongCut) {
  auto scene = scene_of<float>({polygon(chevron), polygon(post)});
  Playback<float> playback(scene);
  const Ray<float> ray{{0, 2, -1}, {0, 0, 1}, 1.5F};
  std::vector<RayHit> hits(1), truth(1);
  brute_force_hits<float>(scene, playback, RayQuery::closest, {&ray, 1}, std::span<RayHit>(truth));
  PolygonCuts& cuts = scene.bodies[0].primitives.cuts;
  cuts.corners = {1, 2, 3, 1, 3, 0};  // like a fan of corner 1 or 3
  EXPECT_TRUE(meet(scene, 0, 1));
  EXPECT_TRUE(brute_force_pairs(scene, playback).empty());
  EXPECT_TRUE(sweep_pairs(scene, playback).empty());
  brute_force_hits<float>(scene, playback, RayQuery::closest, {&ray, 1}, std::span<RayHit>(hits));
  EXPECT_NE(hits[0], truth[0]);
  cuts.times[0] = -1;  // cut at another time: the union is the truth
  EXPECT_EQ(brute_force_pairs(scene, playback).size(), 1U);
}

TEST(Polygons, KeepTheirTrianglesWhileTheyMove) {
  Scene<double> scene = scene_of<double>({polygon(chevron)});
  Points both = chevron;
  both.insert(both.end(), turned.begin(), turned.end());
  scene.bodies[0].plans = FlightPlans<double>(4, {0.0, 1.0}, both);
  scene.bodies[0].primitives.cuts = {};
  EXPECT_THROW(Playback<double>{scene}, std::invalid_argument);
  EXPECT_EQ(cut_polygons(scene).cut, 1U);
  EXPECT_EQ(cut_polygons(scene).cut, 0U);  // only once
  Playback<double> playback(scene);
  playback.seek(1);
  playback.evaluate_all();
  const PolygonTriangles triangles = scene.bodies[0].primitives.triangles(0);
  EXPECT_EQ(triangles.count(), 2U);
  EXPECT_EQ(triangles[0], (Triangle{0, 1, 2}));
  EXPECT_EQ(triangles[1], (Triangle{0, 2, 3}));
}

TEST(Polygons, AreCutWhereTheyAreInserted) {
  Points twice = chevron;
  twice.insert(twice.end(), turned.begin(), turned.end());
  Scene<float> scene;
  Body<float> body;
  body.primitives.add(Ids{0, 1, 2});
  body.plans = FlightPlans<float>(4, {0.0, 1.0}, std::vector<float>(twice.begin(), twice.end()));
  scene.bodies.push_back(std::move(body));
  for (const double t : {0.0, 1.0}) {
    Playback<float> playback(scene);
    playback.seek(t);
    ChangingScene<float> changing(scene);
    GeometryChange<float> change;
    change.primitives.push_back({0, {0, 1, 2, 3}});
    change.primitives.push_back({0, {0, 1, 3}});
    changing.apply(change, playback);
    const Primitives& primitives = changing.scene().bodies[0].primitives;
    const PolygonTriangles triangles = primitives.triangles(1);
    EXPECT_EQ(triangles.count(), 2U);
    std::set<Triangle> found;
    for (std::uint32_t i = 0; i < 2; ++i) {
      Triangle triangle = triangles[i];
      std::sort(triangle.begin(), triangle.end());
      found.insert(triangle);
    }
    if (t == 0)
      EXPECT_EQ(found, (std::set<Triangle>{{0, 1, 2}, {0, 2, 3}}));
    else
      EXPECT_EQ(found, (std::set<Triangle>{{0, 1, 3}, {1, 2, 3}}));
    EXPECT_EQ(primitives.cuts.times[1], t);
    EXPECT_EQ(primitives.triangles(2)[0], (Triangle{0, 1, 3}));
  }
}

TEST(Polygons, KeepTheirTrianglesUnderOtherIds) {
  Random random(9);
  std::vector<Polygon> made;
  while (made.size() < 40) {
    Polygon next = in_a_plane(random, 4 + random.below(5), 7);
    for (double& x : next.points) x += double(random.below(4));  // bent: another cut would differ
    made.push_back(std::move(next));
  }
  const Scene<float> scene = scene_of<float>(made);
  const auto renumbered = renumber_in_leaf_order(scene, BuilderConfig{});
  for (std::uint32_t body = 0; body < made.size(); ++body) {
    const Primitives &before = scene.bodies[body].primitives,
                     &after = renumbered.scene.bodies[body].primitives;
    ASSERT_EQ(after.triangles(0).count(), before.triangles(0).count());
    for (std::uint32_t i = 0; i < before.triangles(0).count(); ++i)
      for (std::size_t c = 0; c < 3; ++c)
        EXPECT_EQ(renumbered.old_vertex[body][after.triangles(0)[i][c]], before.triangles(0)[i][c]);
  }
}

TEST(Polygons, OfTrianglesAloneAreNotCut) {
  const Scene<float> scene = scene_of<float>({polygon(post)});
  EXPECT_TRUE(scene.bodies[0].primitives.cuts.first.empty());
  EXPECT_TRUE(scene.bodies[0].primitives.cuts.corners.empty());
}

}  // namespace
}  // namespace kbvh::polygons_test
