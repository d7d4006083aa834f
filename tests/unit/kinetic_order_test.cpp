// Kinetic sorted lists and the set of overlapping boxes against comparing all boxes with all, on whole
// numbers, so that many ends are equal at the start, meet at one time, or stay together.

#include <gtest/gtest.h>

#include "core/families/sweep/kinetic_overlaps.hpp"
#include "tests/support/synthetic_scenes.hpp"

namespace kbvh::test::kinetic_order_test {
namespace {

template <class S>
class KineticOrderTest : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(KineticOrderTest, Scalars);

/// Twice the values at a quarter of the segment, and so on: whole numbers, compared exactly.
template <class S>
std::int64_t at_quarter(const MovingEnd<S>& line, int quarter) {
  return (4 - quarter) * std::int64_t(line.begin) + quarter * std::int64_t(line.end);
}

template <class S>
struct World {
  std::uint32_t boxes;
  KineticOverlaps<S> overlaps;
  std::vector<std::uint32_t> body_of;
  std::vector<BodyPair> pairs;

  explicit World(std::uint32_t count) : boxes(count) {
    for (std::uint32_t box = 0; box < count; ++box) body_of.push_back(3 * box / count);
    pairs = {{0, 1}, {1, 1}, {0, 2}};  // not: 0 with 0, 1 with 2, 2 with 2
    overlaps.assign(body_of, 3, pairs);
  }
  void move(Random& random) {
    for (std::size_t axis = 0; axis < 3; ++axis)
      for (std::uint32_t box = 0; box < boxes; ++box) {
        MovingEnd<S>&lower = overlaps.order(axis).line(2 * box),
        &upper = overlaps.order(axis).line(2 * box + 1);
        const S length[2] = {S(1 + random.below(6)), S(1 + random.below(6))};
        lower = {lower.end, random.below(2) == 0 ? S(random.below(30)) : lower.end};
        upper = {upper.end > lower.begin ? upper.end : lower.begin + length[0], lower.end + length[1]};
      }
  }
  bool counts(std::uint32_t a, std::uint32_t b) const {
    return std::any_of(pairs.begin(), pairs.end(), [&](const BodyPair& pair) {
      return pair.first == body_of[a] && pair.second == body_of[b];
    });
  }
  /// Overlapping pairs must be in the set, pairs that are apart must not, and touching pairs may be.
  void expect_right(int quarter) const {
    for (std::uint32_t a = 0; a < boxes; ++a)
      for (std::uint32_t b = a + 1; b < boxes; ++b) {
        bool overlap = counts(a, b), apart = !counts(a, b);
        for (std::size_t axis = 0; axis < 3; ++axis) {
          auto& order = const_cast<KineticOrder<S>&>(overlaps.order(axis));
          const std::int64_t one = at_quarter(order.line(2 * a + 1), quarter) -
                                   at_quarter(order.line(2 * b), quarter),
                             two = at_quarter(order.line(2 * b + 1), quarter) -
                                   at_quarter(order.line(2 * a), quarter);
          overlap = overlap && one > 0 && two > 0;
          apart = apart || one < 0 || two < 0;
        }
        const bool found = overlaps.set().contains({a, b});
        if (overlap) {
          EXPECT_TRUE(found) << a << ", " << b << " at " << quarter;
        }
        if (apart) {
          EXPECT_FALSE(found) << a << ", " << b << " at " << quarter;
        }
      }
  }
  void expect_sorted(int quarter) const {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      auto& order = const_cast<KineticOrder<S>&>(overlaps.order(axis));
      for (std::size_t i = 0; i + 1 < order.list().size(); ++i) {
        EXPECT_EQ(order.rank(order.list()[i]), i);
        EXPECT_LE(at_quarter(order.line(order.list()[i]), quarter),
                  at_quarter(order.line(order.list()[i + 1]), quarter));
      }
    }
  }
};

TYPED_TEST(KineticOrderTest, ListsAndSetAreThoseOfAnyTime) {
  for (const KeptBy kept : {KeptBy::events, KeptBy::sorting})
    for (const std::uint32_t count : {1U, 2U, 30U, 90U}) {
      Random random(count);
      World<TypeParam> world(count);
      std::vector<std::uint32_t> all(count);
      std::iota(all.begin(), all.end(), 0U);
      for (int segment = 0; segment < 6; ++segment) {
        world.move(random);
        if (segment == 0 || segment == 3 || !world.overlaps.renew()) world.overlaps.start(all);
        world.overlaps.start_segment(4.0 * segment, 4.0 * segment + 4, kept);
        for (int quarter = segment % 2; quarter <= 4; quarter += 1 + segment % 2) {
          world.overlaps.advance(4.0 * segment + quarter);
          world.expect_sorted(quarter);
          world.expect_right(quarter);
        }
        // Lists continue at the end of a segment.
        world.overlaps.advance(4.0 * segment + 4);
      }
    }
}

TEST(BoxPairSet, HoldsWhatWasInsertedAndNotErased) {
  Random random(5);
  BoxPairSet set;
  std::vector<std::uint8_t> expected(40 * 40, 0);
  for (int step = 0; step < 20000; ++step) {
    const auto a = std::uint32_t(random.below(40)), b = std::uint32_t(random.below(40));
    std::uint8_t& is_in = expected[40 * a + b];
    EXPECT_EQ(set.contains({a, b}), is_in != 0);
    const bool inserts = random.below(step < 10000 ? 3 : 7) < 2;
    if (inserts) {
      EXPECT_EQ(set.insert({a, b}), is_in == 0);
    } else {
      EXPECT_EQ(set.erase({a, b}), is_in != 0);
    }
    is_in = inserts;
  }
  std::size_t count = 0;
  for (const std::uint8_t is_in : expected) count += is_in;
  EXPECT_EQ(set.pairs().size(), count);
  for (const auto& pair : set.pairs()) EXPECT_EQ(expected[40 * pair.a + pair.b], 1);
  set.clear();
  EXPECT_FALSE(set.contains({1, 2}));
}

}  // namespace
}  // namespace kbvh::test::kinetic_order_test
