// Builders of 8-wide trees: for any primitives, each of them lies in exactly one leaf, boxes are as small as
// possible, and all instruction sets build the same tree.

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <set>

#include "core/families/build/cluster_builders.hpp"
#include "core/families/build/curve_builders.hpp"
#include "tests/support/builder_inputs.hpp"
#include "tests/support/synthetic_scenes.hpp"

namespace kbvh::test::build_test {
namespace {

template <class S>
using Input = BuilderInput<S>;

template <class S>
Input<S> soup(const char* name, std::uint32_t count, double x, double y, double z) {
  return random_triangles<S>(name, count, x, y, z, 7);
}

template <class S>
std::vector<Input<S>> inputs() {
  std::vector<Input<S>> all;
  all.push_back({"nothing", {}, {}});
  all.push_back(soup<S>("one", 1, 1, 1, 1));
  all.push_back(soup<S>("two", 2, 1, 1, 1));
  for (const std::uint32_t count : {16U, 17U, 129U, 1000U}) all.push_back(soup<S>("soup", count, 1, 2, 3));
  all.push_back(soup<S>("plane", 500, 1, 0, 2));
  all.push_back(soup<S>("line", 300, 0, 0, 1));
  Input<S> equal{"equal", {}, {}};
  for (int i = 0; i < 300; ++i) equal.add({{1, 2, 3}, {2, 2, 3}, {1, 3, 3}});
  all.push_back(std::move(equal));
  Input<S> point{"one point", {}, {}};
  for (int i = 0; i < 100; ++i) point.add({{0, 0, 0}});
  all.push_back(std::move(point));
  // All but two primitives lie in one cell of the grid, and most of these in one cell of the next.
  Input<S> far{"far away", {}, {}};
  Random random(3);
  for (int i = 0; i < 400; ++i) {
    const double size = i % 3 == 0 ? 1e-2 : 1e-5;
    far.add({{size * random.unit(), size * random.unit(), size * random.unit()}, {0, size, 0}});
  }
  far.add({{1e6, 0, 0}});
  far.add({{0, -1e6, 1e6}});
  all.push_back(std::move(far));
  Input<S> large{"large numbers", {}, {}};
  for (int i = 0; i < 200; ++i)
    large.add({{1e30 * random.unit(), -1e30 * random.unit(), 0}, {1e30 * random.unit(), 1e30, 1}});
  all.push_back(std::move(large));
  Input<S> mixed = soup<S>("removed", 200, 1, 1, 1);
  mixed.add({{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}});
  for (std::uint32_t p = 0; p < 200; p += 3) mixed.primitives.remove(p);
  all.push_back(std::move(mixed));
  Input<S> none = soup<S>("none alive", 5, 1, 1, 1);
  for (std::uint32_t p = 0; p < 5; ++p) none.primitives.remove(p);
  all.push_back(std::move(none));
  for (Input<S>& input : all) input.positions.push_back(0);
  return all;
}

template <class S>
Box<double> box_of(const Input<S>& input, std::uint32_t primitive) {
  Box<S> box;
  for (const std::uint32_t v : input.primitives[primitive]) box.extend(input.positions.data() + 3 * v);
  return to_double(box);
}

/// Returns the first violation, or an empty text.
template <class S>
std::string check_tree(BuiltTree<S>& tree, const Input<S>& input) {
  std::vector<Box<double>> boxes;
  const Topology topology = tree.topology(boxes);
  if (const std::string wrong = check_topology(topology, input.primitives); !wrong.empty()) return wrong;
  if (boxes.size() != topology.size()) return "not a box for each node";
  for (std::uint32_t n = topology.size(); n-- > 0;) {
    const TopologyNode node = topology.nodes[n];
    Box<double> expected;
    for (std::uint32_t i = node.first(); i < node.first() + node.count(); ++i)
      expected.extend(node.is_leaf() ? box_of(input, topology.primitives[i]) : boxes[i]);
    if (!(boxes[n] == expected)) return "the box of node " + std::to_string(n);
  }
  const std::uint32_t padded = tree.padded_leaf_size();
  const WideLeaves<S> leaves = tree.leaves(nullptr);
  for (std::uint32_t leaf = 0; leaf < tree.leaf_count() && padded > 1; ++leaf) {
    if (leaves.stamps[leaf] != leaves.stamp) return "leaf " + std::to_string(leaf) + " is not current";
    const auto entries = tree.leaf_primitives(leaf);
    for (std::uint32_t lane = 0; lane < padded; ++lane)
      for (std::uint32_t row = 0; row < 6; ++row) {
        const S value = leaves.rows[(leaf * 6 + row) * padded + lane];
        double expected = std::numeric_limits<double>::infinity();
        if (lane < entries.size()) {
          const Box<double> box = box_of(input, entries[lane]);
          expected = row < 3 ? box.lower[row] : -box.upper[row - 3];
        }
        if (double(value) != expected)
          return "row " + std::to_string(row) + " of leaf " + std::to_string(leaf);
      }
  }
  return {};
}

/// Calls work(name, builder) for a builder of each kind.
template <class S, class Work>
void for_builders(Work&& work) {
  work("linear", LinearBuilder<S>());
  work("Hilbert", ImplicitBuilder<S>(Curve::hilbert));
  work("Morton", ImplicitBuilder<S>(Curve::morton));
  for (const std::uint32_t grain : {1U, 3U, 16U}) {
    work("clusters, 8", LocalClusterBuilder<S>(8, grain));
    work("clusters, 16", LocalClusterBuilder<S>(16, grain));
    work("binned", BinnedBuilder<S>(grain));
  }
}

template <class S>
class BuildTest : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(BuildTest, Scalars);

TYPED_TEST(BuildTest, EveryPrimitiveLiesInOneLeafAndBoxesAreTight) {
  const auto all = inputs<TypeParam>();
  for_builders<TypeParam>([&](const char* kind, auto builder) {
    CurveOrder<TypeParam> order;
    BuiltTree<TypeParam> tree;
    for (const std::uint32_t leaf_size : {1U, 3U, 8U, 16U})
      for (const auto& input : all) {
        tree.start(leaf_size, active_kernel_set());
        const PrimitiveList list(input.primitives);
        order.take(input.primitives, list, input.positions.data(), tree.kernels());
        builder.build(tree, order, list);
        EXPECT_EQ(check_tree(tree, input), "")
            << kind << ", " << input.name << ", " << list.count << ", leaf size " << leaf_size;
      }
  });
}

TYPED_TEST(BuildTest, AllInstructionSetsBuildTheSame) {
  for (const auto& input : inputs<TypeParam>())
    for_builders<TypeParam>([&](const char* kind, auto builder) {
      const PrimitiveList list(input.primitives);
      std::vector<Box<double>> expected_boxes;
      Topology expected;
      for (const KernelSet set : supported_kernel_sets()) {
        CurveOrder<TypeParam> order;
        BuiltTree<TypeParam> tree;
        tree.start(4, set);
        order.take(input.primitives, list, input.positions.data(), set);
        builder.build(tree, order, list);
        std::vector<Box<double>> boxes;
        const Topology topology = tree.topology(boxes);
        if (set == supported_kernel_sets().front()) {
          expected = topology;
          expected_boxes = boxes;
        }
        EXPECT_TRUE(topology == expected && boxes == expected_boxes)
            << kind << ", " << input.name << ", " << name(set);
      }
    });
}

TYPED_TEST(BuildTest, KeysAreSortedAndRunsRefined) {
  for (const auto& input : inputs<TypeParam>()) {
    const PrimitiveList list(input.primitives);
    CurveOrder<TypeParam> order;
    order.take(input.primitives, list, input.positions.data(), active_kernel_set());
    order.sort(list, Curve::hilbert);
    const auto keys = order.keys();
    EXPECT_TRUE(std::is_sorted(keys.begin(), keys.end())) << input.name;
    order.refine_runs(4);
    std::set<std::uint32_t> seen;
    for (const std::uint64_t key : order.keys()) seen.insert(CurveOrder<TypeParam>::primitive(key));
    EXPECT_EQ(seen.size(), list.count) << input.name;
    for (std::uint32_t k = 0; k + 4 < list.count; ++k) {
      // Five keys of one code: five equal boxes.
      if (CurveOrder<TypeParam>::code(keys[k]) != CurveOrder<TypeParam>::code(keys[k + 4])) continue;
      const auto centre = [&](std::uint64_t key, int axis) {
        const TypeParam* const box = order.boxes() + std::size_t(8) * CurveOrder<TypeParam>::primitive(key);
        return box[axis] + box[axis + 4];
      };
      for (int axis = 0; axis < 3; ++axis)
        EXPECT_NEAR(double(centre(keys[k], axis)), double(centre(keys[k + 4], axis)), 1e-4) << input.name;
    }
  }
}

// A full tree of 8 * 8 * 16 primitives is perfect; any other has leaves of nearly equal size.
TYPED_TEST(BuildTest, ImplicitTreesAreFull) {
  for (const std::uint32_t count : {1024U, 1000U, 145U}) {
    const auto input = soup<TypeParam>("soup", count, 1, 1, 1);
    const PrimitiveList list(input.primitives);
    CurveOrder<TypeParam> order;
    BuiltTree<TypeParam> tree;
    tree.start(16, active_kernel_set());
    order.take(input.primitives, list, input.positions.data(), tree.kernels());
    ImplicitBuilder<TypeParam>(Curve::hilbert).build(tree, order, list);
    EXPECT_EQ(tree.leaf_count(), (count + 15) / 16);
    std::vector<Box<double>> boxes;
    EXPECT_EQ(tree.topology(boxes).perfect, count == 1024) << count;
    for (std::uint32_t leaf = 0; leaf < tree.leaf_count(); ++leaf)
      EXPECT_GE(tree.leaf_primitives(leaf).size(), count / tree.leaf_count());
  }
}

// Neighbours on the Hilbert curve are neighbours in space; on the Morton curve they need not be.
TYPED_TEST(BuildTest, HilbertCurveGoesFromCellToNeighbour) {
  Input<TypeParam> input{"grid", {}, {}};
  for (int x = 0; x < 8; ++x)
    for (int y = 0; y < 8; ++y)
      for (int z = 0; z < 8; ++z) input.add({{double(x), double(y), double(z)}});
  input.positions.push_back(0);
  const PrimitiveList list(input.primitives);
  CurveOrder<TypeParam> order;
  order.take(input.primitives, list, input.positions.data(), active_kernel_set());
  for (const Curve curve : {Curve::hilbert, Curve::morton}) {
    order.sort(list, curve);
    int jumps = 0;
    for (std::size_t k = 1; k < order.keys().size(); ++k) {
      const int a = int(CurveOrder<TypeParam>::primitive(order.keys()[k - 1]));
      const int b = int(CurveOrder<TypeParam>::primitive(order.keys()[k]));
      const int steps = std::abs(a / 64 - b / 64) + std::abs(a / 8 % 8 - b / 8 % 8) + std::abs(a % 8 - b % 8);
      jumps += steps == 1 ? 0 : 1;
    }
    EXPECT_EQ(jumps == 0, curve == Curve::hilbert) << jumps;
  }
}

TEST(RadixSort, SortsStably) {
  Random random(5);
  RadixSort radix;
  for (const std::uint32_t count : {0U, 1U, 2U, 100U, 5000U})
    for (const std::uint32_t codes : {1U, 3U, 1U << 12, 1U << 30}) {
      std::vector<std::uint64_t> keys(count);
      for (std::uint32_t i = 0; i < count; ++i)
        keys[i] = std::uint64_t(random.below(codes)) << 32 | (count - i);
      std::vector<std::uint64_t> expected = keys;
      std::stable_sort(expected.begin(), expected.end(),
                       [](std::uint64_t a, std::uint64_t b) { return a >> 32 < b >> 32; });
      std::uint32_t* const counts = radix.counts();
      for (const std::uint64_t key : keys)
        for (std::uint32_t d = 0; d < RadixSort::digits; ++d)
          ++counts[d * RadixSort::bins + (key >> (32 + d * RadixSort::digit_bits) & (RadixSort::bins - 1))];
      radix.sort(keys);
      EXPECT_EQ(keys, expected) << count << " keys, " << codes << " codes";
    }
}

TEST(BuiltTree, RefusesLeafSizesThatItDoesNotHave) {
  BuiltTree<float> tree;
  EXPECT_THROW(tree.start(0, active_kernel_set()), std::invalid_argument);
  EXPECT_THROW(tree.start(17, active_kernel_set()), std::invalid_argument);
}

}  // namespace
}  // namespace kbvh::test::build_test
