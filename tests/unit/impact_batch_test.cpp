// Impacts in batches against single tests and against exact arithmetic, with every kernel set: next to
// contact, exactly on borders, grazing, degenerate, far from the origin. KBVH_SLOW=1 takes a million queries.
#include "core/continuous/impact_batch.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <string>
#include <vector>

#include "core/broad_phase/approach.hpp"
#include "tests/support/random.hpp"
#include "tests/support/rounding.hpp"

namespace kbvh::test::impact_batch_test {
namespace {

using testing_support::slow;
using Kind = Contact::Kind;
using Point = std::array<double, 3>;

struct Query {
  Kind kind = Kind::vertex_face;
  std::array<Point, 4> begin{}, end{};

  MovingPoints moving() const {
    return {{begin[0].data(), begin[1].data(), begin[2].data(), begin[3].data()},
            {end[0].data(), end[1].data(), end[2].data(), end[3].data()}};
  }
  std::string text() const {
    std::string all = kind == Kind::vertex_face ? "vertex-face" : "edge-edge";
    char number[64];
    for (std::size_t i = 0; i < 4; ++i)
      for (const Point& p : {begin[i], end[i]}) {
        all += ";";
        for (const double x : p) {
          std::snprintf(number, sizeof number, " %a", x);
          all += number;
        }
      }
    return all;
  }
  /// Applies a function to all numbers.
  template <class Function>
  void change(const Function& function) {
    for (auto* points : {&begin, &end})
      for (Point& p : *points)
        for (double& x : p) x = function(x);
  }
};

// ---- Queries next to contact ------------------------------------------------------------------------------

Point random_point(Random& random, double size) {
  return {size * random.unit(), size * random.unit(), size * random.unit()};
}
/// Returns p + share (q - p).
Point on_line(const Point& p, const Point& q, double share) {
  return {p[0] + share * (q[0] - p[0]), p[1] + share * (q[1] - p[1]), p[2] + share * (q[2] - p[2])};
}

/// Lets four points in contact at t move with velocities.
Query moved(Kind kind, const std::array<Point, 4>& contact, const std::array<Point, 4>& velocity, double t) {
  Query query{kind, {}, {}};
  for (std::size_t i = 0; i < 4; ++i)
    for (std::size_t k = 0; k < 3; ++k) {
      query.begin[i][k] = contact[i][k] - t * velocity[i][k];
      query.end[i][k] = contact[i][k] + (1 - t) * velocity[i][k];
    }
  return query;
}

/// Points that touch within rounding, or miss each other by a little: inside, on a border, or at a corner.
std::array<Point, 4> touching(Random& random, Kind kind) {
  const auto share = [&] {
    const std::uint32_t choice = random.below(5);
    return choice == 0 ? 0.0 : choice == 1 ? 1.0 : 0.5 + 0.5 * random.unit();
  };
  constexpr double misses[] = {0, 0, 1e-17, 1e-15, 1e-12, 1e-7, 1e-2};
  const Point miss = random_point(random, misses[random.below(7)]);
  std::array<Point, 4> p;
  for (Point& one : p) one = random_point(random, 1);
  if (kind == Kind::vertex_face)
    p[0] = on_line(p[1], on_line(p[2], p[3], share()), share());
  else
    p[2 + random.below(2)] = on_line(p[0], p[1], share());
  if (kind == Kind::edge_edge && random.below(2) == 0) {
    // The point of contact is inside the second edge, too.
    const Point x = p[2];
    const double way = 0.1 + 0.8 * std::abs(random.unit());
    p[3] = on_line(x, p[3], way);
    p[2] = on_line(p[3], x, 1 / (1 - 0.5 * way));
  }
  for (std::size_t k = 0; k < 3; ++k) p[0][k] += miss[k];
  return p;
}

Query general(Random& random, Kind kind) {
  constexpr double speeds[] = {0.01, 0.3, 1, 10};
  const double speed = speeds[random.below(4)], t = 0.5 + 0.5 * random.unit();
  std::array<Point, 4> velocity;
  for (Point& v : velocity) v = random_point(random, speed);
  if (random.below(4) == 0) velocity[2] = velocity[3] = velocity[1];
  return moved(kind, touching(random, kind), velocity, t);
}
Query far_away(Random& random, Kind kind) {
  Query query = general(random, kind);
  const Point place = random_point(random, std::pow(10.0, 1 + random.below(9)));
  for (auto* points : {&query.begin, &query.end})
    for (Point& p : *points)
      for (std::size_t k = 0; k < 3; ++k) p[k] += place[k];
  return query;
}
Query rounded_to_float(Random& random, Kind kind) {
  Query query = random.below(2) == 0 ? general(random, kind) : far_away(random, kind);
  query.change([](double x) { return double(float(x)); });
  return query;
}
Query of_extreme_size(Random& random, Kind kind) {
  Query query = general(random, kind);
  constexpr double sizes[] = {0x1p300, 0x1p-300, 0x1p-500, 0x1p-1000, 0x1p-1060};
  const double size = sizes[random.below(5)];
  query.change([&](double x) { return x * size; });
  return query;
}

/// Numbers of 30 bits, so that products are rounded: exactly in contact at t = 0, 1/3 or 1, where the vertex
/// is on the face's third side, or an edge ends on the other. The elements do not turn.
Query exactly_on_border(Random& random, Kind kind) {
  const auto whole = [&](int scale) { return 3.0 * scale * (double(random.below(1u << 28)) - 0x1p27); };
  std::array<Point, 4> p;
  for (Point& one : p) one = {whole(1), whole(1), whole(1)};
  for (std::size_t k = 0; k < 3; ++k) {
    if (kind == Kind::vertex_face)
      p[0][k] = p[2][k] + (p[3][k] - p[2][k]) / 3;
    else
      p[1][k] = p[2][k] + (p[3][k] - p[2][k]) / 3;
  }
  const std::uint32_t bits_off = random.below(6);
  if (bits_off < 3) p[kind == Kind::vertex_face ? 0 : 1][bits_off] += random.below(2) == 0 ? 1 : -1;
  // Along one axis, so that shares along that axis stay as they are.
  const std::size_t axis = random.below(3);
  const double way[2] = {whole(1), random.below(2) == 0 ? 0 : whole(1)};
  const std::uint32_t when = random.below(3);
  const double before[] = {0, 1, 3}, after[] = {3, 2, 0};
  Query query{kind, p, p};
  for (std::size_t i = 0; i < 4; ++i) {
    const bool second = kind == Kind::vertex_face ? i > 0 : i > 1;
    query.begin[i][axis] -= before[when] * way[second ? 1 : 0];
    query.end[i][axis] += after[when] * way[second ? 1 : 0];
  }
  return query;
}

/// The height over the face is a product of two linear functions of t, and a lift: no root, a double root, or
/// two near each other. A matrix of integers turns it.
Query grazing(Random& random, Kind kind) {
  constexpr double lifts[] = {0, 0x1p-50, -0x1p-50, 0x1p-30, -0x1p-30, 0.125, -0.125, 0.25};
  const double lift = lifts[random.below(8)];
  Query query{kind, {}, {}};
  if (kind == Kind::vertex_face) {
    query.begin = {{{6, 1, 1.5 + lift}, {0, 0, 0}, {8, 0, 2}, {0, 8, 0}}};
    query.end = {{{2, 1, -0.5 + lift}, {0, 0, 0}, {8, 0, -2}, {0, 8, 0}}};
  } else {
    query.begin = {{{0, 1, 0}, {8, 1, 2}, {6, 0, 1.5 + lift}, {6, 2, 1.5 + lift}}};
    query.end = {{{0, 1, 0}, {8, 1, -2}, {2, 0, -0.5 + lift}, {2, 2, -0.5 + lift}}};
  }
  double matrix[3][3];
  for (auto& row : matrix)
    for (double& x : row) x = double(int(random.below(7)) - 3);
  for (auto* points : {&query.begin, &query.end})
    for (Point& p : *points) {
      const Point from = p;
      for (std::size_t k = 0; k < 3; ++k)
        p[k] = matrix[k][0] * from[0] + matrix[k][1] * from[1] + matrix[k][2] * from[2];
    }
  return query;
}

/// Small integers: coincident points, motions in one plane, points at rest.
Query degenerate(Random& random, Kind kind) {
  const int reach = 1 + int(random.below(3));
  const bool planar = random.below(4) == 0;
  const auto coordinate = [&] { return double(int(random.below(std::uint32_t(2 * reach + 1))) - reach); };
  Query query{kind, {}, {}};
  for (auto* points : {&query.begin, &query.end})
    for (Point& p : *points) p = {coordinate(), coordinate(), planar ? 0 : coordinate()};
  if (random.below(3) == 0) query.begin[3] = query.begin[2];
  if (random.below(3) == 0) query.end[3] = query.end[2];
  if (random.below(4) == 0) query.end[1] = query.begin[1];
  if (random.below(4) == 0) query.end = query.begin;
  return query;
}

/// Without any relation: most are free.
Query unrelated(Random& random, Kind kind) {
  Query query{kind, {}, {}};
  for (auto* points : {&query.begin, &query.end})
    for (Point& p : *points) p = random_point(random, 1);
  return query;
}

struct Family {
  const char* name;
  Query (*make)(Random&, Kind);
};
constexpr Family families[] = {{"general", general},
                               {"far away", far_away},
                               {"float", rounded_to_float},
                               {"extreme size", of_extreme_size},
                               {"exactly on border", exactly_on_border},
                               {"grazing", grazing},
                               {"degenerate", degenerate},
                               {"unrelated", unrelated}};

// ---- Checks -----------------------------------------------------------------------------------------------

bool same(const Impact& a, const Impact& b) {
  return a.touches == b.touches && a.begin == b.begin && a.end == b.end;
}

/// How one family was decided.
struct Tally {
  std::size_t touching = 0, free = 0, by_filter = 0;
  bool operator==(const Tally&) const = default;
};

/// Decides queries of one kind in batches of several sizes, of which the sets differ in all lanes.
Tally check(const std::vector<Query>& queries, KernelSet set, const std::vector<Impact>& single,
            const std::vector<Impact>& exact, const ImpactStats& single_stats) {
  Tally tally;
  ImpactStats stats;
  ImpactBatch batch(queries[0].kind, set);
  constexpr std::size_t sizes[] = {ImpactBatch::room, 1, 7, ImpactBatch::room - 1, 16};
  for (std::size_t first = 0, round = 0; first < queries.size(); ++round) {
    const std::size_t count = std::min(sizes[round % std::size(sizes)], queries.size() - first);
    for (std::size_t i = 0; i < count; ++i) batch.add(queries[first + i].moving());
    EXPECT_EQ(batch.size(), count);
    // The filter alone, on some of them: what it proves is what exact arithmetic says, to the last bit.
    const ImpactBatch::Mask which =
        batch.all() & (round % 3 == 0 ? ~ImpactBatch::Mask(0) : 0x5f3759df96a5c3e7u);
    const ImpactBatch::Mask decided = batch.filter(which);
    EXPECT_EQ(decided & ~which, 0u);
    for (std::size_t i = 0; i < count; ++i) {
      if ((decided >> i & 1) != 0) {
        EXPECT_TRUE(same(batch.impact(i), exact[first + i])) << name(set) << " " << queries[first + i].text();
      }
    }
    batch.decide(&stats);
    for (std::size_t i = 0; i < count; ++i) {
      EXPECT_TRUE(same(batch.impact(i), single[first + i])) << name(set) << " " << queries[first + i].text();
      ++(batch.impact(i).touches ? tally.touching : tally.free);
    }
    tally.by_filter += std::size_t(std::popcount(batch.filter(batch.all())));
    batch.clear();
    first += count;
  }
  EXPECT_EQ(stats.tests, queries.size());
  EXPECT_EQ(stats.filtered + stats.exact, stats.tests);
  EXPECT_LE(stats.exact, single_stats.exact) << name(set);
  return tally;
}

void check_family(const Family& family, Kind kind, std::uint64_t seed, std::size_t count) {
  Random random(seed);
  std::vector<Query> queries;
  std::vector<Impact> single, exact;
  ImpactStats stats;
  for (std::size_t i = 0; i < count; ++i) {
    queries.push_back(family.make(random, kind));
    single.push_back(find_impact(kind, queries.back().moving(), &stats));
    exact.push_back(find_impact_exact(kind, queries.back().moving()));
    ASSERT_EQ(single.back().touches, exact.back().touches) << family.name << queries.back().text();
  }
  const Tally expected = check(queries, KernelSet::portable, single, exact, stats);
  for (const KernelSet set : supported_kernel_sets())
    EXPECT_EQ(check(queries, set, single, exact, stats), expected) << family.name << ", " << name(set);
  // Each family has both answers.
  EXPECT_GT(expected.touching, count / 50) << family.name;
  EXPECT_GT(expected.free, count / 50) << family.name;
  // Most of those next to contact are on a border.
  const std::string what = family.name;
  if (what == "unrelated") {
    EXPECT_GT(expected.by_filter, count / 2);
  } else if (what == "general" || what == "far away") {
    EXPECT_GT(expected.by_filter, count / 4) << what;
  }
}

TEST(ImpactBatch, DecidesAsSingleAndExactTests) {
  const std::size_t count = slow() ? 1'000'000 / (2 * std::size(families)) : 1000;
  std::uint64_t seed = 1;
  for (const Family& family : families)
    for (const Kind kind : {Kind::vertex_face, Kind::edge_edge})
      ASSERT_NO_FATAL_FAILURE(check_family(family, kind, ++seed, count));
}

TEST(ImpactBatch, AllAndPartsOfABatch) {
  ImpactBatch batch(Kind::edge_edge);
  EXPECT_EQ(batch.all(), 0u);
  batch.decide();
  Random random(3);
  std::vector<Query> queries;
  while (!batch.full()) {
    queries.push_back(general(random, Kind::edge_edge));
    batch.add(queries.back().moving());
    EXPECT_EQ(std::size_t(std::popcount(batch.all())), batch.size());
  }
  EXPECT_EQ(batch.all(), ~ImpactBatch::Mask(0));
  // Numbers come back as they were given.
  const ImpactBatch::Query last = batch.query(ImpactBatch::room - 1);
  for (std::size_t i = 0; i < 4; ++i)
    for (std::size_t k = 0; k < 3; ++k) {
      EXPECT_EQ(last.begin[i][k], queries.back().begin[i][k]);
      EXPECT_EQ(last.end[i][k], queries.back().end[i][k]);
    }
  for (std::size_t i = 0; i < ImpactBatch::room; ++i) {
    ImpactStats stats;
    batch.decide(ImpactBatch::Mask(1) << i, &stats);
    EXPECT_EQ(stats.tests, 1u);
    EXPECT_TRUE(same(batch.impact(i), find_impact(Kind::edge_edge, queries[i].moving())));
  }
}

// ---- Seeded faults ----------------------------------------------------------------------------------------

struct Judged {
  Query query;
  bool touches;
};

/// Counts the queries that the filter decides wrongly if its error bounds are these.
std::size_t wrong_verdicts(const std::vector<Judged>& queries, const ImpactErrors& errors, KernelSet set) {
  std::size_t wrong = 0;
  for (const Kind kind : {Kind::vertex_face, Kind::edge_edge}) {
    ImpactBatch batch(kind, set, errors);
    std::vector<bool> truth;
    const auto compare = [&] {
      const ImpactBatch::Mask decided = batch.filter(batch.all());
      for (std::size_t i = 0; i < batch.size(); ++i)
        if ((decided >> i & 1) != 0 && batch.impact(i).touches != truth[i]) ++wrong;
      batch.clear();
      truth.clear();
    };
    for (const Judged& judged : queries) {
      if (judged.query.kind != kind) continue;
      batch.add(judged.query.moving());
      truth.push_back(judged.touches);
      if (batch.full()) compare();
    }
    compare();
  }
  return wrong;
}

TEST(ImpactBatch, BoundsThatAreTooSmallAreCaught) {
  std::vector<Judged> queries;
  Random random(5);
  for (const Family& family : families)
    for (int i = 0; i < 1000; ++i) {
      const Query query = family.make(random, i % 2 == 0 ? Kind::vertex_face : Kind::edge_edge);
      queries.push_back({query, find_impact(query.kind, query.moving()).touches});
    }
  for (const KernelSet set : supported_kernel_sets()) {
    EXPECT_EQ(wrong_verdicts(queries, impact_errors, set), 0u) << name(set);
    ImpactErrors errors = impact_errors;
    errors.cubic = errors.least_cubic = 0;
    EXPECT_GT(wrong_verdicts(queries, errors, set), 0u) << name(set);
    errors = impact_errors;
    errors.quadratic = errors.least_quadratic = 0;
    EXPECT_GT(wrong_verdicts(queries, errors, set), 0u) << name(set);
  }
}

// ---- Separation -------------------------------------------------------------------------------------------

TEST(ImpactBatch, WhatIsApartComesNotNear) {
  Random random(7);
  std::size_t apart = 0, far = 0;
  for (int round = 0; round < 8; ++round)
    for (const Kind kind : {Kind::vertex_face, Kind::edge_edge}) {
      const Family& family = families[std::size_t(round) % std::size(families)];
      const double until = round % 5 == 0 ? 1 : 0.5 + 0.5 * random.unit();
      std::vector<Query> queries;
      double size = 0;
      while (queries.size() < ImpactBatch::room) {
        queries.push_back(family.make(random, kind));
        if (round % 2 == 0)
          for (auto* points : {&queries.back().begin, &queries.back().end})
            for (std::size_t k = 0; k < 3; ++k) (*points)[0][k] *= 1.5;
        size = std::abs(queries.back().begin[1][0] - queries.back().begin[0][0]);
      }
      const double separation = std::min(0.1 * size, 1e50);
      ImpactBatch::Mask expected = 0;
      for (const KernelSet set : supported_kernel_sets()) {
        ImpactBatch batch(kind, set);
        for (const Query& query : queries) batch.add(query.moving());
        const ImpactBatch::Mask found = batch.apart_until(until, separation);
        if (set == KernelSet::portable) expected = found;
        ASSERT_EQ(found, expected) << name(set) << ", " << family.name;
        // Elements that are apart by more are apart by less.
        EXPECT_EQ(batch.apart_until(until, 1.25 * separation) & ~found, 0u);
      }
      for (std::size_t i = 0; i < queries.size(); ++i) {
        const Impact near = find_approach(kind, queries[i].moving(), separation);
        const bool later = !near.touches || near.begin > until;
        far += later ? 1 : 0;
        if ((expected >> i & 1) == 0) continue;
        ++apart;
        EXPECT_TRUE(!near.touches || near.end > until) << family.name << queries[i].text();
      }
    }
  EXPECT_GT(far, 200u);
  EXPECT_GT(apart, far / 2);
}

/// A vertex at exactly the distance 5 m from a large face's plane, whose normal is (3, 4, 0): it is near, and
/// no plane separates it by more. Numbers are of 30 bits, so that products are rounded.
TEST(ImpactBatch, ADistanceThatIsReachedIsNotApart) {
  Random random(11);
  std::size_t wrong = 0;
  for (const KernelSet set : supported_kernel_sets())
    for (const bool fault : {false, true}) {
      ImpactErrors errors = impact_errors;
      if (fault) errors.gap = 0;
      for (int round = 0; round < 200; ++round) {
        const double m = 1 + double(random.below(7)), separation = 5 * m;
        ImpactBatch batch(Kind::vertex_face, set, errors);
        while (!batch.full()) {
          Query query;
          const auto in_plane = [&] {
            const double along = double(random.below(1u << 28)) - 0x1p27,
                         up = double(random.below(1u << 30)) - 0x1p29;
            return Point{-4 * along, 3 * along, up};
          };
          for (std::size_t i = 1; i < 4; ++i) query.begin[i] = in_plane();
          // The centre of an even triangle is inside.
          for (std::size_t k = 0; k < 3; ++k) {
            query.begin[3][k] = 4 * query.begin[3][k];
            query.begin[1][k] = 4 * query.begin[1][k];
            query.begin[2][k] = 4 * query.begin[2][k];
            query.begin[0][k] = (query.begin[1][k] + query.begin[2][k]) / 4 + query.begin[3][k] / 2;
          }
          query.begin[0][0] += 3 * m;
          query.begin[0][1] += 4 * m;
          query.end = query.begin;
          batch.add(query.moving());
        }
        const ImpactBatch::Mask found = batch.apart_until(1, separation);
        if (fault)
          wrong += std::size_t(std::popcount(found));
        else
          EXPECT_EQ(found, 0u) << name(set);
      }
    }
  EXPECT_GT(wrong, 0u);
}

}  // namespace
}  // namespace kbvh::test::impact_batch_test
