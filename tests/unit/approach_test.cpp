// The first time at which two elements in linear motion are within a distance: against distances in rationals
// at many times, against each other with and without a filter, and in cases whose answer is known.
#include "core/broad_phase/approach.hpp"

#include <gtest/gtest.h>

#include "broad_phase_oracle.hpp"

namespace kbvh::test::broad_phase {
namespace {

/// Four points in motion, with numbers of their own.
struct Moving {
  Contact::Kind kind = Contact::Kind::vertex_face;
  std::array<std::array<double, 3>, 4> begin{}, end{};

  MovingPoints points() const {
    MovingPoints points{};
    for (std::size_t i = 0; i < 4; ++i) {
      points.begin[i] = begin[i].data();
      points.end[i] = end[i].data();
    }
    return points;
  }
  Rational squared_distance_at(const Rational& t) const {
    std::array<Point, 4> p;
    for (std::size_t i = 0; i < 4; ++i)
      for (std::size_t k = 0; k < 3; ++k) p[i][k] = (1 - t) * Rational(begin[i][k]) + t * Rational(end[i][k]);
    return kind == Contact::Kind::vertex_face ? point_triangle(p[0], p[1], p[2], p[3])
                                              : segment_segment(p[0], p[1], p[2], p[3]);
  }
  /// Returns a bound on the change of the distance per unit of t, squared.
  Rational squared_speed() const {
    Rational largest = 0;
    const std::size_t split = kind == Contact::Kind::vertex_face ? 1 : 2;
    for (std::size_t i = 0; i < split; ++i)
      for (std::size_t j = split; j < 4; ++j) {
        Rational sum = 0;
        for (std::size_t k = 0; k < 3; ++k) {
          const Rational d =
              Rational(end[i][k]) - Rational(begin[i][k]) - Rational(end[j][k]) + Rational(begin[j][k]);
          sum += d * d;
        }
        largest = std::max(largest, sum);
      }
    return largest;
  }
};

/// Returns whether distance <= a + b for squares of all three.
bool within_sum(const Rational& squared_distance, const Rational& a, const Rational& b) {
  const Rational rest = squared_distance - a - b;
  return rest <= 0 || rest * rest <= 4 * a * b;
}

/// Compares a result with distances at many times. No time before the interval may be near; where the result
/// is that the elements never are, no time at all; and the end of the interval is so near that there may be a
/// near time in it.
std::string wrong(const Moving& moving, double distance, const Impact& impact) {
  const Rational limit = Rational(distance) * Rational(distance);
  if (impact.touches) {
    if (!(impact.begin >= 0 && impact.begin <= impact.end && impact.end <= 1)) return "no interval in [0, 1]";
    const Rational width = Rational(impact.end) - Rational(impact.begin);
    if (width > Rational(impact_width)) return "a wide interval";
    const Rational there = moving.squared_distance_at(Rational(impact.end));
    if (!within_sum(there, limit, width * width * moving.squared_speed())) return "far at the end";
    if (impact.begin > 0 && moving.squared_distance_at(Rational(impact.begin)) < limit)
      return "near at the begin";
  }
  constexpr int samples = 48;
  for (int i = 0; i <= samples; ++i) {
    const Rational t = Rational(i) / samples;
    if (impact.touches && t >= Rational(impact.begin)) break;
    if (moving.squared_distance_at(t) <= limit) return "near at " + std::to_string(i) + " / 48";
  }
  return {};
}

/// Compares both ways with definitions and with each other; returns the result of the one without a filter.
Impact checked(const Moving& moving, double distance, ImpactStats* stats = nullptr) {
  const Impact exact = find_approach_exact(moving.kind, moving.points(), distance);
  const Impact found = find_approach(moving.kind, moving.points(), distance, stats);
  EXPECT_EQ(wrong(moving, distance, exact), "");
  EXPECT_EQ(wrong(moving, distance, found), "");
  EXPECT_EQ(exact.touches, found.touches);
  EXPECT_LE(exact.begin, found.end);
  EXPECT_LE(found.begin, exact.end);
  return exact;
}

constexpr Contact::Kind both_kinds[] = {Contact::Kind::vertex_face, Contact::Kind::edge_edge};

/// Small whole numbers: coincident, parallel and degenerate elements, and distances that are just reached.
TEST(Approaches, OfSmallWholeNumbers) {
  ImpactStats stats;
  int touching = 0, late = 0;
  for (std::uint64_t seed = 0; seed < 400; ++seed) {
    Random random(seed);
    Moving moving;
    moving.kind = both_kinds[seed % 2];
    const double scale = seed % 7 == 3 ? 0.1 : 1;
    for (auto* const side : {&moving.begin, &moving.end})
      for (auto& point : *side)
        for (double& x : point) x = scale * (double(random.below(7)) - 3);
    if (random.below(3) == 0) moving.end[random.below(4)] = moving.end[random.below(4)];
    if (random.below(3) == 0) moving.begin[random.below(4)] = moving.begin[random.below(4)];
    const double distance = scale * (1 + random.below(3)) / 2;
    const Impact impact = checked(moving, distance, &stats);
    touching += impact.touches;
    late += impact.touches && impact.begin > 0;
    if (testing::Test::HasFailure()) FAIL() << "seed " << seed;
  }
  EXPECT_GT(touching, 200);
  EXPECT_LT(touching, 395);
  EXPECT_GT(late, 50);
  EXPECT_EQ(stats.tests, 400u);
  EXPECT_EQ(stats.filtered + stats.exact, stats.tests);
}

TEST(Approaches, OfRandomNumbers) {
  ImpactStats stats;
  int touching = 0;
  for (std::uint64_t seed = 0; seed < 600; ++seed) {
    Random random(seed + 1000);
    Moving moving;
    moving.kind = both_kinds[seed % 2];
    for (auto* const side : {&moving.begin, &moving.end})
      for (auto& point : *side)
        for (double& x : point) x = random.unit();
    touching += checked(moving, 0.06 + 0.05 * random.unit(), &stats).touches;
    if (testing::Test::HasFailure()) FAIL() << "seed " << seed;
  }
  EXPECT_GT(touching, 40);
  EXPECT_LT(stats.exact, 150u);  // the filter decides most random motions
}

/// A vertex that flies past a face, an edge, a corner, or past another edge, so that the least distance is 5,
/// reached at t = 1/4 or 3/4 only. One ulp less is never reached, one ulp more earlier.
TEST(Approaches, DistancesThatAreJustReached) {
  struct Case {
    Moving moving;
    double at;
  };
  std::vector<Case> cases;
  const std::array<double, 3> a{-9, -9, 0}, b{9, -9, 0}, c{0, 9, 0};
  const auto vertex = [&](std::array<double, 3> from, std::array<double, 3> to, double at) {
    cases.push_back({{Contact::Kind::vertex_face, {from, a, b, c}, {to, a, b, c}}, at});
  };
  vertex({0, -14, -8}, {0, -14, 24}, 0.25);  // past the edge from a to b, at right angles
  vertex({-8, 13, 3}, {24, 13, 3}, 0.25);    // past the corner c: (0, 4, 3) from there
  vertex({24, 12, 4}, {-8, 12, 4}, 0.75);    // (0, 3, 4)
  cases.push_back({{Contact::Kind::edge_edge,
                    {{{-9, 0, 0}, {9, 0, 0}, {-8, -9, 5}, {-8, 9, 5}}},
                    {{{-9, 0, 0}, {9, 0, 0}, {-8, -9, 5}, {-8, 9, 5}}}},
                   0});  // at rest
  cases.push_back({{Contact::Kind::edge_edge,
                    {{{-9, 0, 0}, {-1, 0, 0}, {3, -8, -3}, {3, -8, -9}}},
                    {{{-9, 0, 0}, {-1, 0, 0}, {3, 24, -3}, {3, 24, -9}}}},
                   0.25});  // past an end: (4, 0, -3) from there
  for (const Case& one : cases)
    for (const double scale : {1.0, 0x1p-300, 0x1p200, 0x1p-40}) {
      Moving moving = one.moving;
      for (auto* const side : {&moving.begin, &moving.end})
        for (auto& point : *side)
          for (double& x : point) x *= scale;
      const Impact impact = checked(moving, 5 * scale);
      ASSERT_TRUE(impact.touches) << one.at;
      EXPECT_LE(impact.begin, one.at);
      EXPECT_GE(impact.end, one.at);
      EXPECT_FALSE(checked(moving, std::nextafter(5 * scale, 0)).touches) << one.at;
      const Impact more = checked(moving, std::nextafter(5 * scale, 1e300));
      ASSERT_TRUE(more.touches);
      EXPECT_LE(more.begin, one.at);
    }
}

/// A vertex that falls on the inside of a face reaches a height of d at a known time; an ulp of a coordinate
/// aside of the face's prism, a corner or an edge is nearest.
TEST(Approaches, KnownTimesOfArrival) {
  Moving moving{Contact::Kind::vertex_face,
                {{{0.25, 0.25, 8}, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}}},
                {{{0.25, 0.25, 0}, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}}}};
  for (const double distance : {4.0, 1.0, 0.5, 0x1p-30, 3.0}) {
    const Impact impact = checked(moving, distance);
    ASSERT_TRUE(impact.touches);
    EXPECT_LE(impact.begin, 1 - distance / 8);
    EXPECT_GE(impact.end, 1 - distance / 8);
  }
  moving.end[0][2] = 2;
  EXPECT_TRUE(checked(moving, 2).touches);  // at t = 1
  EXPECT_FALSE(checked(moving, std::nextafter(2.0, 0.0)).touches);
  // The same next to a corner: a distance of 2 is never reached.
  moving.begin[0][0] = moving.end[0][0] = -0x1p-40;
  moving.begin[0][1] = moving.end[0][1] = -0x1p-40;
  EXPECT_FALSE(checked(moving, 2).touches);
}

/// Elements that are degenerate throughout, or at the time that counts.
TEST(Approaches, DegenerateElements) {
  // All corners of the face are one point, which the vertex passes at a distance of 1.
  Moving moving{Contact::Kind::vertex_face,
                {{{-4, 1, 0}, {0, 0, 0}, {0, 0, 0}, {0, 0, 0}}},
                {{{4, 1, 0}, {0, 0, 0}, {0, 0, 0}, {0, 0, 0}}}};
  EXPECT_TRUE(checked(moving, 1).touches);
  EXPECT_FALSE(checked(moving, std::nextafter(1.0, 0.0)).touches);
  // A face that shrinks to a point at t = 1/2 and grows again, turned over, far from the vertex.
  moving = {Contact::Kind::vertex_face,
            {{{0, 0, 10}, {-1, -1, 0}, {1, -1, 0}, {0, 1, 0}}},
            {{{0, 0, 10}, {1, 1, 0}, {-1, 1, 0}, {0, -1, 0}}}};
  EXPECT_FALSE(checked(moving, 9.5).touches);
  EXPECT_TRUE(checked(moving, 10).touches);
  // An edge that shrinks to a point at t = 1/2; only the other edge's line is near then.
  moving = {Contact::Kind::edge_edge,
            {{{-1, 0, 0}, {1, 0, 0}, {3, -1, 0}, {5, -1, 0}}},
            {{{1, 0, 0}, {-1, 0, 0}, {3, -1, 0}, {5, -1, 0}}}};
  EXPECT_FALSE(checked(moving, 2).touches);
  EXPECT_TRUE(checked(moving, 2.5).touches);
  // Parallel edges side by side, which come nearer.
  moving = {Contact::Kind::edge_edge,
            {{{-1, 0, 0}, {1, 0, 0}, {-1, 4, 0}, {1, 4, 0}}},
            {{{-1, 0, 0}, {1, 0, 0}, {-1, 0, 0}, {1, 0, 0}}}};
  const Impact impact = checked(moving, 1);
  EXPECT_LE(impact.begin, 0.75);
  EXPECT_GE(impact.end, 0.75);
}

/// The comparison with rationals fails for times that are late, early, or missed.
TEST(Approaches, WrongTimesAreCaught) {
  const Moving moving{Contact::Kind::vertex_face,
                      {{{0.25, 0.25, 8}, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}}},
                      {{{0.25, 0.25, 0}, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}}}};
  const Impact right = checked(moving, 2);
  EXPECT_NE(wrong(moving, 2, {}), "");
  EXPECT_NE(wrong(moving, 2, {true, right.begin + 0x1p-10, right.end + 0x1p-10}), "");
  EXPECT_NE(wrong(moving, 2, {true, right.begin - 0x1p-10, right.end - 0x1p-10}), "");
  EXPECT_NE(wrong(moving, 2, {true, right.begin - 0x1p-10, right.end}), "");
}

}  // namespace
}  // namespace kbvh::test::broad_phase
