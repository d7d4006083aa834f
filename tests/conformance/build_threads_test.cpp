// Builders make the same trees on any number of threads: nodes, entries, boxes and rows are those of one
// thread, bit by bit. threads_test.cpp allows as many threads as this test asks for, and looks for data
// races.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <string>
#include <vector>

#include "core/base/hasher.hpp"
#include "core/families/build/cluster_builders.hpp"
#include "core/families/build/curve_builders.hpp"
#include "core/families/build/radix_sort.hpp"
#include "core/parallel/workers.hpp"
#include "tests/support/builder_inputs.hpp"

namespace kbvh::test::build_threads {
namespace {

template <class S>
using Input = BuilderInput<S>;

template <class S>
Input<S> soup(const char* name, std::uint32_t count, double x, double y, double z) {
  return random_triangles<S>(name, count, x, y, z, count);
}

/// Sizes around the limits of the parts that threads take: 4,096 primitives, 8,192 keys, and 16,384 items to
/// be sorted into bins by one thread; and orders with many equal keys.
template <class S>
std::vector<Input<S>> inputs() {
  std::vector<Input<S>> all;
  all.push_back({"nothing", {}, {}});
  for (const std::uint32_t count : {1U, 2U, 17U, 129U, 4095U, 4096U, 4097U, 8193U, 20000U})
    all.push_back(soup<S>("soup", count, 1, 2, 3));
  all.push_back(soup<S>("line", 6000, 0, 0, 1));
  Input<S> equal{"equal", {}, {}};
  for (int i = 0; i < 5000; ++i) equal.add({{1, 2, 3}, {2, 2, 3}, {1, 3, 3}});
  all.push_back(std::move(equal));
  Random random(3);
  Input<S> places{"few places", {}, {}};
  for (int i = 0; i < 9000; ++i) {
    const double x = random.below(5), y = random.below(4), z = random.below(2);
    places.add({{x, y, z}, {x + 0.25, y, z}, {x, y + 0.25, z}});
  }
  all.push_back(std::move(places));
  // All but two primitives lie in one cell of the grid, and most of these in one cell of the next.
  Input<S> far{"far away", {}, {}};
  for (int i = 0; i < 9000; ++i) {
    const double size = i % 3 == 0 ? 1e-2 : 1e-5;
    far.add({{size * random.unit(), size * random.unit(), size * random.unit()}, {0, size, 0}});
  }
  far.add({{1e6, 0, 0}});
  far.add({{0, -1e6, 1e6}});
  all.push_back(std::move(far));
  Input<S> mixed = soup<S>("removed", 9000, 1, 1, 1);
  mixed.add({{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}});
  for (std::uint32_t p = 0; p < 9000; p += 3) mixed.primitives.remove(p);
  all.push_back(std::move(mixed));
  Input<S> none = soup<S>("none alive", 5, 1, 1, 1);
  for (std::uint32_t p = 0; p < 5; ++p) none.primitives.remove(p);
  all.push_back(std::move(none));
  for (Input<S>& input : all) input.positions.push_back(0);
  return all;
}

/// Hashes of a tree: nodes, boxes of children, boxes of nodes, leaves with their boxes, rows of leaves.
using TreeHash = std::array<std::uint64_t, 5>;

template <class S>
TreeHash hash_of(BuiltTree<S>& tree) {
  Hasher nodes, children, own, leaves, rows;
  const WideArrays<S> arrays = tree.arrays();
  const WideLeaves<S> current = tree.leaves(nullptr);
  const auto add_box = [](Hasher& hasher, const S* box) {
    hasher.bytes(box, 3 * sizeof(S));
    hasher.bytes(box + 4, 3 * sizeof(S));
  };
  nodes.bytes(arrays.nodes, tree.node_count() * sizeof(WideNode));
  children.bytes(arrays.child_bounds, tree.node_count() * lane_scalars(8) * sizeof(S));
  for (std::uint32_t n = 0; n < tree.node_count(); ++n) add_box(own, arrays.node_bounds + std::size_t(8) * n);
  for (std::uint32_t leaf = 0; leaf < tree.leaf_count(); ++leaf) {
    const auto entries = tree.leaf_primitives(leaf);
    leaves.mix(entries.size());
    leaves.bytes(entries.data(), entries.size_bytes());
    leaves.mix(current.stamps[leaf] == current.stamp ? 1U : 0U);
    add_box(leaves, tree.leaf_boxes() + std::size_t(8) * leaf);
  }
  const std::size_t padded = tree.padded_leaf_size();
  if (padded > 1) rows.bytes(current.rows, 6 * padded * tree.leaf_count() * sizeof(S));
  return {nodes.value(), children.value(), own.value(), leaves.value(), rows.value()};
}

/// Builds the trees of all inputs one after another, with one builder, on some threads; on none: as without
/// threads.
template <class S, class Builder>
std::vector<TreeHash> built(Builder builder, const std::vector<Input<S>>& all, std::uint32_t leaf_size,
                            std::uint32_t threads) {
  CurveOrder<S> order;
  BuiltTree<S> tree;
  Workers workers(std::max(1U, threads));
  tree.start(leaf_size, active_kernel_set());
  std::vector<TreeHash> hashes;
  for (const Input<S>& input : all) {
    const PrimitiveList list(input.primitives);
    if (threads == 0) {
      order.take(input.primitives, list, input.positions.data(), tree.kernels());
      builder.build(tree, order, list);
    } else {
      order.take(workers, input.primitives, list, input.positions.data(), tree.kernels());
      builder.build(workers, tree, order, list);
    }
    hashes.push_back(hash_of(tree));
  }
  return hashes;
}

template <class S, class Builder>
void expect_same_trees(const char* kind, const Builder& builder, std::uint32_t leaf_size,
                       std::initializer_list<std::uint32_t> thread_counts) {
  const auto all = inputs<S>();
  const auto expected = built<S>(builder, all, leaf_size, 0);
  for (const std::uint32_t threads : thread_counts) {
    const auto found = built<S>(builder, all, leaf_size, threads);
    for (std::size_t i = 0; i < all.size(); ++i)
      EXPECT_EQ(found[i], expected[i])
          << kind << ", " << all[i].name << ", " << all[i].primitives.live_count() << ", leaf size "
          << leaf_size << ", " << threads << " threads";
  }
}

template <class S>
class BuildThreads : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(BuildThreads, Scalars);

TYPED_TEST(BuildThreads, LinearAndImplicitTreesAreThoseOfOneThread) {
  using S = TypeParam;
  if (most_threads() < 7) GTEST_SKIP() << "built without TBB";
  for (const std::uint32_t leaf_size : {1U, 16U}) {
    expect_same_trees<S>("linear", LinearBuilder<S>(), leaf_size, {1, 2, 3, 4, 7});
    expect_same_trees<S>("Hilbert", ImplicitBuilder<S>(Curve::hilbert), leaf_size, {2, 4});
    expect_same_trees<S>("Morton", ImplicitBuilder<S>(Curve::morton), leaf_size, {2, 4});
  }
}

TYPED_TEST(BuildThreads, ClusteredTreesAreThoseOfOneThread) {
  using S = TypeParam;
  if (most_threads() < 7) GTEST_SKIP() << "built without TBB";
  expect_same_trees<S>("8 neighbours", LocalClusterBuilder<S>(8, 1), 16, {1, 2, 3, 4, 7});
  expect_same_trees<S>("8 neighbours", LocalClusterBuilder<S>(8, 1), 1, {2});
  expect_same_trees<S>("16 neighbours", LocalClusterBuilder<S>(16, 3), 16, {2, 4});
}

TYPED_TEST(BuildThreads, BinnedTreesAreThoseOfOneThread) {
  using S = TypeParam;
  if (most_threads() < 7) GTEST_SKIP() << "built without TBB";
  expect_same_trees<S>("single primitives", BinnedBuilder<S>(1), 16, {1, 2, 3, 4, 7});
  expect_same_trees<S>("single primitives", BinnedBuilder<S>(1), 1, {2});
  expect_same_trees<S>("grains of 3", BinnedBuilder<S>(3), 16, {2, 4});
}

// The comparison sees one exchange of two entries, whose boxes are equal.
TEST(Faults, OfAnOrderOfEqualKeysAreSeen) {
  Input<float> input{"equal", {}, {}};
  for (int i = 0; i < 100; ++i) input.add({{1, 2, 3}, {2, 2, 3}, {1, 3, 3}});
  input.positions.push_back(0);
  const PrimitiveList list(input.primitives);
  CurveOrder<float> order;
  BuiltTree<float> tree;
  tree.start(16, active_kernel_set());
  order.take(input.primitives, list, input.positions.data(), tree.kernels());
  LinearBuilder<float>().build(tree, order, list);
  const TreeHash before = hash_of(tree);
  std::swap(tree.entries()[40], tree.entries()[41]);
  const TreeHash after = hash_of(tree);
  EXPECT_NE(before[3], after[3]);
}

TEST(RadixSort, SortsToTheSameOrderOnSeveralThreads) {
  if (most_threads() < 7) GTEST_SKIP() << "built without TBB";
  for (const std::uint32_t threads : {1U, 2U, 3U, 4U, 7U}) {
    Workers workers(threads);
    RadixSort radix;
    Random random(threads);
    // A part has at least 4,096 keys.
    for (const std::uint32_t count : {0U, 1U, 2U, 100U, 4095U, 4096U, 4097U, 8192U, 8193U, 12289U, 60001U})
      for (const std::uint32_t codes : {1U, 3U, 1U << 12, 1U << 30}) {
        std::vector<std::uint64_t> keys(count);
        for (std::uint32_t i = 0; i < count; ++i)
          keys[i] = std::uint64_t(random.below(codes)) << 32 | (count - i);
        std::vector<std::uint64_t> expected = keys;
        std::stable_sort(expected.begin(), expected.end(),
                         [](std::uint64_t a, std::uint64_t b) { return a >> 32 < b >> 32; });
        radix.sort(workers, keys);
        EXPECT_EQ(keys, expected) << count << " keys, " << codes << " codes, " << threads << " threads";
      }
  }
}

}  // namespace
}  // namespace kbvh::test::build_threads
