// The sweep on one axis against comparing all boxes with all, with every set of kernels, while boxes move.

#include <gtest/gtest.h>

#include <algorithm>

#include "core/families/sweep/sorted_boxes.hpp"
#include "tests/support/synthetic_scenes.hpp"

namespace kbvh::test::sweep_test {
namespace {

/// `count` segments; the first and then every `removed_every`-th one is removed; 0: none.
Primitives segments(std::uint32_t count, std::uint32_t removed_every) {
  Primitives primitives;
  for (std::uint32_t i = 0; i < count; ++i) primitives.add(std::vector<std::uint32_t>{2 * i, 2 * i + 1});
  for (std::uint32_t i = 0; removed_every != 0 && i < count; i += removed_every) primitives.remove(i);
  return primitives;
}

template <class S>
using Boxes = std::vector<Box<S>>;  ///< empty for removed primitives

template <class S>
std::vector<std::pair<std::uint32_t, std::uint32_t>> swept(const SortedBoxes<S>& a, const SortedBoxes<S>& b,
                                                           std::uint32_t axis, KernelSet set, bool within) {
  std::vector<std::pair<std::uint32_t, std::uint32_t>> pairs;
  std::vector<FoundPair> found(sweep_block);  // the minimum: it pauses all the time
  SweepJob<S> job{a.side(0), b.side(1), axis, 0, 0, SweepJob<S>::no_block, found.data(), 0, found.size(), 0};
  while (job.next < job.a.count) {
    within ? sweep_kernels<S>(set).one(job) : sweep_kernels<S>(set).two(job);
    for (std::size_t i = 0; i < job.found; ++i) {
      std::uint32_t p = found[i].primitive_a, q = found[i].primitive_b;
      if (within && p > q) std::swap(p, q);
      pairs.emplace_back(p, q);
    }
    job.found = 0;
  }
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

template <class S>
class SweepTest : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(SweepTest, Scalars);

TYPED_TEST(SweepTest, FindsEachPairOnce) {
  using S = TypeParam;
  for (const KernelSet set : supported_kernel_sets())
    for (const std::uint32_t count : {1U, 16U, 17U, 150U}) {
      Random random(count);
      const Primitives primitives[2] = {segments(count, 0), segments(count + 5, 7)};
      const PrimitiveList lists[2] = {PrimitiveList(primitives[0]), PrimitiveList(primitives[1])};
      SortedBoxes<S> sorted[2];
      for (int body = 0; body < 2; ++body) sorted[body].start(lists[body], set);
      CurveOrder<S> order;
      std::vector<S> positions[2];
      for (int body = 0; body < 2; ++body) positions[body].resize(6 * primitives[body].count() + 1);
      for (int round = 0; round < 5; ++round) {
        const std::uint32_t axis = std::uint32_t(round) % 3;
        Boxes<S> boxes[2];
        for (int body = 0; body < 2; ++body) {
          // Whole numbers: many boxes touch in a face. From an odd round to the next one little moves.
          for (S& x : positions[body])
            if (round % 2 == 0 || random.below(20) == 0) x = S(random.below(12));
          order.take(primitives[body], lists[body], positions[body].data(), set);
          sorted[body].update(order.boxes(), axis);
          for (std::uint32_t p = 0; p < primitives[body].count(); ++p) {
            Box<S>& box = boxes[body].emplace_back();
            if (primitives[body].alive(p))
              for (const std::uint32_t v : primitives[body][p]) box.extend(positions[body].data() + 3 * v);
          }
        }
        std::vector<std::pair<std::uint32_t, std::uint32_t>> expected, own;
        for (std::uint32_t p = 0; p < boxes[0].size(); ++p)
          for (std::uint32_t q = 0; q < boxes[1].size(); ++q)
            if (overlap(boxes[0][p], boxes[1][q])) expected.emplace_back(p, q);
        for (std::uint32_t p = 0; p < boxes[1].size(); ++p)
          for (std::uint32_t q = p + 1; q < boxes[1].size(); ++q)
            if (overlap(boxes[1][p], boxes[1][q])) own.emplace_back(p, q);
        EXPECT_EQ(swept(sorted[0], sorted[1], axis, set, false), expected) << name(set) << ", " << count;
        EXPECT_EQ(swept(sorted[1], sorted[1], axis, set, true), own) << name(set) << ", " << count;
      }
    }
}

TYPED_TEST(SweepTest, NothingHasNoBox) {
  SortedBoxes<TypeParam> none;
  none.start(PrimitiveList(segments(0, 0)), active_kernel_set());
  EXPECT_TRUE(none.empty());
  EXPECT_TRUE(none.box().empty());
}

}  // namespace
}  // namespace kbvh::test::sweep_test
