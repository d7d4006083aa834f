// The hash grid against comparing all boxes with all, with every set of kernels, for boxes of similar sizes,
// of very different sizes, flat, equal, far away, and as far apart as numbers allow.

#include <gtest/gtest.h>

#include <algorithm>

#include "core/families/grid/hash_grid.hpp"
#include "tests/support/synthetic_scenes.hpp"

namespace kbvh::test::hash_grid_test {
namespace {

using Pairs = std::vector<std::pair<std::uint32_t, std::uint32_t>>;

/// `count` segments; the first and then every `removed_every`-th one is removed; 0: none.
Primitives segments(std::uint32_t count, std::uint32_t removed_every) {
  Primitives primitives;
  for (std::uint32_t i = 0; i < count; ++i) primitives.add(std::vector<std::uint32_t>{2 * i, 2 * i + 1});
  for (std::uint32_t i = 0; removed_every != 0 && i < count; i += removed_every) primitives.remove(i);
  return primitives;
}

/// A body of segments, each the diagonal of a box.
template <class S>
struct Segments {
  Segments(std::uint32_t count, std::uint32_t removed_every)
      : primitives(segments(count, removed_every)), list(primitives), positions(6 * count + 1) {}
  void update(KernelSet set) { body.update(primitives, list, positions.data(), set); }
  Box<S> box(std::uint32_t p) const {
    Box<S> box;
    if (primitives.alive(p))
      for (const std::uint32_t v : primitives[p]) box.extend(positions.data() + 3 * v);
    return box;
  }
  Primitives primitives;
  PrimitiveList list;
  std::vector<S> positions;
  GridBody<S> body;
};

/// The shapes of the boxes.
enum class Shape : std::uint8_t { like, sizes, flat, line, equal, points, far_away, extreme, whole };

template <class S>
void place(Segments<S>& body, Shape shape, Random& random) {
  const auto unit = [&] { return S(random.below(1U << 20)) / S(1U << 20); };
  const S huge = std::numeric_limits<S>::max() / 2;
  for (std::uint32_t p = 0; p < body.primitives.count(); ++p) {
    S* const lower = body.positions.data() + std::size_t(6) * p;
    S size = S(0.1);
    if (shape == Shape::sizes) size = p % 50 == 0 ? S(8) : p % 7 == 0 ? S(0.8) : S(0.02);
    if (shape == Shape::points) size = 0;
    for (int axis = 0; axis < 3; ++axis) {
      S& from = lower[axis];
      S& to = lower[axis + 3];
      from = unit();
      to = from + size * unit();
      if (shape == Shape::flat && axis == 2) from = to = S(0.5);
      if (shape == Shape::line && axis != 1) from = to = S(p % 3);
      if (shape == Shape::equal) from = S(0.25), to = S(0.75);
      if (shape == Shape::points) from = to = S(random.below(4));
      if (shape == Shape::far_away && p % 20 == 0) from *= S(1e30), to = from + S(1e29) * unit();
      if (shape == Shape::far_away && p % 20 == 1) from = S(1e30), to = from;
      if (shape == Shape::extreme && p % 3 == 0) from = unit() < S(0.5) ? -huge * 2 : huge * unit();
      if (shape == Shape::extreme && p % 9 == 0) to = huge * 2;
      if (shape == Shape::whole) from = S(random.below(12)), to = S(random.below(12));
    }
  }
}

template <class S>
Pairs expected_pairs(const Segments<S>& a, const Segments<S>& b) {
  Pairs pairs;
  for (std::uint32_t p = 0; p < a.primitives.count(); ++p)
    for (std::uint32_t q = &a == &b ? p + 1 : 0; q < b.primitives.count(); ++q)
      if (overlap(a.box(p), b.box(q))) pairs.emplace_back(p, q);
  return pairs;
}

template <class S>
Pairs found_pairs(HashGrid<S>& grid, const Segments<S>& a, const Segments<S>& b, std::uint64_t& tests) {
  Pairs pairs;
  grid.search(a.body, a.list, b.body, b.list, tests, [&](std::uint32_t p, std::uint32_t q) {
    if (&a == &b && p > q) std::swap(p, q);
    pairs.emplace_back(p, q);
  });
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

template <class S>
class HashGridTest : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(HashGridTest, Scalars);

TYPED_TEST(HashGridTest, FindsEachPairOnce) {
  using S = TypeParam;
  for (const KernelSet set : supported_kernel_sets())
    for (const double cell : {0.25, 2.0, 30.0}) {
      HashGrid<S> grid(cell, set);  // one for all: nothing remains of the previous search
      for (const std::uint32_t count : {1U, 17U, 400U})
        for (int shape = 0; shape <= int(Shape::whole); ++shape) {
          Random random(count + std::uint32_t(shape));
          Segments<S> a(count, 0), b(count + 150, 7);
          for (Segments<S>* body : {&a, &b}) {
            place(*body, Shape(shape), random);
            body->update(set);
          }
          SCOPED_TRACE(testing::Message()
                       << name(set) << ", shape " << shape << ", " << count << ", " << cell);
          std::uint64_t tests = 0;
          EXPECT_EQ(found_pairs(grid, a, b, tests), expected_pairs(a, b));
          EXPECT_EQ(found_pairs(grid, b, a, tests), expected_pairs(b, a));
          EXPECT_EQ(found_pairs(grid, a, a, tests), expected_pairs(a, a));
          EXPECT_EQ(found_pairs(grid, b, b, tests), expected_pairs(b, b));
        }
    }
}

/// One box as large as the scene neither enlarges the cells of thousands of small ones nor is entered into
/// all of theirs.
TYPED_TEST(HashGridTest, OneHugeBoxCostsLittle) {
  using S = TypeParam;
  Random random(5);
  Segments<S> small(3000, 0), with_huge(3001, 0);
  for (std::uint32_t p = 0; p < 3001; ++p)
    for (int axis = 0; axis < 3; ++axis)
      for (Segments<S>* body : {&small, &with_huge}) {
        if (p >= body->primitives.count()) continue;
        S* const lower = body->positions.data() + std::size_t(6) * p + axis;
        lower[0] = p == 3000 ? S(0) : S(random.below(1000));
        lower[3] = p == 3000 ? S(1000) : lower[0] + S(20);
      }
  small.update(active_kernel_set());
  with_huge.update(active_kernel_set());
  HashGrid<S> grid(2, active_kernel_set());
  std::uint64_t tests = 0;
  EXPECT_EQ(found_pairs(grid, small, with_huge, tests), expected_pairs(small, with_huge));
  EXPECT_LT(tests, 40u * 3000);
  EXPECT_LT(grid.bytes(), 1000u * 3000);
}

TYPED_TEST(HashGridTest, NothingHasNoBox) {
  Segments<TypeParam> none(0, 0), one(1, 0);
  none.update(active_kernel_set());
  one.update(active_kernel_set());
  EXPECT_TRUE(none.body.box().empty());
  HashGrid<TypeParam> grid(2, active_kernel_set());
  std::uint64_t tests = 0;
  EXPECT_TRUE(found_pairs(grid, none, one, tests).empty());
  EXPECT_TRUE(found_pairs(grid, none, none, tests).empty());
}

}  // namespace
}  // namespace kbvh::test::hash_grid_test
