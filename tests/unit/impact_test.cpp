// The exact test of continuous collision detection against other methods: the static triangle test at
// rational times, and distances in 120 digits at roots that are found by bisection.
#include "core/continuous/impact.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <boost/multiprecision/cpp_bin_float.hpp>
#include <cmath>
#include <numeric>
#include <optional>
#include <string>
#include <vector>

#include "core/geometry/triangle_triangle.hpp"
#include "core/motion/algebraic_time.hpp"
#include "tests/support/synthetic_scenes.hpp"

namespace kbvh::test::impact_test {
namespace {

using Kind = Contact::Kind;
using Point = std::array<double, 3>;

struct Query {
  Kind kind;
  Point begin[4], end[4];
  MovingPoints moving() const {
    return {{begin[0].data(), begin[1].data(), begin[2].data(), begin[3].data()},
            {end[0].data(), end[1].data(), end[2].data(), end[3].data()}};
  }
  std::string text() const {
    std::string all = kind == Kind::vertex_face ? "vertex-face" : "edge-edge";
    for (int i = 0; i < 4; ++i) {
      all += i == 0 ? ": " : ", ";
      for (double x : begin[i]) all += std::to_string(x) + " ";
      all += "-> ";
      for (double x : end[i]) all += std::to_string(x) + " ";
    }
    return all;
  }
};

// ---- Static contact at a rational time --------------------------------------------------------------------

/// Exact: integers times the denominator, and the triangle test on degenerate triangles.
bool touch_at(const Query& query, std::int64_t numerator, std::int64_t denominator) {
  Point p[4];
  for (int i = 0; i < 4; ++i)
    for (std::size_t k = 0; k < 3; ++k)
      p[i][k] = double(denominator - numerator) * query.begin[i][k] + double(numerator) * query.end[i][k];
  if (query.kind == Kind::vertex_face)
    return triangles_intersect<double>(p[0].data(), p[0].data(), p[0].data(), p[1].data(), p[2].data(),
                                       p[3].data());
  return triangles_intersect<double>(p[0].data(), p[1].data(), p[1].data(), p[2].data(), p[3].data(),
                                     p[3].data());
}

// ---- Distances in many digits -----------------------------------------------------------------------------

using Real =
    boost::multiprecision::number<boost::multiprecision::cpp_bin_float<120>, boost::multiprecision::et_off>;
using Vector = std::array<Real, 3>;

Vector minus(const Vector& a, const Vector& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
Real inner(const Vector& a, const Vector& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
Vector outer(const Vector& a, const Vector& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
/// For coordinates up to 4: nonzero values at an algebraic time of degree 3 are far larger, and zero values
/// far smaller, because times are known to 110 digits.
const Real tiny("1e-45");

Real squared_distance_to_segment(const Vector& p, const Vector& a, const Vector& b) {
  const Vector d = minus(b, a), r = minus(p, a);
  const Real length = inner(d, d);
  Real s = length < tiny ? Real(0) : Real(inner(r, d) / length);
  s = std::clamp(s, Real(0), Real(1));
  const Vector apart{r[0] - s * d[0], r[1] - s * d[1], r[2] - s * d[2]};
  return inner(apart, apart);
}

bool touch_at(const Query& query, const Real& t) {
  Vector p[4];
  for (int i = 0; i < 4; ++i)
    for (std::size_t k = 0; k < 3; ++k) p[i][k] = (1 - t) * query.begin[i][k] + t * query.end[i][k];
  const auto near = [&](int i, int a, int b) { return squared_distance_to_segment(p[i], p[a], p[b]) < tiny; };
  if (query.kind == Kind::vertex_face) {
    if (near(0, 1, 2) || near(0, 2, 3) || near(0, 1, 3)) return true;
    const Vector n = outer(minus(p[2], p[1]), minus(p[3], p[1]));
    if (inner(n, n) < tiny) return false;
    const Real height = inner(n, minus(p[0], p[1]));
    if (height * height > tiny * inner(n, n)) return false;
    for (int i = 1; i < 4; ++i) {
      const Vector &a = p[i], &b = p[i % 3 + 1];
      if (inner(n, outer(minus(b, a), minus(p[0], a))) < 0) return false;
    }
    return true;
  }
  if (near(0, 2, 3) || near(1, 2, 3) || near(2, 0, 1) || near(3, 0, 1)) return true;
  const Vector a = minus(p[1], p[0]), b = minus(p[3], p[2]), r = minus(p[2], p[0]), n = outer(a, b);
  const Real area = inner(n, n);
  if (area < tiny) return false;
  const Real height = inner(n, r);
  if (height * height > tiny * area) return false;
  const Real s = inner(outer(r, b), n) / area, u = inner(outer(r, a), n) / area;
  return s >= 0 && s <= 1 && u >= 0 && u <= 1;
}

/// c[0] + c[1] t + c[2] t^2 + c[3] t^3: roots in [0, 1], found between its extremes; extremes that are
/// numerically zero count as roots. Empty if the polynomial is zero.
std::vector<Real> roots_of(const std::array<Real, 4>& c) {
  const auto at = [&](const Real& t) -> Real { return c[0] + t * (c[1] + t * (c[2] + t * c[3])); };
  std::vector<Real> cuts{0, 1};
  const Real qa = 3 * c[3], qb = 2 * c[2], qc = c[1];
  if (qa != 0) {
    const Real inside = qb * qb - 4 * qa * qc;
    if (inside >= 0)
      for (const int sign : {-1, 1}) cuts.push_back((-qb + sign * sqrt(inside)) / (2 * qa));
  } else if (qb != 0) {
    cuts.push_back(-qc / qb);
  }
  std::erase_if(cuts, [](const Real& t) { return t < 0 || t > 1; });
  std::sort(cuts.begin(), cuts.end());
  std::vector<Real> roots;
  for (const Real& t : cuts)
    if (abs(at(t)) < tiny) roots.push_back(t);
  for (std::size_t i = 0; i + 1 < cuts.size(); ++i) {
    Real low = cuts[i], high = cuts[i + 1];
    if (abs(at(low)) < tiny || abs(at(high)) < tiny || (at(low) < 0) == (at(high) < 0)) continue;
    const bool rising = at(low) < 0;
    for (int step = 0; step < 390; ++step) {
      const Real centre = (low + high) / 2;
      ((at(centre) < 0) == rising ? low : high) = centre;
    }
    roots.push_back(low);
  }
  return roots;
}

/// The first time of contact by the oracle.
std::optional<Real> first_contact(const Query& query) {
  // A polynomial of degree 3 from its values at 0, 1, -1, 2.
  const auto interpolated = [&](const auto& value) -> std::array<Real, 4> {
    const Real v0 = value(Real(0)), v1 = value(Real(1)), m1 = value(Real(-1)), v2 = value(Real(2));
    const Real even = (v1 + m1) / 2 - v0, odd = (v1 - m1) / 2;
    const Real cubic = (v2 - v0 - 4 * even - 2 * odd) / 6;
    return {v0, odd - cubic, even, cubic};
  };
  const auto at = [&](int i, const Real& t) -> Vector {
    Vector p;
    for (std::size_t k = 0; k < 3; ++k) p[k] = (1 - t) * query.begin[i][k] + t * query.end[i][k];
    return p;
  };
  const std::array<Real, 4> volume = interpolated([&](const Real& t) -> Real {
    const Vector o = at(0, t);
    return inner(outer(minus(at(1, t), o), minus(at(2, t), o)), minus(at(3, t), o));
  });
  std::vector<Real> times{0, 1};
  const auto add = [&](const std::array<Real, 4>& polynomial) {
    for (Real& t : roots_of(polynomial)) times.push_back(std::move(t));
  };
  if (std::any_of(volume.begin(), volume.end(), [](const Real& c) { return abs(c) > tiny; })) {
    add(volume);
  } else {
    // Always in one plane: changes can only occur where three points are in line, or two coordinates agree.
    for (int i = 0; i < 4; ++i)
      for (int j = i + 1; j < 4; ++j) {
        for (std::size_t k = 0; k < 3; ++k)
          add(interpolated([&](const Real& t) -> Real { return at(i, t)[k] - at(j, t)[k]; }));
        for (int l = j + 1; l < 4; ++l)
          for (std::size_t k = 0; k < 3; ++k)
            add(interpolated([&](const Real& t) -> Real {
              return outer(minus(at(j, t), at(i, t)), minus(at(l, t), at(i, t)))[k];
            }));
      }
  }
  std::sort(times.begin(), times.end());
  for (const Real& t : times)
    if (touch_at(query, t)) return t;
  return {};
}

// ---- Checks -----------------------------------------------------------------------------------------------

/// Returns the verdict, after checking that irrelevant changes do not affect it.
Impact checked_impact(const Query& query) {
  const Impact impact = find_impact(query.kind, query.moving());
  const Impact exact = find_impact_exact(query.kind, query.moving());
  EXPECT_EQ(impact.touches, exact.touches) << query.text();
  if (impact.touches && exact.touches) {
    EXPECT_LE(impact.end - impact.begin, impact_width);
    EXPECT_LE(exact.end - exact.begin, impact_width);
    EXPECT_LE(0, impact.begin);
    EXPECT_LE(impact.end, 1);
    // Both enclose the same instant.
    EXPECT_LE(std::max(impact.begin, exact.begin), std::min(impact.end, exact.end)) << query.text();
  }
  // The order of corners, ends and edges, and the direction of time make no difference.
  Query other = query;
  if (query.kind == Kind::vertex_face) {
    std::rotate(other.begin + 1, other.begin + 2, other.begin + 4);
    std::rotate(other.end + 1, other.end + 2, other.end + 4);
  } else {
    std::swap(other.begin[0], other.begin[1]);
    std::swap(other.end[0], other.end[1]);
    std::rotate(other.begin, other.begin + 2, other.begin + 4);
    std::rotate(other.end, other.end + 2, other.end + 4);
  }
  std::swap(other.begin, other.end);
  EXPECT_EQ(find_impact(other.kind, other.moving()).touches, impact.touches) << query.text();
  EXPECT_EQ(find_impact_exact(other.kind, other.moving()).touches, impact.touches) << query.text();
  return impact;
}

void check_against_oracle(const Query& query, int (&seen)[2]) {
  const Impact impact = checked_impact(query);
  const std::optional<Real> truth = first_contact(query);
  ASSERT_EQ(impact.touches, truth.has_value()) << query.text();
  ++seen[impact.touches ? 1 : 0];
  if (!truth) return;
  EXPECT_LE(Real(impact.begin), *truth + tiny) << query.text();
  EXPECT_GE(Real(impact.end), *truth - tiny) << query.text();
}

Query vertex_face(Point v0, Point v1, std::array<Point, 3> face0, std::array<Point, 3> face1) {
  return {Kind::vertex_face, {v0, face0[0], face0[1], face0[2]}, {v1, face1[0], face1[1], face1[2]}};
}
Query edge_edge(std::array<Point, 4> at0, std::array<Point, 4> at1) {
  return {Kind::edge_edge, {at0[0], at0[1], at0[2], at0[3]}, {at1[0], at1[1], at1[2], at1[3]}};
}

constexpr std::array<Point, 3> floor_face{{{0, 0, 0}, {4, 0, 0}, {0, 4, 0}}};

TEST(Impact, VertexAgainstFaceByHand) {
  const auto falls = [](double x, double y) {
    return find_impact(Kind::vertex_face,
                       vertex_face({x, y, 1}, {x, y, -1}, floor_face, floor_face).moving());
  };
  EXPECT_TRUE(falls(1, 1).touches);
  EXPECT_LE(falls(1, 1).begin, 0.5);
  EXPECT_GE(falls(1, 1).end, 0.5);
  EXPECT_TRUE(falls(0, 0).touches);  // a corner
  EXPECT_TRUE(falls(2, 2).touches);  // a border
  EXPECT_TRUE(falls(0, 3).touches);
  EXPECT_FALSE(falls(std::nextafter(2.0, 3.0), 2).touches);
  EXPECT_FALSE(falls(-0x1p-1074, 2).touches);
  EXPECT_TRUE(falls(0x1p-1074, 2).touches);
  // Exactly at the start, exactly at the end, just short of it.
  const auto from_to = [](double begin, double end) {
    return checked_impact(vertex_face({1, 1, begin}, {1, 1, end}, floor_face, floor_face));
  };
  EXPECT_TRUE(from_to(0, 1).touches);
  EXPECT_EQ(from_to(0, 1).end, 0);
  EXPECT_TRUE(from_to(1, 0).touches);
  EXPECT_EQ(from_to(1, 0).begin, 1);
  EXPECT_FALSE(from_to(1, 0x1p-1074).touches);
  EXPECT_TRUE(from_to(0, 0).touches);
  EXPECT_FALSE(from_to(1, 1).touches);
}

TEST(Impact, DegenerateByHand) {
  const std::array<Point, 3> point{{{1, 1, 0}, {1, 1, 0}, {1, 1, 0}}};
  const std::array<Point, 3> segment{{{0, 0, 0}, {4, 0, 0}, {2, 0, 0}}};
  EXPECT_TRUE(checked_impact(vertex_face({1, 1, 1}, {1, 1, -3}, point, point)).touches);
  EXPECT_FALSE(checked_impact(vertex_face({1, 1.5, 1}, {1, 1, -3}, point, point)).touches);
  EXPECT_TRUE(checked_impact(vertex_face({3, 0, 1}, {3, 0, -1}, segment, segment)).touches);
  EXPECT_FALSE(checked_impact(vertex_face({5, 0, 1}, {5, 0, -1}, segment, segment)).touches);
  // In the face's plane, from outside in; past it; along its border.
  EXPECT_TRUE(checked_impact(vertex_face({-1, 1, 0}, {1, 1, 0}, floor_face, floor_face)).touches);
  EXPECT_FALSE(checked_impact(vertex_face({-1, 1, 0}, {-1, 5, 0}, floor_face, floor_face)).touches);
  EXPECT_TRUE(checked_impact(vertex_face({-3, 0, 0}, {-1, 0, 0}, floor_face, floor_face)).touches == false);
  EXPECT_TRUE(checked_impact(vertex_face({-3, 0, 0}, {0, 0, 0}, floor_face, floor_face)).touches);
  // A face that folds to a segment at t = 1/2 just when the vertex is on its line, and beyond it.
  const std::array<Point, 3> turned{{{0, 0, 0}, {4, 0, 0}, {0, -4, 0}}};
  EXPECT_TRUE(checked_impact(vertex_face({2, 0, 1}, {2, 0, -1}, floor_face, turned)).touches);
  EXPECT_FALSE(checked_impact(vertex_face({5, 0, 1}, {5, 0, -1}, floor_face, turned)).touches);
  // Edges: crossing, parallel, on one line, points.
  EXPECT_TRUE(checked_impact(edge_edge({{{-1, 0, 1}, {1, 0, 1}, {0, -1, 0}, {0, 1, 0}}},
                                       {{{-1, 0, -1}, {1, 0, -1}, {0, -1, 0}, {0, 1, 0}}}))
                  .touches);
  EXPECT_TRUE(checked_impact(edge_edge({{{-1, 0, 1}, {1, 0, 1}, {1, 0, 0}, {3, 0, 0}}},
                                       {{{-1, 0, -1}, {1, 0, -1}, {1, 0, 0}, {3, 0, 0}}}))
                  .touches);
  EXPECT_FALSE(checked_impact(edge_edge({{{-1, 0, 1}, {1, 0, 1}, {2, 0, 0}, {3, 0, 0}}},
                                        {{{-1, 0, -1}, {1, 0, -1}, {2, 0, 0}, {3, 0, 0}}}))
                   .touches);
  EXPECT_TRUE(checked_impact(edge_edge({{{0, 0, 0}, {1, 0, 0}, {3, 0, 0}, {4, 0, 0}}},
                                       {{{2, 0, 0}, {3, 0, 0}, {3, 0, 0}, {4, 0, 0}}}))
                  .touches);
  EXPECT_TRUE(checked_impact(edge_edge({{{0, 0, 0}, {0, 0, 0}, {1, 1, 1}, {1, 1, 1}}},
                                       {{{1, 1, 1}, {1, 1, 1}, {0, 0, 0}, {0, 0, 0}}}))
                  .touches);
  EXPECT_FALSE(checked_impact(edge_edge({{{0, 0, 0}, {0, 0, 0}, {1, 1, 1}, {1, 1, 1}}},
                                        {{{1, 1, 1}, {1, 1, 1}, {0, 0, 1}, {0, 0, 1}}}))
                   .touches);
}

// The cubic has a double root where the vertex only touches the plane: 2 t^2 - 2 t + 1/2 = 2 (t - 1/2)^2.
TEST(Impact, TouchesWithoutCrossing) {
  // The height of v over the face is a product of two linear functions: the face tilts while v passes.
  int touching = 0;
  for (int shift = -2; shift <= 2; ++shift) {
    const std::array<Point, 3> begin{{{0, 0, 0}, {8, 0, 2}, {0, 8, 0}}},
        end{{{0, 0, 0}, {8, 0, -2}, {0, 8, 0}}};
    // At t the plane is z = x (1 - 2 t) / 4; the vertex is at x = 4 (1 - 2t) + 4, z = 1 - 2 t + shift / 8.
    const double lift = shift / 8.0;
    const Query query = vertex_face({4 + 2, 1, 1.5 + lift}, {4 - 2, 1, -0.5 + lift}, begin, end);
    int seen[2] = {0, 0};
    check_against_oracle(query, seen);
    touching += seen[1];
  }
  EXPECT_GT(touching, 0);
}

Query random_query(Random& random, Kind kind, int reach, bool planar, bool rigid) {
  Query query{kind, {}, {}};
  const auto coordinate = [&] { return double(int(random.below(std::uint32_t(2 * reach + 1))) - reach); };
  Point velocity[2];
  for (Point& v : velocity) v = {coordinate(), coordinate(), planar ? 0 : coordinate()};
  for (int i = 0; i < 4; ++i) {
    query.begin[i] = {coordinate(), coordinate(), planar ? 0 : coordinate()};
    query.end[i] = {coordinate(), coordinate(), planar ? 0 : coordinate()};
    const bool second = kind == Kind::vertex_face ? i > 0 : i > 1;
    if (rigid)
      for (std::size_t k = 0; k < 3; ++k) query.end[i][k] = query.begin[i][k] + velocity[second ? 1 : 0][k];
  }
  // Sometimes with coincident points.
  if (random.below(4) == 0) query.begin[3] = query.begin[2];
  if (random.below(4) == 0) query.end[3] = query.end[2];
  if (random.below(6) == 0) query.end[1] = query.begin[1];
  if (planar && random.below(2) == 0)
    for (auto* points : {query.begin, query.end})
      for (int i = 0; i < 4; ++i) points[i][2] = points[i][0] + 2 * points[i][1];  // another plane
  return query;
}

// Two bodies that move without turning: the cubic is linear, so its root is rational, and the static test
// decides.
TEST(Impact, AgreesWithTheStaticTestAtRationalTimes) {
  Random random(41);
  int seen[2] = {0, 0};
  for (int round = 0; round < 20000; ++round) {
    const Kind kind = round % 2 == 0 ? Kind::vertex_face : Kind::edge_edge;
    Query query = random_query(random, kind, 3, false, true);
    for (auto* points : {query.begin, query.end})
      if (kind == Kind::edge_edge && round % 3 == 0)
        points[3] = points == query.begin ? query.begin[3] : query.end[3];
    const auto volume = [&](const Point* p) {
      std::int64_t d[3][3];
      for (std::size_t i = 0; i < 3; ++i)
        for (std::size_t k = 0; k < 3; ++k) d[i][k] = std::int64_t(p[i + 1][k] - p[0][k]);
      return d[0][0] * (d[1][1] * d[2][2] - d[1][2] * d[2][1]) -
             d[0][1] * (d[1][0] * d[2][2] - d[1][2] * d[2][0]) +
             d[0][2] * (d[1][0] * d[2][1] - d[1][1] * d[2][0]);
    };
    // Coincident points were made after the motion, so check at a third time that it is still linear.
    Point middle[4];
    for (int i = 0; i < 4; ++i)
      for (std::size_t k = 0; k < 3; ++k) middle[i][k] = 2 * query.end[i][k] - query.begin[i][k];
    Point before[4];
    for (int i = 0; i < 4; ++i)
      for (std::size_t k = 0; k < 3; ++k) before[i][k] = 2 * query.begin[i][k] - query.end[i][k];
    const std::int64_t begin = volume(query.begin), end = volume(query.end);
    if (volume(middle) != 2 * end - begin || volume(before) != 2 * begin - end || begin == end) continue;
    const Impact impact = checked_impact(query);
    const std::int64_t top = begin, bottom = begin - end, sign = bottom < 0 ? -1 : 1;
    const bool inside = sign * top >= 0 && sign * top <= sign * bottom;
    const std::int64_t common = std::gcd(top, bottom);
    const bool truth = inside && touch_at(query, sign * top / common, sign * bottom / common);
    ASSERT_EQ(impact.touches, truth) << query.text();
    ++seen[truth ? 1 : 0];
  }
  EXPECT_GT(seen[0], 1000);
  EXPECT_GT(seen[1], 500);
}

// A contact at any of these times is a contact.
TEST(Impact, MissesNothingAtRationalTimes) {
  Random random(42);
  int found = 0;
  for (int round = 0; round < 6000; ++round) {
    const Query query =
        random_query(random, round % 2 == 0 ? Kind::vertex_face : Kind::edge_edge, 2, round % 5 == 0, false);
    bool touches = false;
    for (std::int64_t bottom : {1, 2, 3, 4, 5})
      for (std::int64_t top = 0; top <= bottom; ++top) touches = touches || touch_at(query, top, bottom);
    if (!touches) continue;
    ++found;
    ASSERT_TRUE(checked_impact(query).touches) << query.text();
  }
  EXPECT_GT(found, 500);
}

TEST(Impact, AgreesWithDistancesInManyDigits) {
  Random random(43);
  int seen[2] = {0, 0};
  for (int round = 0; round < 1500; ++round)
    check_against_oracle(random_query(random, round % 2 == 0 ? Kind::vertex_face : Kind::edge_edge,
                                      1 + round % 3, false, false),
                         seen);
  EXPECT_GT(seen[0], 200);
  EXPECT_GT(seen[1], 200);
}

TEST(Impact, AgreesWithThemInOnePlaneForAllTime) {
  Random random(44);
  int seen[2] = {0, 0};
  for (int round = 0; round < 150; ++round)
    check_against_oracle(random_query(random, round % 2 == 0 ? Kind::vertex_face : Kind::edge_edge,
                                      1 + round % 3, true, false),
                         seen);
  EXPECT_GT(seen[0], 20);
  EXPECT_GT(seen[1], 20);
}

// Exact arithmetic confirms every decision of the filter: at all sizes, far from the origin, nearly flat.
TEST(Impact, FilterNeverDisagreesWithExactArithmetic) {
  Random random(45);
  ImpactStats stats;
  int touching = 0;
  for (int round = 0; round < 6000; ++round) {
    Query query{round % 2 == 0 ? Kind::vertex_face : Kind::edge_edge, {}, {}};
    const double sizes[6] = {1, 1e-30, 1e30, 1e100, 1e-150, 1e-300};
    const double size = sizes[round / 2 % 6], offset = round / 12 % 2 == 0 ? 0 : 100 * size;
    const double flat = round / 24 % 2 == 0 ? 1 : 1e-15;
    for (auto* points : {query.begin, query.end})
      for (int i = 0; i < 4; ++i)
        for (std::size_t k = 0; k < 3; ++k)
          points[i][k] = (size == 1e100 ? 0 : offset) + size * random.unit() * (k == 2 ? flat : 1);
    const Impact filtered = find_impact(query.kind, query.moving(), &stats);
    const Impact exact = find_impact_exact(query.kind, query.moving());
    ASSERT_EQ(filtered.touches, exact.touches) << query.text();
    touching += exact.touches ? 1 : 0;
    if (exact.touches) {
      EXPECT_LE(filtered.end - filtered.begin, impact_width);
      EXPECT_LE(std::max(filtered.begin, exact.begin), std::min(filtered.end, exact.end));
    }
  }
  EXPECT_GT(touching, 300);
  EXPECT_EQ(stats.tests, 6000u);
  EXPECT_EQ(stats.filtered + stats.exact, stats.tests);
  EXPECT_GT(stats.filtered, 3000u);
}

// Roots of multiplicity, at dyadic places, and near each other.
TEST(AlgebraicTime, FindsRootsAndSigns) {
  const auto line = [](int begin, int end) { return Polynomial::line(begin, end); };
  const Polynomial third = line(-1, 2), half = line(-1, 1), zero = line(0, 1), one = line(-1, 0);
  const auto count = [](const Polynomial& p) {
    std::vector<AlgebraicTime> roots;
    append_inner_roots(p, roots);
    return roots.size();
  };
  EXPECT_EQ(count(third * half), 2u);
  EXPECT_EQ(count(half * half * half), 1u);
  EXPECT_EQ(count(third * third * half), 2u);
  EXPECT_EQ(count(zero * one * third), 1u);
  EXPECT_EQ(count(zero * zero), 0u);
  EXPECT_EQ(count(line(-3333, 6667) * third), 2u);  // 0.3333
  std::vector<AlgebraicTime> roots;
  append_inner_roots(third * third, roots);
  ASSERT_EQ(roots.size(), 1u);
  EXPECT_EQ(roots[0].sign(third), 0);
  EXPECT_EQ(roots[0].sign(half), -1);
  EXPECT_EQ(roots[0].sign(line(-3333, 6667)), 1);
  EXPECT_EQ(roots[0].sign(line(-333333333, 666666666)), 0);
  roots[0].refine(20);
  EXPECT_LE(roots[0].begin(), 1.0 / 3);
  EXPECT_GE(roots[0].end(), 1.0 / 3);
  EXPECT_LE(roots[0].end() - roots[0].begin(), 0x1p-20);
}

}  // namespace
}  // namespace kbvh::test::impact_test
