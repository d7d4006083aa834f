#include "core/geometry/triangle_batch.hpp"
#include "core/geometry/lane_box.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "core/scene/cut_polygons.hpp"
#include "core/scene/pairs.hpp"
#include "core/scene/playback.hpp"
#include "tests/unit/triangle_pairs.hpp"

// The batched test against the single one, which triangle_triangle_test checks against CGAL: the same answers
// and the same counts, in every kernel set that runs here.

namespace kbvh {
namespace {

using namespace triangle_pairs;

/// The value at the place of a fourth lane: nothing may depend on it.
template <class S>
S padding(std::size_t i) {
  constexpr S values[] = {std::numeric_limits<S>::quiet_NaN(), std::numeric_limits<S>::infinity(),
                          std::numeric_limits<S>::max(), -std::numeric_limits<S>::denorm_min()};
  return values[i % std::size(values)];
}

template <class S>
struct Batch {
  std::vector<S> coordinates;  // [pair][6][4], the fourth one is padding
  std::vector<TrianglePair<S>> pairs;

  explicit Batch(const std::vector<Pair<S>>& from) : pairs(from.size()) {
    coordinates.reserve(24 * from.size());
    for (const auto& pair : from)
      for (const auto& triangle : pair)
        for (const auto& p : triangle)
          coordinates.insert(coordinates.end(), {p[0], p[1], p[2], padding<S>(coordinates.size() / 4)});
    for (std::size_t i = 0; i < pairs.size(); ++i)
      for (std::size_t c = 0; c < 6; ++c) pairs[i].corner[c] = coordinates.data() + 24 * i + 4 * c;
  }
};

void expect_equal(const TriangleTestStats& stats, const TriangleTestStats& expected, const char* set) {
  EXPECT_EQ(stats.tests, expected.tests) << set;
  EXPECT_EQ(stats.filtered, expected.filtered) << set;
  EXPECT_EQ(stats.exact, expected.exact) << set;
}

/// The results of a family in single tests.
struct Tally {
  std::size_t intersecting = 0, separate = 0;
  TriangleTestStats stats;
};

/// Every kernel set answers and counts like the single test.
template <class S>
Tally check(const std::vector<Pair<S>>& family) {
  const Batch<S> batch(family);
  Tally tally;
  std::vector<std::uint8_t> expected;
  for (const auto& pair : batch.pairs) {
    const auto& c = pair.corner;
    const bool answer = triangles_intersect<S>(c[0], c[1], c[2], c[3], c[4], c[5], &tally.stats);
    expected.push_back(answer ? 1 : 0);
    (answer ? tally.intersecting : tally.separate) += 1;
  }
  for (const KernelSet set : supported_kernel_sets()) {
    constexpr std::uint8_t untouched = 7;
    std::vector<std::uint8_t> answers(family.size() + 1, untouched);
    TriangleTestStats stats;
    triangles_intersect(std::span<const TrianglePair<S>>(batch.pairs), answers.data(), stats, set);
    EXPECT_EQ(answers.back(), untouched) << name(set);
    int wrong = 0;
    for (std::size_t i = 0; i < family.size(); ++i)
      if (answers[i] != expected[i] && ++wrong <= 3)
        ADD_FAILURE() << name(set) << " answers " << int(answers[i]) << " for pair " << i << "\n"
                      << describe(family[i]);
    expect_equal(stats, tally.stats, name(set));
  }
  return tally;
}

/// In addition, the family is meaningful: both answers occur, by the filter and exactly.
template <class S>
void check_family(const std::vector<Pair<S>>& family, std::size_t at_least) {
  const Tally tally = check(family);
  EXPECT_GE(tally.intersecting, at_least);
  EXPECT_GE(tally.separate, at_least);
  EXPECT_GE(tally.stats.filtered, at_least);
  EXPECT_GE(tally.stats.exact, at_least);
}

template <class S>
std::vector<Pair<S>> repeated(int count, const std::function<Pair<S>(int)>& make) {
  std::vector<Pair<S>> family;
  for (int i = 0; i < count; ++i) family.push_back(make(i));
  return family;
}

/// Triangles in general position.
template <class S>
Pair<S> random_pair(Random& random) {
  std::uniform_real_distribution<double> real(-1, 1);
  Pair<S> pair;
  for (auto& triangle : pair)
    for (auto& p : triangle)
      for (auto& x : p) x = S(real(random));
  return pair;
}

/// The largest magnitude becomes `magnitude`.
template <class S>
void stretch(Pair<S>& pair, S magnitude) {
  S largest = 0;
  for (const auto& triangle : pair)
    for (const auto& p : triangle)
      for (const S x : p) largest = std::max(largest, std::abs(x));
  for (auto& triangle : pair)
    for (auto& p : triangle)
      for (S& x : p) x = largest == 0 ? 0 : x / largest * magnitude;
}

template <class S>
class TriangleBatch : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(TriangleBatch, Scalars);

TYPED_TEST(TriangleBatch, GeneralPosition) {
  Random random(1);
  const Tally tally = check(repeated<TypeParam>(50000, [&](int) { return random_pair<TypeParam>(random); }));
  EXPECT_GE(tally.intersecting, 5000U);
  EXPECT_GE(tally.separate, 5000U);
}

/// Every order of corners and triangles: all entries of the table of apices.
TYPED_TEST(TriangleBatch, AllOrders) {
  Random random(2);
  std::vector<Pair<TypeParam>> family;
  for (int n = 0; n < 300; ++n) {
    const Pair<TypeParam> pair = random_pair<TypeParam>(random);
    std::array<std::size_t, 3> i{0, 1, 2};
    do {
      const Corners<TypeParam> a{pair[0][i[0]], pair[0][i[1]], pair[0][i[2]]};
      std::array<std::size_t, 3> j{0, 1, 2};
      do {
        const Corners<TypeParam> b{pair[1][j[0]], pair[1][j[1]], pair[1][j[2]]};
        family.push_back({a, b});
        family.push_back({b, a});
      } while (std::next_permutation(j.begin(), j.end()));
    } while (std::next_permutation(i.begin(), i.end()));
  }
  check(family);
}

TYPED_TEST(TriangleBatch, SmallGrids) {
  Random random(3);
  for (const int n : {2, 3, 4, 8})
    check_family(repeated<TypeParam>(5000, [&](int) { return grid_pair<TypeParam>(random, n); }), 300);
}

TYPED_TEST(TriangleBatch, Coplanar) {
  Random random(4);
  for (const int n : {2, 3, 5, 20})
    check_family(repeated<TypeParam>(5000, [&](int) { return coplanar_pair<TypeParam>(random, n); }), 200);
}

TYPED_TEST(TriangleBatch, ContactsRounded) {
  Random random(5);
  check_family(repeated<TypeParam>(20000, [&](int) { return contact_pair<TypeParam>(random); }), 500);
}

TYPED_TEST(TriangleBatch, OneUlpFromDegenerate) {
  Random random(6);
  check_family(repeated<TypeParam>(20000,
                                   [&](int i) {
                                     Pair<TypeParam> pair = i % 2 == 0 ? grid_pair<TypeParam>(random, 4)
                                                                       : coplanar_pair<TypeParam>(random, 4);
                                     if (i % 4 < 2)
                                       for (auto& triangle : pair)
                                         for (auto& p : triangle)
                                           for (auto& x : p) x = (x + TypeParam(1)) / TypeParam(3);
                                     perturb(random, pair);
                                     return pair;
                                   }),
               500);
}

/// All of a pair scaled by one power of two: from denormal coordinates, through the range where only products
/// underflow, to the range where they overflow in float.
TYPED_TEST(TriangleBatch, ScaledThroughTheRange) {
  using S = TypeParam;
  Random random(7);
  const int lowest = std::numeric_limits<S>::denorm_min() == S(0x1p-149) ? -149 : -1074;
  const int highest = lowest == -149 ? 96 : 325;
  const int step = lowest == -149 ? 3 : 23;
  for (int exponent = lowest; exponent <= highest; exponent += step) {
    SCOPED_TRACE("exponent " + std::to_string(exponent));
    check(repeated<S>(600, [&](int i) {
      Pair<S> pair = i % 4 == 0   ? grid_pair<S>(random, 3)
                     : i % 4 == 1 ? coplanar_pair<S>(random, 4)
                     : i % 4 == 2 ? contact_pair<S>(random)
                                  : random_pair<S>(random);
      scale(pair, exponent);
      return pair;
    }));
  }
}

TYPED_TEST(TriangleBatch, UpToTheAdmissibleMagnitude) {
  using S = TypeParam;
  Random random(8);
  check_family(repeated<S>(10000,
                           [&](int i) {
                             Pair<S> pair = i % 4 == 0   ? grid_pair<S>(random, 3)
                                            : i % 4 == 1 ? coplanar_pair<S>(random, 4)
                                            : i % 4 == 2 ? contact_pair<S>(random)
                                                         : random_pair<S>(random);
                             stretch(pair, admissible_magnitude<S>);
                             if (i % 3 == 0) perturb(random, pair);
                             // Moves away from zero again, where perturb may have crossed the limit.
                             for (auto& triangle : pair)
                               for (auto& p : triangle)
                                 for (S& x : p)
                                   x = std::clamp(x, -admissible_magnitude<S>, admissible_magnitude<S>);
                             return pair;
                           }),
               500);
}

/// Coordinates with unrelated exponents: differences round, some products underflow while others overflow.
TYPED_TEST(TriangleBatch, SizesFarApart) {
  using S = TypeParam;
  Random random(9);
  const bool single = std::numeric_limits<S>::denorm_min() == S(0x1p-149);
  const int lowest = single ? -149 : -1074, highest = single ? 97 : 329;
  for (const int gap : {10, 30, 60, 120, highest - lowest}) {
    SCOPED_TRACE("gap " + std::to_string(gap));
    check_family(repeated<S>(8000,
                             [&](int i) {
                               Pair<S> pair = i % 3 == 0   ? grid_pair<S>(random, 3)
                                              : i % 3 == 1 ? coplanar_pair<S>(random, 3)
                                                           : random_pair<S>(random);
                               for (auto& triangle : pair)
                                 for (auto& p : triangle)
                                   for (S& x : p)
                                     if (uniform(random, 0, i % 4) == 0)
                                       x = std::ldexp(
                                           x, std::clamp(uniform(random, -gap, gap), lowest, highest));
                               return pair;
                             }),
                 300);
  }
}

TYPED_TEST(TriangleBatch, FarFromTheOrigin) {
  using S = TypeParam;
  Random random(10);
  const S ulp = std::numeric_limits<S>::epsilon();
  check_family(repeated<S>(10000,
                           [&](int i) {
                             Pair<S> pair =
                                 i % 2 == 0 ? grid_pair<S>(random, 4) : coplanar_pair<S>(random, 4);
                             const Point<S> offset{1, S(uniform(random, 1, 3)), S(uniform(random, 0, 1))};
                             for (auto& triangle : pair)
                               for (auto& p : triangle)
                                 for (std::size_t axis = 0; axis < 3; ++axis)
                                   p[axis] = offset[axis] + p[axis] * S(4) * ulp;
                             return pair;
                           }),
               300);
}

/// Registers and blocks, full and not.
TYPED_TEST(TriangleBatch, AnyNumberOfPairs) {
  Random random(11);
  std::vector<Pair<TypeParam>> pairs;
  for (int size = 0; size <= 600; ++size) {
    if (size < 140 || (size > 250 && size < 262) || size > 508) check(pairs);
    pairs.push_back(size % 5 == 0 ? contact_pair<TypeParam>(random) : random_pair<TypeParam>(random));
  }
}

// ---- confirm_pairs ----------------------------------------------------------------------------------------

/// Moving bodies whose primitives have 1 to 5 vertices, some of them not polygons, close enough that many
/// meet.
template <class S>
Scene<S> mixed_scene(Random& random) {
  std::uniform_real_distribution<double> real(-1, 1);
  Scene<S> scene;
  for (const PrimitiveKind kind : {PrimitiveKind::polygons, PrimitiveKind::polygons, PrimitiveKind::points,
                                   PrimitiveKind::control_nets, PrimitiveKind::polygons}) {
    const std::uint32_t vertices = 60;
    const bool triangles_only = scene.bodies.empty();
    Body<S> body;
    body.primitives.kind = kind;
    for (int p = 0; p < 40; ++p) {
      const int size = kind == PrimitiveKind::points ? 1
                       : triangles_only || p % 3 > 0 ? 3
                                                     : uniform(random, 1, 5);
      std::vector<std::uint32_t> primitive;
      for (int i = 0; i < size; ++i)
        primitive.push_back(std::uint32_t(uniform(random, 0, int(vertices) - 1)));
      body.primitives.add(primitive);
    }
    std::vector<S> positions;
    for (std::uint32_t i = 0; i < 2 * 3 * vertices; ++i) positions.push_back(S(real(random)));
    body.plans = FlightPlans<S>(vertices, {0.0, 1.0}, positions);
    scene.bodies.push_back(std::move(body));
  }
  scene.pairs = all_pairs(scene.bodies);
  cut_polygons(scene);
  return scene;
}

/// The pairs of `candidates` that meet, one by one.
template <class S>
PairBuffer meeting(const Scene<S>& scene, const Playback<S>& playback, const PairBuffer& candidates,
                   TriangleTestStats& stats) {
  PairBuffer result;
  for (const PrimitivePair& pair : candidates) {
    const Primitives &in_a = scene.bodies[pair.body_a].primitives,
                     &in_b = scene.bodies[pair.body_b].primitives;
    const auto a = in_a[pair.primitive_a], b = in_b[pair.primitive_b];
    const S *x = playback.positions(pair.body_a), *y = playback.positions(pair.body_b);
    const bool polygons = in_a.kind == PrimitiveKind::polygons && in_b.kind == PrimitiveKind::polygons;
    const bool meet = polygons ? polygons_intersect<S>(
                                     in_a.triangles(pair.primitive_a),
                                     [x](std::uint32_t v) { return x + std::size_t(3) * v; },
                                     in_b.triangles(pair.primitive_b),
                                     [y](std::uint32_t v) { return y + std::size_t(3) * v; }, stats)
                               : overlap(primitive_box(a, x), primitive_box(b, y));
    if (meet) result.push_back(pair);
  }
  return result;
}

TYPED_TEST(TriangleBatch, ConfirmPairsKeepsWhatMeetsInOrder) {
  using S = TypeParam;
  Random random(12);
  const Scene<S> scene = mixed_scene<S>(random);
  Playback<S> current(scene);
  current.seek(0.3);
  current.evaluate_all();
  const KernelSet before = active_kernel_set();
  PairBuffer all;
  for (const BodyPair& bodies : scene.pairs)
    for (std::uint32_t i = 0; i < 40; ++i)
      for (std::uint32_t j = 0; j < 40; ++j) all.push_back({bodies.first, i, bodies.second, j});
  for (const std::size_t size : {0, 1, 2, 3, 127, 128, 129, 1000, int(all.size())}) {
    // Grouped by bodies, as strategies report them, and in no order.
    for (const bool shuffled : {false, true}) {
      if (shuffled) std::shuffle(all.begin(), all.end(), random);
      const PairBuffer candidates(all.begin(), all.begin() + std::ptrdiff_t(size));
      TriangleTestStats expected_stats;
      const PairBuffer expected = meeting(scene, current, candidates, expected_stats);
      for (const KernelSet set : supported_kernel_sets()) {
        use_kernel_set(set);
        // Nothing is evaluated yet: positions are fetched as they are needed.
        Playback<S> lazy(scene);
        lazy.seek(0.3);
        PairBuffer pairs = candidates;
        TriangleTestStats stats;
        confirm_pairs(SceneView<S>(scene), SampledMotion<S>(lazy), pairs, stats);
        EXPECT_EQ(pairs, expected) << name(set) << ", " << size << " candidates";
        expect_equal(stats, expected_stats, name(set));
      }
    }
    std::sort(all.begin(), all.end());
  }
  use_kernel_set(before);
}

}  // namespace
}  // namespace kbvh
