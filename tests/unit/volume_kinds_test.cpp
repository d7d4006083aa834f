// Properties of single kinds of bounding volumes: tightness, surfaces, and overlap against the exact truth.

#include <gtest/gtest.h>

#include "tests/support/rational_volumes.hpp"

namespace kbvh::test::volume_kinds_test {
namespace {

// Volumes of fixed directions are tight: fitted to their children as to the points.
template <class V>
void expect_tight_from_below() {
  using S = VolumeScalar<V>;
  for_clouds<S>(19, [](const std::vector<S>& points, const std::string& where, Random& random) {
    const std::size_t half = random.below(std::uint32_t(points.size() / 3));
    V parts[2], whole, parent;
    fit(parts[0], PointSet<S>(points.data(), half));
    fit(parts[1], PointSet<S>(at(points, half), points.size() / 3 - half));
    fit(whole, all(points));
    enclose(parent, std::span<const V>(parts, 2));
    ASSERT_TRUE(parent == whole) << where;
  });
}
TEST(FixedDirections, AreTightFromBelow) {
  expect_tight_from_below<Box<float>>();
  expect_tight_from_below<Box<double>>();
  expect_tight_from_below<Dop<float, 14>>();
  expect_tight_from_below<Dop<double, 18>>();
  expect_tight_from_below<Dop<float, 26>>();
  expect_tight_from_below<Dop<double, 26>>();
}

// A side of a k-DOP is the next number outside, no further.
template <class S>
void expect_sides_are_next() {
  for_clouds<S>(23, [](const std::vector<S>& points, const std::string& where, Random&) {
    Dop<S, 26> dop;
    fit(dop, all(points));
    for (std::size_t i = 0; i < dop.slabs; ++i) {
      const auto& n = dop.directions[i];
      Rational least, most;
      for (std::size_t p = 0; p < points.size() / 3; ++p) {
        const RationalPoint point = rational(at(points, p));
        const Rational along = n[0] * point[0] + n[1] * point[1] + n[2] * point[2];
        if (p == 0 || along < least) least = along;
        if (p == 0 || along > most) most = along;
      }
      const S infinity = std::numeric_limits<S>::infinity();
      ASSERT_LE(exact(double(dop.lower[i])), least) << where;
      ASSERT_GE(exact(double(dop.upper[i])), most) << where;
      ASSERT_GT(exact(double(std::nextafter(dop.lower[i], infinity))), least) << where;
      ASSERT_LT(exact(double(std::nextafter(dop.upper[i], -infinity))), most) << where;
    }
  });
}
TEST(Dops, SidesAreRoundedToTheNextNumberOutside) {
  expect_sides_are_next<float>();
  expect_sides_are_next<double>();
}

TEST(Dops, HaveTheirDirections) {
  EXPECT_EQ((Dop<float, 14>::slabs), 7u);
  EXPECT_EQ((Dop<float, 18>::slabs), 9u);
  EXPECT_EQ((Dop<float, 26>::slabs), 13u);
  const auto components = [](const SlabDirection& n) { return n[0] * n[0] + n[1] * n[1] + n[2] * n[2]; };
  for (std::size_t i = 3; i < 7; ++i) EXPECT_EQ(components(Dop<float, 14>::directions[i]), 3);
  for (std::size_t i = 3; i < 9; ++i) EXPECT_EQ(components(Dop<float, 18>::directions[i]), 2);
}

TEST(Dops, SurfaceIsThatOfThePolytope) {
  // The octahedron is a 14-DOP, and the cube of any kind is a cube if nothing is cut off.
  std::vector<double> octahedron, cube, cuboctahedron;
  for (int axis = 0; axis < 3; ++axis)
    for (const double side : {-1.0, 1.0})
      for (int d = 0; d < 3; ++d) octahedron.push_back(d == axis ? side : 0);
  for (int corner = 0; corner < 8; ++corner)
    for (int d = 0; d < 3; ++d) cube.push_back((corner >> d) & 1 ? 1 : -1);
  for (int zero = 0; zero < 3; ++zero)
    for (int corner = 0; corner < 4; ++corner)
      for (int d = 0; d < 3; ++d)
        cuboctahedron.push_back(d == zero ? 0 : ((corner >> ((d + 2 - zero) % 3)) & 1 ? 1 : -1));
  Dop<double, 14> dop14;
  fit(dop14, all(octahedron));
  EXPECT_NEAR(surface_area(dop14), 4 * std::sqrt(3.0), 1e-12);
  fit(dop14, all(cuboctahedron));
  EXPECT_NEAR(surface_area(dop14), 2 * (6 + 2 * std::sqrt(3.0)), 1e-12);
  Dop<double, 26> dop26;
  fit(dop26, all(cube));
  EXPECT_NEAR(surface_area(dop26), 24, 1e-12);
  // Unlike these, the rhombic dodecahedron is an 18-DOP: 12 faces with diagonals of sqrt 2 and 1.
  Dop<double, 18> dodecahedron;
  fit(dodecahedron, all(cube));
  for (std::size_t i = 3; i < dodecahedron.slabs; ++i) {
    dodecahedron.lower[i] = -1;
    dodecahedron.upper[i] = 1;
  }
  EXPECT_NEAR(surface_area(dodecahedron), 12 * std::sqrt(2.0) / 2, 1e-12);
}

// A convex set that contains another one has the larger surface.
TEST(Dops, SurfaceGrowsAsSlabsAreTakenAway) {
  Random random(29);
  for (const Shape shape : {Shape::cloud, Shape::plane, Shape::line, Shape::axis_plane})
    for (const Place& place : {Place{0, 1}, Place{1e6, 1}, Place{0, 1e-30}})
      for (int trial = 0; trial < 50; ++trial) {
        const auto points = points_of<double>(shape, place, 3 + random.below(20), random);
        Box<double> box;
        Dop<double, 14> dop14;
        Dop<double, 18> dop18;
        Dop<double, 26> dop26;
        fit(box, all(points));
        fit(dop14, all(points));
        fit(dop18, all(points));
        fit(dop26, all(points));
        const double slack = 1e-7 * surface_area(box);
        EXPECT_LE(surface_area(dop26), surface_area(dop14) + slack);
        EXPECT_LE(surface_area(dop26), surface_area(dop18) + slack);
        EXPECT_LE(surface_area(dop14), surface_area(box) + slack);
        EXPECT_LE(surface_area(dop18), surface_area(box) + slack);
        EXPECT_GE(surface_area(dop26), 0);
      }
}

TEST(Spheres, AreNearTheSmallest) {
  Random random(31);
  for (int trial = 0; trial < 200; ++trial) {
    const auto points = points_of<double>(Shape::cloud, {0, 1}, 2 + random.below(30), random);
    double diameter = 0;
    for (std::size_t i = 0; i < points.size() / 3; ++i)
      for (std::size_t j = 0; j < i; ++j)
        diameter = std::max(diameter,
                            std::hypot(points[3 * i] - points[3 * j], points[3 * i + 1] - points[3 * j + 1],
                                       points[3 * i + 2] - points[3 * j + 2]));
    Sphere<double> sphere;
    fit(sphere, all(points));
    EXPECT_LE(sphere.radius, 1.25 * std::sqrt(0.375) * diameter);  // Jung: the smallest has no more than 1.0
    EXPECT_GE(sphere.radius, 0.5 * diameter);
  }
}

// Points on and next to spheres, whose numbers as integers of a common unit need `bits` bits and more.
void expect_sides_of_rationals(int bits, std::uint32_t seed) {
  Random random(seed);
  std::size_t sides[3] = {0, 0, 0};  // inside, on, outside
  for (int trial = 0; trial < 3000; ++trial) {
    // A rational point of the unit sphere, times a power of two; the centre's last bit sets the width.
    const double unit = std::ldexp(1, int(random.below(20)) - 10), least = std::ldexp(unit, -bits);
    const double quadruples[4][4] = {{1, 2, 2, 3}, {2, 3, 6, 7}, {4, 4, 7, 9}, {0, 0, 1, 1}};
    const double* quadruple = quadruples[random.below(4)];
    double centre[3], point[3];
    for (int d = 0; d < 3; ++d) {
      const bool kept = bits <= 52 || quadruple[d] == 0;  // else the sum below loses it
      centre[d] = kept ? least * (double(random.below(5)) - 2) : 0;
      point[d] = centre[d] + unit * quadruple[d] * (random.below(2) == 0 ? 1 : -1);
    }
    double radius = unit * quadruple[3];
    if (random.below(2) == 0) radius = std::nextafter(radius, random.below(2) == 0 ? 0 : 2 * radius);
    if (random.below(3) == 0) point[random.below(3)] += least;
    RationalPoint way;
    for (int d = 0; d < 3; ++d) way[d] = exact(point[d]) - exact(centre[d]);
    const Rational beyond = dot(way, way) - exact(radius) * exact(radius);
    const int side = beyond > 0 ? 1 : beyond < 0 ? -1 : 0;
    ++sides[side + 1];
    ASSERT_EQ(side_of_sphere(centre, radius, point), side) << trial;
  }
  for (const std::size_t count : sides) EXPECT_GT(count, 300u) << bits;
}
TEST(Spheres, SidesAreThoseOfRationalNumbers) {
  for (const int bits : {40, 51, 55, 56, 57, 58, 100, 247, 248, 249, 250, 900})
    expect_sides_of_rationals(bits, std::uint32_t(bits));
}

TEST(Spheres, ContainNothingWhereANumberIsNotFinite) {
  const double inside[3] = {0, 0, 0};
  for (const double wrong :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()})
    for (int number = 0; number < 4; ++number) {
      Sphere<double> sphere;
      for (std::size_t d = 0; d < 3; ++d) sphere.centre[d] = number == int(d) ? wrong : 0;
      sphere.radius = number == 3 ? wrong : 1;
      EXPECT_EQ(protrusion(sphere, inside), std::numeric_limits<double>::infinity()) << number;
    }
}

// Exact truth: |c_a - c_b| <= r_a + r_b.
template <class S>
void expect_spheres_overlap_as_they_should() {
  Random random(37);
  std::size_t near = 0, apart = 0;
  for (int trial = 0; trial < 20'000; ++trial) {
    Sphere<S> a, b;
    for (std::size_t d = 0; d < 3; ++d) {
      a.centre[d] = S(random.unit());
      b.centre[d] = S(random.unit());
    }
    const double distance =
        std::hypot(double(a.centre[0]) - double(b.centre[0]), double(a.centre[1]) - double(b.centre[1]),
                   double(a.centre[2]) - double(b.centre[2]));
    a.radius = S(distance * 0.5 * (1 + random.unit()));
    b.radius = S(distance - double(a.radius));
    for (std::uint32_t steps = random.below(3); steps > 0; --steps) b.radius = std::nextafter(b.radius, S(0));
    if (b.radius < 0) continue;
    const RationalPoint way = minus(rational(a.centre), rational(b.centre));
    const Rational reach = exact(double(a.radius)) + exact(double(b.radius));
    if (dot(way, way) <= reach * reach) {
      ++near;
      ASSERT_TRUE(overlap(a, b));
    }
    b.radius = S(double(b.radius) * (1 - 1e-5));
    const Rational less = exact(double(a.radius)) + exact(double(b.radius));
    if (dot(way, way) * Rational(1'000'000'000'000 - 1) / 1'000'000'000'000 > less * less) {
      ++apart;
      ASSERT_FALSE(overlap(a, b));
    }
  }
  EXPECT_GT(near, 3000u);
  EXPECT_GT(apart, 3000u);
}
TEST(Spheres, OverlapAsTheyShould) {
  expect_spheres_overlap_as_they_should<float>();
  expect_spheres_overlap_as_they_should<double>();
}

/// The largest gap between two oriented boxes over the directions that decide it, relative to the sizes along
/// them; not positive if they share a point.
template <class S>
double gap(const Obb<S>& a, const Obb<S>& b) {
  const auto edges_a = half_edges(a), edges_b = half_edges(b);
  std::vector<RationalPoint> directions;
  for (std::size_t i = 0; i < 3; ++i) {
    directions.push_back(rational(a.axis[i]));
    directions.push_back(rational(b.axis[i]));
    for (std::size_t j = 0; j < 3; ++j) directions.push_back(cross(edges_a[i], edges_b[j]));
  }
  const RationalPoint way = minus(rational(b.centre), rational(a.centre));
  double largest = -std::numeric_limits<double>::infinity();
  for (const RationalPoint& direction : directions) {
    Rational reach = 0;
    for (std::size_t i = 0; i < 3; ++i)
      reach += magnitude(dot(direction, edges_a[i])) + magnitude(dot(direction, edges_b[i]));
    const Rational between = magnitude(dot(direction, way)) - reach;
    if (reach == 0 && between == 0) continue;
    const Rational size = reach + magnitude(between);
    largest = std::max(largest, Rational(between / size).convert_to<double>());
  }
  return largest;
}

template <class S>
void expect_obbs_overlap_as_they_should(double offset) {
  Random random(41);
  std::size_t overlapping = 0, apart = 0, close = 0;
  for (int trial = 0; trial < 400; ++trial) {
    Obb<S> a, b;
    fit(a, all(points_of<S>(Shape::cloud, {offset, 1}, 3 + random.below(4), random)));
    auto points = points_of<S>(Shape::cloud, {offset, 1}, 3 + random.below(4), random);
    double way[3] = {random.unit(), random.unit(), random.unit()};
    // Bisects to where they just touch, for half of them; for the others, to either side of it.
    double least = 0, most = 4;
    const auto move = [&](double by) {
      auto moved = points;
      for (std::size_t i = 0; i < moved.size(); ++i) moved[i] = S(double(points[i]) + by * way[i % 3]);
      fit(b, all(moved));
    };
    for (int step = 0; step < (trial % 2 == 0 ? 1 : 40); ++step) {
      const double by = 0.5 * (least + most);
      move(by);
      (overlap(a, b) ? least : most) = by;
    }
    move(trial % 4 < 2 ? least : most);
    const double truth = gap(a, b);
    if (truth <= 0) {
      ++overlapping;
      ASSERT_TRUE(overlap(a, b)) << trial;
      ASSERT_TRUE(overlap(b, a)) << trial;
    } else if (truth > 1e-5) {
      ++apart;
      ASSERT_FALSE(overlap(a, b)) << trial << ": " << truth;
    }
    close += std::fabs(truth) < 1e-6 ? 1 : 0;
  }
  EXPECT_GT(overlapping, 50u);
  EXPECT_GT(apart, 50u);
  if (offset == 0) {
    EXPECT_GT(close, 50u);
  }
}
TEST(OrientedBoxes, OverlapAsTheyShould) {
  expect_obbs_overlap_as_they_should<float>(0);
  expect_obbs_overlap_as_they_should<double>(0);
  expect_obbs_overlap_as_they_should<double>(1e6);
}

TEST(OrientedBoxes, FindASlantedPlate) {
  Random random(43);
  std::vector<double> points;
  const double u[3] = {0.6, 0.64, 0.48}, v[3] = {-0.8, 0.48, 0.36};  // unit vectors at a right angle
  for (int i = 0; i < 400; ++i) {
    const double a = 2 * random.unit(), b = random.unit();
    for (int d = 0; d < 3; ++d) points.push_back(a * u[d] + b * v[d]);
  }
  Obb<double> plate;
  Box<double> box;
  fit(plate, all(points));
  fit(box, all(points));
  EXPECT_LT(*std::min_element(plate.half, plate.half + 3), 1e-14);
  EXPECT_LT(surface_area(plate), 2 * 4 * 2 * 1.35);  // of a plate of 4 by 2
  EXPECT_GT(surface_area(box), 2 * surface_area(plate));
  // A parent of two halves of the plate is still a plate.
  Obb<double> halves[2], parent;
  fit(halves[0], PointSet<double>(points.data(), 200));
  fit(halves[1], PointSet<double>(points.data() + 600, 200));
  enclose(parent, std::span<const Obb<double>>(halves, 2));
  EXPECT_LT(surface_area(parent), 1.5 * surface_area(plate));
}

// Rounded axes are not at right angles: thirty levels must not inflate a box.
TEST(OrientedBoxes, GrowLittleFromLevelToLevel) {
  Random random(47);
  Obb<float> child;
  fit(child, all(points_of<float>(Shape::cloud, {0, 1}, 10, random)));
  const double area = surface_area(child);
  for (int level = 0; level < 30; ++level) {
    const Obb<float> children[2] = {child, child};
    enclose(child, std::span<const Obb<float>>(children, 2));
  }
  EXPECT_LT(surface_area(child), area * (1 + 1e-4));
}

}  // namespace
}  // namespace kbvh::test::volume_kinds_test
