#include "core/geometry/triangle_triangle.hpp"

#include <CGAL/Exact_predicates_exact_constructions_kernel.h>
#include <CGAL/intersections.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <boost/multiprecision/cpp_int.hpp>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "tests/unit/triangle_pairs.hpp"

namespace kbvh {
namespace {

using namespace triangle_pairs;

template <class S>
bool test(const Corners<S>& a, const Corners<S>& b, TriangleTestStats* stats = nullptr) {
  return triangles_intersect(a[0].data(), a[1].data(), a[2].data(), b[0].data(), b[1].data(), b[2].data(),
                             stats);
}

/// Returns the answer for the pair as given; fails if one of the 72 orders of corners and triangles
/// disagrees.
template <class S>
bool test_all_orders(const Pair<S>& pair) {
  const bool first = test(pair[0], pair[1]);
  std::array<std::size_t, 3> i{0, 1, 2};
  do {
    const Corners<S> a{pair[0][i[0]], pair[0][i[1]], pair[0][i[2]]};
    std::array<std::size_t, 3> j{0, 1, 2};
    do {
      const Corners<S> b{pair[1][j[0]], pair[1][j[1]], pair[1][j[2]]};
      if (test(a, b) != first || test(b, a) != first) {
        ADD_FAILURE() << "the order of corners matters, first answer " << first << "\n" << describe(pair);
        return first;
      }
    } while (std::next_permutation(j.begin(), j.end()));
  } while (std::next_permutation(i.begin(), i.end()));
  return first;
}

// ---- The reference: CGAL's exact kernel, on simplices that are never degenerate
// ------------------------------

namespace reference {

using Kernel = CGAL::Exact_predicates_exact_constructions_kernel;
using Point3 = Kernel::Point_3;

struct Simplex {
  std::vector<Point3> corners;
  Kernel::Segment_3 segment() const { return {corners[0], corners[1]}; }
  Kernel::Triangle_3 triangle() const { return {corners[0], corners[1], corners[2]}; }
};

template <class S>
Simplex reduce(const Corners<S>& t) {
  std::vector<Point3> p;
  for (const auto& corner : t) p.emplace_back(double(corner[0]), double(corner[1]), double(corner[2]));
  if (!CGAL::collinear(p[0], p[1], p[2])) return {p};
  if (p[0] == p[1] && p[1] == p[2]) return {{p[0]}};
  for (int i = 0; i < 3; ++i) {
    const Point3 &x = p[std::size_t(i)], &y = p[std::size_t((i + 1) % 3)], &z = p[std::size_t((i + 2) % 3)];
    if (x != y && CGAL::collinear_are_ordered_along_line(x, z, y)) return {{x, y}};
  }
  ADD_FAILURE() << "three collinear points without a middle one";
  return {p};
}

bool intersect(const Simplex& x, const Simplex& y) {
  if (x.corners.size() < y.corners.size()) return intersect(y, x);
  const std::size_t sizes = 10 * x.corners.size() + y.corners.size();
  switch (sizes) {
    case 33:
      return CGAL::do_intersect(x.triangle(), y.triangle());
    case 32:
      return CGAL::do_intersect(x.triangle(), y.segment());
    case 31:
      return x.triangle().has_on(y.corners[0]);
    case 22:
      return CGAL::do_intersect(x.segment(), y.segment());
    case 21:
      return x.segment().has_on(y.corners[0]);
    default:
      return x.corners[0] == y.corners[0];
  }
}

template <class S>
bool intersect(const Pair<S>& pair) {
  return intersect(reduce(pair[0]), reduce(pair[1]));
}

}  // namespace reference

/// The results of a family of pairs. A family without both answers would prove little.
struct Tally {
  int intersecting = 0, separate = 0, wrong = 0;
};

template <class S>
void check(const Pair<S>& pair, Tally& tally) {
  const bool expected = reference::intersect(pair);
  const bool answer = test_all_orders(pair);
  (expected ? tally.intersecting : tally.separate) += 1;
  if (answer == expected) return;
  if (++tally.wrong <= 5)
    ADD_FAILURE() << "answered " << answer << ", CGAL " << expected << "\n" << describe(pair);
}

void expect_both(const Tally& tally, int at_least) {
  EXPECT_EQ(tally.wrong, 0);
  EXPECT_GE(tally.intersecting, at_least);
  EXPECT_GE(tally.separate, at_least);
}

template <class S>
class TriangleTriangle : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(TriangleTriangle, Scalars);

// ---- Labelled data
// -------------------------------------------------------------------------------------------

std::string data_folder() {
  const char* folder = std::getenv("KBVH_DATA");
  return folder != nullptr ? folder : std::string(KBVH_SOURCE_DIR) + "/../shared/data";
}

template <class S>
void check_labels(const std::string& name, bool expected) {
  const std::string path = data_folder() + "/tritri/" + name;
  std::ifstream file(path);
  if (!file) GTEST_SKIP() << "no labelled triangle pairs at " << path << " (set KBVH_DATA)";
  int pairs = 0, wrong = 0;
  for (;;) {
    Pair<S> pair;
    for (auto& triangle : pair)
      for (auto& p : triangle)
        for (auto& x : p) {
          double decimal = 0;
          if (!(file >> decimal)) {
            EXPECT_EQ(pairs, 2500) << path;
            EXPECT_EQ(wrong, 0) << path;
            return;
          }
          // Labels apply to the decimals as written, which are integers after this scaling; those below 2^24
          // are floats.
          const double integer = std::round(decimal * 1e6);
          ASSERT_NEAR(integer, decimal * 1e6, 1e-6);
          x = S(integer);
          ASSERT_EQ(double(x), integer);
        }
    ++pairs;
    wrong += test_all_orders(pair) != expected;
  }
}

TYPED_TEST(TriangleTriangle, LabelsIntersecting) {
  check_labels<TypeParam>("intersected.txt", true);
}
TYPED_TEST(TriangleTriangle, LabelsSeparated) {
  check_labels<TypeParam>("separated.txt", false);
}

// ---- Against CGAL
// --------------------------------------------------------------------------------------------

/// All multisets of three points of a cubic grid.
std::vector<std::array<int, 3>> grid_triples(int points) {
  std::vector<std::array<int, 3>> triples;
  for (int i = 0; i < points; ++i)
    for (int j = i; j < points; ++j)
      for (int k = j; k < points; ++k) triples.push_back({i, j, k});
  return triples;
}

Corners<double> grid_corners(const std::array<int, 3>& triple, int n) {
  Corners<double> corners;
  for (std::size_t i = 0; i < 3; ++i)
    corners[i] = {double(triple[i] % n), double(triple[i] / n % n), double(triple[i] / (n * n))};
  return corners;
}

/// Returns the least of the triples that the cube's 48 symmetries make of this one.
std::array<int, 3> canonical(const std::array<int, 3>& triple, int n) {
  std::array<int, 3> best = triple;
  std::array<int, 3> axes{0, 1, 2};
  do {
    for (int mirror = 0; mirror < 8; ++mirror) {
      std::array<int, 3> image{};
      for (std::size_t i = 0; i < 3; ++i) {
        const int x[3] = {triple[i] % n, triple[i] / n % n, triple[i] / (n * n)};
        int y[3];
        for (int k = 0; k < 3; ++k)
          y[k] = (mirror >> k & 1) != 0 ? n - 1 - x[axes[std::size_t(k)]] : x[axes[std::size_t(k)]];
        image[i] = y[0] + n * (y[1] + n * y[2]);
      }
      std::sort(image.begin(), image.end());
      best = std::min(best, image);
    }
  } while (std::next_permutation(axes.begin(), axes.end()));
  return best;
}

/// Every pair of triangles, including degenerate ones, with coordinates in {0, 1, 2}, up to the symmetries of
/// the cube: all possible cases of sides, apices and contacts.
TEST(TriangleTriangleExhaustive, GridOfThree) {
  constexpr int n = 3;
  std::vector<reference::Simplex> simplices;
  std::vector<Corners<double>> corners;
  std::vector<std::size_t> canonical_triples;
  const auto triples = grid_triples(n * n * n);
  for (const auto& triple : triples) {
    if (canonical(triple, n) == triple) canonical_triples.push_back(corners.size());
    corners.push_back(grid_corners(triple, n));
    simplices.push_back(reference::reduce(corners.back()));
  }
  Tally tally;
  for (const std::size_t i : canonical_triples)
    for (std::size_t j = 0; j < corners.size(); ++j) {
      const bool expected = reference::intersect(simplices[i], simplices[j]);
      (expected ? tally.intersecting : tally.separate) += 1;
      const bool answers[2] = {test(corners[i], corners[j]), test(corners[j], corners[i])};
      if (answers[0] == expected && answers[1] == expected) continue;
      if (++tally.wrong <= 5) ADD_FAILURE() << describe(Pair<double>{corners[i], corners[j]});
    }
  expect_both(tally, 100000);
}

TYPED_TEST(TriangleTriangle, SmallGrids) {
  Random random(1);
  for (const int n : {2, 3, 4, 8}) {
    Tally tally;
    for (int i = 0; i < 3000; ++i) check(grid_pair<TypeParam>(random, n), tally);
    expect_both(tally, 200);
  }
}

TYPED_TEST(TriangleTriangle, Coplanar) {
  Random random(2);
  for (const int n : {2, 3, 5, 20}) {
    Tally tally;
    for (int i = 0; i < 3000; ++i) check(coplanar_pair<TypeParam>(random, n), tally);
    expect_both(tally, 200);
  }
}

TYPED_TEST(TriangleTriangle, ContactsRounded) {
  Random random(3);
  Tally tally;
  for (int i = 0; i < 5000; ++i) check(contact_pair<TypeParam>(random), tally);
  expect_both(tally, 500);
}

TYPED_TEST(TriangleTriangle, OneUlpFromDegenerate) {
  Random random(4);
  Tally grid, thirds, coplanar;
  for (int i = 0; i < 4000; ++i) {
    Pair<TypeParam> pair = grid_pair<TypeParam>(random, 3);
    perturb(random, pair);
    check(pair, grid);
    // Thirds are not representable: collinear and coplanar points become nearly so.
    pair = grid_pair<TypeParam>(random, 4);
    for (auto& triangle : pair)
      for (auto& p : triangle)
        for (auto& x : p) x = (x + TypeParam(1)) / TypeParam(3);
    perturb(random, pair);
    check(pair, thirds);
    pair = coplanar_pair<TypeParam>(random, 4);
    perturb(random, pair);
    check(pair, coplanar);
  }
  expect_both(grid, 200);
  expect_both(thirds, 200);
  expect_both(coplanar, 200);
}

TYPED_TEST(TriangleTriangle, ScaledToTheEndsOfTheRange) {
  Random random(5);
  for (const int exponent : extreme_exponents<TypeParam>()) {
    Tally tally;
    for (int i = 0; i < 1500; ++i) {
      Pair<TypeParam> pair = i % 3 == 0   ? grid_pair<TypeParam>(random, 3)
                             : i % 3 == 1 ? coplanar_pair<TypeParam>(random, 4)
                                          : contact_pair<TypeParam>(random);
      scale(pair, exponent);  // rounds if it results in denormals: both sides get the rounded numbers
      check(pair, tally);
    }
    expect_both(tally, 100);
  }
}

TYPED_TEST(TriangleTriangle, FarFromTheOrigin) {
  Random random(6);
  const TypeParam ulp = std::numeric_limits<TypeParam>::epsilon();
  Tally tally;
  for (int i = 0; i < 4000; ++i) {
    Pair<TypeParam> pair = i % 2 == 0 ? grid_pair<TypeParam>(random, 4) : coplanar_pair<TypeParam>(random, 4);
    const Point<TypeParam> offset{1, TypeParam(uniform(random, 1, 3)), TypeParam(uniform(random, 0, 1))};
    for (auto& triangle : pair)
      for (auto& p : triangle)
        for (std::size_t axis = 0; axis < 3; ++axis) p[axis] = offset[axis] + p[axis] * TypeParam(4) * ulp;
    check(pair, tally);
  }
  expect_both(tally, 300);
}

/// Exponents that differ by the whole range: differences round, exact integers grow beyond 512 bits.
TYPED_TEST(TriangleTriangle, SizesFarApart) {
  Random random(7);
  const int lowest = std::is_same_v<TypeParam, float> ? -149 : -1074;
  const int highest = std::is_same_v<TypeParam, float> ? 95 : 325;
  Tally tally;
  for (int i = 0; i < 4000; ++i) {
    Pair<TypeParam> pair = i % 2 == 0 ? grid_pair<TypeParam>(random, 3) : coplanar_pair<TypeParam>(random, 3);
    const int gap = std::array<int, 4>{30, 60, 120, highest - lowest}[std::size_t(i / 2 % 4)];
    for (auto& triangle : pair)
      for (auto& p : triangle)
        for (auto& x : p) {
          if (uniform(random, 0, 3) != 0) continue;
          x = std::ldexp(uniform(random, 0, 1) == 0 ? x : -x,
                         std::clamp(uniform(random, -gap, gap), lowest, highest));
        }
    check(pair, tally);
  }
  expect_both(tally, 300);
}

// ---- Predicates
// ----------------------------------------------------------------------------------------------

using Rational = boost::multiprecision::cpp_rational;

int rational_orient3d(const Point<double>* p) {
  Rational e[3][3];
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t axis = 0; axis < 3; ++axis) e[i][axis] = Rational(p[i + 1][axis]) - Rational(p[0][axis]);
  const Rational det = e[0][0] * (e[1][1] * e[2][2] - e[1][2] * e[2][1]) -
                       e[0][1] * (e[1][0] * e[2][2] - e[1][2] * e[2][0]) +
                       e[0][2] * (e[1][0] * e[2][1] - e[1][1] * e[2][0]);
  return det.sign();
}

int rational_orient2d(const Point<double>* p, Projection axes) {
  const auto difference = [&](int i, int axis) {
    return Rational(p[i][std::size_t(axis)]) - Rational(p[0][std::size_t(axis)]);
  };
  const Rational det =
      difference(1, axes.u) * difference(2, axes.v) - difference(1, axes.v) * difference(2, axes.u);
  return det.sign();
}

/// Four points around one plane, exactly or nearly in it, with exponents apart by up to `gap`.
std::array<Point<double>, 4> near_plane(Random& random, int gap) {
  std::array<Point<double>, 4> p;
  std::uniform_real_distribution<double> real(-1, 1);
  for (auto& q : p)
    for (auto& x : q)
      x = std::ldexp(uniform(random, 0, 1) == 0 ? uniform(random, -3, 3) : real(random),
                     uniform(random, -gap, gap));
  if (uniform(random, 0, 2) > 0) {
    const double s = real(random), t = real(random);
    for (std::size_t axis = 0; axis < 3; ++axis)
      p[3][axis] = p[0][axis] + s * (p[1][axis] - p[0][axis]) + t * (p[2][axis] - p[0][axis]);
  }
  if (uniform(random, 0, 2) == 0) {
    const double s = real(random);  // nearly collinear, for orient2d
    for (std::size_t axis = 0; axis < 3; ++axis) p[2][axis] = p[0][axis] + s * (p[1][axis] - p[0][axis]);
  }
  if (uniform(random, 0, 3) == 0) p[3][0] = std::nextafter(p[3][0], 10.0);
  return p;
}

TEST(Predicates, SignsAreExact) {
  Random random(8);
  int undecided = 0, undecided2d = 0;
  for (const int gap : {0, 2, 20, 45, 200, 330})
    for (int i = 0; i < 3000; ++i) {
      const auto p = near_plane(random, gap);
      const int expected = rational_orient3d(p.data());
      const double *a = p[0].data(), *b = p[1].data(), *c = p[2].data(), *d = p[3].data();
      ASSERT_EQ(orient3d_exact(a, b, c, d), expected);
      ASSERT_EQ(orient3d(a, b, c, d), expected);
      ASSERT_EQ(orient3d(b, a, c, d), -expected);
      const int filtered = orient3d_filtered(a, b, c, d);
      if (filtered == undecided_sign)
        ++undecided;
      else
        ASSERT_EQ(filtered, expected);
      for (int axis = 0; axis < 3; ++axis) {
        const Projection axes = drop_axis(axis);
        ASSERT_EQ(orient2d_exact(a, b, c, axes), rational_orient2d(p.data(), axes));
        ASSERT_EQ(orient2d(a, b, c, axes), rational_orient2d(p.data(), axes));
        undecided2d += orient2d_filtered(a, b, c, axes) == undecided_sign;
      }
    }
  EXPECT_GT(undecided, 1000);
  EXPECT_GT(undecided2d, 1000);
}

/// Where every product underflows to zero the filter must not answer zero, nor any other sign.
TEST(Predicates, UnderflowIsLeftToIntegers) {
  const double tiny = std::numeric_limits<double>::denorm_min();
  const Point<double> a{0, 0, 0}, b{tiny, 0, 0}, c{0, tiny, 0}, d{0, 0, tiny};
  EXPECT_EQ(orient3d_filtered(a.data(), b.data(), c.data(), d.data()), undecided_sign);
  EXPECT_EQ(orient3d(a.data(), b.data(), c.data(), d.data()), 1);
  EXPECT_EQ(orient3d(a.data(), c.data(), b.data(), d.data()), -1);
  EXPECT_EQ(orient2d(a.data(), b.data(), c.data(), drop_axis(2)), 1);
  EXPECT_EQ(orient2d(a.data(), c.data(), b.data(), drop_axis(2)), -1);
}

/// At the admissible limit nothing overflows: the largest determinant is still decided by the filter.
TEST(Predicates, LimitIsDecidedByTheFilter) {
  const double m = admissible_magnitude<double>;
  const Point<double> a{-m, -m, -m}, b{m, m, -m}, c{-m, m, m}, d{m, -m, m};
  EXPECT_EQ(orient3d_filtered(a.data(), b.data(), c.data(), d.data()),
            rational_orient3d(std::array{a, b, c, d}.data()));
}

// ---- Stats
// ---------------------------------------------------------------------------------------------------

TYPED_TEST(TriangleTriangle, StatsTellFilterFromExact) {
  using S = TypeParam;
  TriangleTestStats stats;
  const Corners<S> floor{{{0, 0, 0}, {4, 0, 0}, {0, 4, 0}}};
  const Corners<S> above{{{0, 0, 1}, {4, 0, 2}, {0, 4, 3}}};
  const Corners<S> through{{{1, 1, -1}, {1, 1, 1}, {S(1.5), 1, 1}}};
  const Corners<S> lying{{{1, 1, 0}, {2, 1, 0}, {1, 2, 0}}};
  EXPECT_FALSE(test(floor, above, &stats));
  EXPECT_TRUE(test(floor, through, &stats));
  EXPECT_EQ(stats.tests, 2U);
  EXPECT_EQ(stats.filtered, 2U);
  EXPECT_TRUE(test(floor, lying, &stats));
  EXPECT_EQ(stats.tests, 3U);
  EXPECT_EQ(stats.filtered, 2U);
  EXPECT_EQ(stats.exact, 1U);
}

}  // namespace
}  // namespace kbvh
