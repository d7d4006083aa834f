#include "core/families/linear/kernels/span_tests.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "core/geometry/triangle_triangle.hpp"
#include "core/kernels/kernel_set.hpp"
#include "core/motion/round_positions.hpp"
#include "tests/unit/triangle_pairs.hpp"

// A kernel's verdict on a span must match the exact test of the positions at every frame in it.

namespace kbvh {
namespace {

using namespace triangle_pairs;

/// Pairs of triangles at both ends of a segment from 0 to 1, and the queried spans.
template <class S>
struct Family {
  std::vector<S> coordinates[2];  // [pair][6][4]
  std::vector<SpanPair<S>> pairs;

  void add(const Pair<S>& first, const Pair<S>& last, float begin, float end) {
    for (const auto& [pair, to] : {std::pair(&first, &coordinates[0]), std::pair(&last, &coordinates[1])})
      for (const auto& triangle : *pair)
        for (const auto& p : triangle)
          to->insert(to->end(), {p[0], p[1], p[2], std::numeric_limits<S>::quiet_NaN()});
    pairs.push_back({{}, begin, end});
  }
  void close() {
    for (std::size_t i = 0; i < pairs.size(); ++i)
      for (int end = 0; end < 2; ++end)
        for (std::size_t c = 0; c < 6; ++c)
          pairs[i].corner[end][c] = coordinates[end].data() + 24 * i + 4 * c;
  }
  /// As strategies choose it for rounded positions at the ends: span_rounding(unit_rounding).
  static constexpr S rounding = 9 * std::numeric_limits<S>::epsilon();
};

template <class S>
bool intersect_at(const SpanPair<S>& pair, double t) {
  S at[6][3];
  for (std::size_t c = 0; c < 6; ++c) round_chord(pair.corner[0][c], pair.corner[1][c], 3, 0, 1, t, at[c]);
  return triangles_intersect<S>(at[0], at[1], at[2], at[3], at[4], at[5]);
}

struct Tally {
  std::size_t apart = 0, intersect = 0, open = 0, open_but_constant = 0;
};

template <class S>
Tally check(Family<S>& family) {
  family.close();
  Tally tally;
  for (const KernelSet set : supported_kernel_sets()) {
    tally = {};
    std::vector<SpanVerdict> verdicts(family.pairs.size());
    span_test_kernels<S>(set).decide(family.pairs.data(), family.pairs.size(), family.rounding,
                                     verdicts.data());
    int wrong = 0;
    for (std::size_t i = 0; i < family.pairs.size(); ++i) {
      const SpanPair<S>& pair = family.pairs[i];
      constexpr int samples = 16;
      int meeting = 0;
      for (int k = 0; k <= samples; ++k)
        meeting +=
            intersect_at(pair, double(pair.begin) + (double(pair.end) - double(pair.begin)) * k / samples)
                ? 1
                : 0;
      switch (verdicts[i]) {
        case SpanVerdict::apart:
          ++tally.apart;
          wrong += meeting == 0 ? 0 : 1;
          break;
        case SpanVerdict::intersect:
          ++tally.intersect;
          wrong += meeting == samples + 1 ? 0 : 1;
          break;
        case SpanVerdict::open:
          ++tally.open;
          tally.open_but_constant += meeting == 0 || meeting == samples + 1 ? 1 : 0;
          break;
      }
    }
    EXPECT_EQ(wrong, 0) << name(set);
  }
  return tally;
}

float fraction(Random& random) {
  return float(uniform(random, 0, 1000)) / 1000;
}
template <class S>
Pair<S> random_pair(Random& random, S size) {
  std::uniform_real_distribution<double> place(-1, 1);
  Pair<S> pair;
  for (auto& triangle : pair)
    for (auto& p : triangle)
      for (auto& x : p) x = size * S(place(random));
  return pair;
}
template <class S>
Pair<S> moved(Pair<S> pair, Random& random, S by) {
  std::uniform_real_distribution<double> way(-1, 1);
  for (auto& triangle : pair)
    for (auto& p : triangle)
      for (auto& x : p) x += by * S(way(random));
  return pair;
}

template <class S>
class SpanTests : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(SpanTests, Scalars);

TYPED_TEST(SpanTests, SlowPairsAreMostlyDecided) {
  using S = TypeParam;
  Random random(1);
  Family<S> family;
  for (int i = 0; i < 3000; ++i) {
    const Pair<S> pair = random_pair<S>(random, 1);
    const float a = fraction(random), b = fraction(random);
    family.add(pair, moved<S>(pair, random, S(0.05)), std::min(a, b), std::max(a, b));
  }
  const Tally tally = check(family);
  EXPECT_GT(tally.apart, 1500u);
  EXPECT_GT(tally.intersect, 300u);
  EXPECT_LT(tally.open_but_constant, 150u);
}

TYPED_TEST(SpanTests, FastPairsAreNeverDecidedWrongly) {
  using S = TypeParam;
  Random random(2);
  Family<S> family;
  for (int i = 0; i < 3000; ++i) family.add(random_pair<S>(random, 1), random_pair<S>(random, 1), 0, 1);
  const Tally tally = check(family);
  EXPECT_GT(tally.apart, 100u);
  EXPECT_GT(tally.open, 100u);
}

// Integer corners: touching, coplanar and degenerate pairs, which no strict sign decides.
TYPED_TEST(SpanTests, TouchingPairsStayOpen) {
  using S = TypeParam;
  Random random(3);
  Family<S> family;
  for (int i = 0; i < 3000; ++i) {
    const Pair<S> pair = i % 2 == 0 ? grid_pair<S>(random, 3) : coplanar_pair<S>(random, 4);
    family.add(pair, i % 3 == 0 ? grid_pair<S>(random, 3) : pair, 0, fraction(random));
  }
  check(family);
}

// Far from the origin a gap of some ulps may close at a frame, where positions are rounded.
TYPED_TEST(SpanTests, GapsOfRoundingStayOpen) {
  using S = TypeParam;
  Random random(4);
  Family<S> family;
  const S ulp = std::numeric_limits<S>::epsilon() * 1000;
  for (int i = 0; i < 3000; ++i) {
    Pair<S> pair = grid_pair<S>(random, 3);
    for (auto& triangle : pair)
      for (auto& p : triangle)
        for (auto& x : p) x = 1000 + 2000 * ulp * x;
    Pair<S> last = moved<S>(pair, random, 4 * ulp);
    family.add(moved<S>(pair, random, 4 * ulp), last, 0, 1);
  }
  check(family);
}

// Spans of no length are single frames.
TYPED_TEST(SpanTests, SingleFrames) {
  using S = TypeParam;
  Random random(5);
  Family<S> family;
  for (int i = 0; i < 3000; ++i) {
    const float at = fraction(random);
    family.add(random_pair<S>(random, 1), random_pair<S>(random, 1), at, at);
  }
  const Tally tally = check(family);
  EXPECT_LT(tally.open, 30u);
}

}  // namespace
}  // namespace kbvh
