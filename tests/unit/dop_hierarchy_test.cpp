// SIMD k-DOPs: they contain their points exactly, are looser than the tight ones by the margin of roundings
// and no more, and their search finds the same leaves as a comparison of all; with every set of kernels, bit
// by bit.

#include "core/families/volumes/dop_hierarchy.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "core/topology/builders.hpp"
#include "tests/support/rational_volumes.hpp"

namespace kbvh::test::dop_hierarchy_test {
namespace {

using LeafPair = std::pair<std::uint32_t, std::uint32_t>;

/// Triangles over a cloud of points, and their tree.
template <class S>
struct Cloud {
  Cloud(std::vector<S> points, BuilderConfig builder) : positions(std::move(points)) {
    const auto count = std::uint32_t(positions.size() / 3);
    for (std::uint32_t i = 0; i < count; ++i)
      primitives.add(std::vector<std::uint32_t>{i, (i + 1) % count, (i + 5) % count});
    positions.push_back(0);  // readable past the end
    topology = build_topology(primitives, positions.data(), builder);
  }
  std::vector<S> positions;
  Primitives primitives;
  Topology topology;
};

constexpr BuilderConfig builders[] = {{BuildMethod::median, 2, 1}, {BuildMethod::median, 8, 4}};

template <class S, int K>
void expect_margin(const Dop<S, K>& tight, const Dop<S, K>& dop, double reach, const std::string& where) {
  for (std::size_t slab = 0; slab < tight.slabs; ++slab) {
    const double most = slab < 3 ? 0 : 10 * double(std::numeric_limits<S>::epsilon()) * reach;
    ASSERT_LE(dop.lower[slab], tight.lower[slab]) << where << ", slab " << slab;
    ASSERT_GE(dop.upper[slab], tight.upper[slab]) << where << ", slab " << slab;
    ASSERT_LE(double(tight.lower[slab]) - double(dop.lower[slab]), most) << where;
    ASSERT_LE(double(dop.upper[slab]) - double(tight.upper[slab]), most) << where;
  }
}

template <class S, int K>
void expect_tight_but_for_roundings() {
  for_clouds<S>(31, [](const std::vector<S>& points, const std::string& where, Random&) {
    for (const BuilderConfig& builder : builders) {
      const Cloud<S> cloud(points, builder);
      double reach = 0;
      for (const S x : points) reach = std::max(reach, std::abs(double(x)));
      for (const Cover cover : {Cover::vertices, Cover::boxes}) {
        VolumeHierarchy<Dop<S, K>> covers(cloud.topology, cloud.primitives, cover);
        covers.refit(cloud.positions.data());
        std::vector<Dop<S, K>> first;
        for (const KernelSet set : supported_kernel_sets()) {
          DopHierarchy<S, K> dops(cloud.topology, cloud.primitives, cover, set);
          dops.refit(cloud.positions.data());
          for (std::uint32_t node = 0; node < cloud.topology.size(); ++node)
            expect_margin(covers.volume(node), dops.volume(node), reach, where);
          if (first.empty()) first = dops.volumes();
          ASSERT_TRUE(first == dops.volumes()) << where << ", kernels " << name(set);
        }
      }
    }
  });
}
TEST(DopHierarchy, IsTightButForRoundings) {
  expect_tight_but_for_roundings<float, 14>();
  expect_tight_but_for_roundings<float, 18>();
  expect_tight_but_for_roundings<float, 26>();
  expect_tight_but_for_roundings<double, 14>();
  expect_tight_but_for_roundings<double, 26>();
}

// Without its margin the same kernel loses points: the margin is necessary, and the test above would detect
// its absence.
TEST(DopHierarchy, NeedsItsMargin) {
  std::size_t outside = 0;
  for_clouds<float>(37, [&](const std::vector<float>& points, const std::string&, Random&) {
    constexpr std::size_t padded = padded_sides(26), half = padded / 2;
    using Exact = Dop<float, 26>;
    std::vector<float> positions = points, directions(3 * half), none(half), sides(padded);
    positions.push_back(0);
    for (std::size_t slab = 0; slab < Exact::slabs; ++slab)
      for (std::size_t axis = 0; axis < 3; ++axis)
        directions[axis * half + slab] = float(Exact::directions[slab][axis]);
    std::vector<std::uint32_t> list(points.size() / 3);
    for (std::uint32_t i = 0; i < list.size(); ++i) list[i] = i;
    const DopNode leaf{0, std::uint32_t(list.size()), true};
    dop_kernels<float>(active_kernel_set())
        .refit(26)({&leaf, 1, list.data(), positions.data(), directions.data(), none.data(), sides.data()});
    Exact dop;
    for (std::size_t slab = 0; slab < Exact::slabs; ++slab) {
      dop.upper[slab] = sides[slab];
      dop.lower[slab] = -sides[half + slab];
    }
    for (std::size_t i = 0; i < list.size(); ++i) {
      const double point[3] = {points[3 * i], points[3 * i + 1], points[3 * i + 2]};
      outside += protrusion(dop, point) > 0 ? 1 : 0;
    }
  });
  EXPECT_GT(outside, 0U);
}

/// The pairs of leaves that a search finds, sorted; within one tree, with the smaller leaf first.
template <class H>
std::vector<LeafPair> searched(const H& a, const H& b, std::uint64_t& tests, const Budget& budget,
                               std::size_t& pending) {
  typename H::Scratch scratch;
  std::vector<LeafPair> found;
  pending = H::search(a, b, scratch, tests, budget, [&](std::uint32_t p, std::uint32_t q) {
    found.emplace_back(&a == &b ? std::min(p, q) : p, &a == &b ? std::max(p, q) : q);
  });
  std::sort(found.begin(), found.end());
  return found;
}

template <class S, int K>
void expect_search_finds_all(std::uint32_t points, const BuilderConfig& builder) {
  Random random(points);
  const auto cloud = [&] {
    std::vector<S> positions(3 * points);
    for (S& x : positions) x = S(random.below(1U << 16)) / S(1U << 16);
    return Cloud<S>(std::move(positions), builder);
  };
  const Cloud<S> clouds[2] = {cloud(), cloud()};
  for (const KernelSet set : supported_kernel_sets()) {
    DopHierarchy<S, K> trees[2] = {{clouds[0].topology, clouds[0].primitives, Cover::vertices, set},
                                   {clouds[1].topology, clouds[1].primitives, Cover::vertices, set}};
    for (int i = 0; i < 2; ++i) trees[i].refit(clouds[i].positions.data());
    for (const bool within : {false, true}) {
      const auto &a = trees[0], &b = trees[within ? 0 : 1];
      std::vector<LeafPair> expected;
      for (std::uint32_t p = 0; p < a.topology().size(); ++p)
        for (std::uint32_t q = within ? p : 0; q < b.topology().size(); ++q)
          if (a.topology().nodes[p].is_leaf() && b.topology().nodes[q].is_leaf() &&
              (overlap(a.volume(p), b.volume(q))))
            expected.emplace_back(p, q);
      std::uint64_t tests = 0;
      std::size_t pending = 0;
      EXPECT_EQ(searched(a, b, tests, {}, pending), expected) << K << " sides, " << name(set);
      EXPECT_EQ(pending, 0U);
      std::uint64_t few = 0;
      const auto part = searched(a, b, few, {.box_tests = tests / 2}, pending);
      EXPECT_GT(pending, 0U);
      EXPECT_TRUE(std::includes(expected.begin(), expected.end(), part.begin(), part.end()));
    }
  }
}
TEST(DopHierarchy, FindsTheLeavesThatOverlap) {
  for (const BuilderConfig& builder : builders) {
    expect_search_finds_all<float, 14>(300, builder);
    expect_search_finds_all<float, 18>(300, builder);
    expect_search_finds_all<float, 26>(300, builder);
    expect_search_finds_all<double, 18>(300, builder);
  }
}

TEST(DopHierarchy, OfNothingFindsNothing) {
  const Primitives none;
  DopHierarchy<float, 18> empty(Topology{}, none, Cover::vertices);
  const float past_the_end = 0;
  empty.refit(&past_the_end);
  std::uint64_t tests = 0;
  std::size_t pending = 1;
  EXPECT_TRUE(searched(empty, empty, tests, {}, pending).empty());
  EXPECT_EQ(pending, 0U);
}

}  // namespace
}  // namespace kbvh::test::dop_hierarchy_test
