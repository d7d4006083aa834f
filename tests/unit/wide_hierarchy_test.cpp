// Wide hierarchies: every set of kernels gives the same bits as boxes made one by one, for every builder,
// width and leaf size, and the same pairs as comparing all boxes with all.
#include "core/families/wide/wide_hierarchy.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/support/polygon_soups.hpp"
#include "tests/support/wide_bodies.hpp"

namespace kbvh {
namespace {

template <class S>
Scene<S> soups(std::uint32_t primitives, std::uint32_t seed) {
  test::Random random(seed);
  return test::polygon_soups<S>(primitives, random);
}

template <class S>
Box<S> box_below(const Topology& topology, std::uint32_t node, const std::vector<Box<S>>& boxes) {
  Box<S> box;
  const TopologyNode n = topology.nodes[node];
  for (std::uint32_t k = n.first(); k < n.first() + n.count(); ++k)
    box.extend(n.is_leaf() ? boxes[topology.primitives[k]] : box_below(topology, k, boxes));
  return box;
}

struct Shape {
  std::uint32_t primitives;
  BuilderConfig builder;
};

std::vector<Shape> shapes() {
  std::vector<Shape> list;
  for (const BuildMethod method : {BuildMethod::median, BuildMethod::sah, BuildMethod::morton})
    for (const std::uint32_t width : {2u, 4u, 8u})
      for (const std::uint32_t leaf : {1u, 2u, 3u, 4u, 5u, 8u, 9u, 13u, 16u})
        for (const std::uint32_t primitives : {1u, 2u, 7u, 64u, 300u})
          list.push_back({primitives, {.method = method, .width = width, .leaf_size = leaf}});
  return list;
}

template <class S>
void check_all_shapes() {
  for (const Shape& shape : shapes()) {
    const Scene<S> scene = soups<S>(shape.primitives, shape.primitives + shape.builder.leaf_size);
    const SceneView<S> view(scene);
    Playback<S> playback(scene);
    playback.evaluate_all();
    const SampledMotion<S> motion(playback);
    std::vector<Box<S>> boxes[2];
    PairBuffer expected;
    for (std::uint32_t body = 0; body < 2; ++body)
      boxes[body] = primitive_boxes(view.primitives(body), playback.positions(body));
    for (std::uint32_t p = 0; p < boxes[0].size(); ++p)
      for (std::uint32_t q = 0; q < boxes[1].size(); ++q)
        if (overlap(boxes[0][p], boxes[1][q])) expected.push_back({0, p, 1, q});
    std::uint64_t first_tests = 0;
    for (const KernelSet set : supported_kernel_sets()) {
      const std::string where = std::string(name(set)) + ", " + name(shape.builder.method) + ", width " +
                                std::to_string(shape.builder.width) + ", leaf " +
                                std::to_string(shape.builder.leaf_size) + ", " +
                                std::to_string(shape.primitives);
      WideHierarchy<S> hierarchies[2];
      for (std::uint32_t body = 0; body < 2; ++body) {
        hierarchies[body].assign(build_topology<S>(boxes[body], shape.builder), view.primitives(body), set);
        hierarchies[body].refit(playback.positions(body));
        const Topology& topology = hierarchies[body].topology();
        for (std::uint32_t node = 0; node < topology.size(); ++node)
          ASSERT_EQ(hierarchies[body].box(node), box_below(topology, node, boxes[body]))
              << where << ", node " << node;
      }
      WideQuery<S> query(view, motion);
      PairBuffer pairs;
      std::uint64_t tests = 0;
      const QueryStatus status = query.run({&hierarchies[0], 0}, {&hierarchies[1], 1}, pairs, tests);
      EXPECT_TRUE(status.complete()) << where;
      std::sort(pairs.begin(), pairs.end());
      ASSERT_EQ(pairs, expected) << where;
      if (set == KernelSet::portable) first_tests = tests;
      EXPECT_EQ(tests, first_tests) << where;  // counters do not depend on the kernels, either
    }
  }
}

TEST(WideHierarchy, KernelsAgreeInFloat) {
  check_all_shapes<float>();
}
TEST(WideHierarchy, KernelsAgreeInDouble) {
  check_all_shapes<double>();
}

TEST(WideHierarchy, SetBoxIsWhatTheQueryReads) {
  const Scene<float> scene = soups<float>(100, 5);
  const SceneView<float> view(scene);
  Playback<float> playback(scene);
  playback.evaluate_all();
  const auto boxes = primitive_boxes(view.primitives(0), playback.positions(0));
  WideHierarchy<float> made, set;
  const Topology topology = build_topology<float>(boxes, {.width = 8, .leaf_size = 4});
  made.assign(topology, view.primitives(0), active_kernel_set());
  set.assign(topology, view.primitives(0), active_kernel_set());
  made.refit(playback.positions(0));
  for (std::uint32_t node = 0; node < topology.size(); ++node) set.set_box(node, made.box(node));
  for (std::uint32_t wide = 0; wide < made.node_count(); ++wide) {
    for (std::size_t i = 0; i < lane_scalars(8); ++i)
      EXPECT_EQ(made.arrays().child_bounds[wide * lane_scalars(8) + i],
                set.arrays().child_bounds[wide * lane_scalars(8) + i]);
    for (std::size_t i : {0, 1, 2, 4, 5, 6})
      EXPECT_EQ(made.arrays().node_bounds[8 * wide + i], set.arrays().node_bounds[8 * wide + i]);
  }
}

TEST(WideHierarchy, ABudgetLeavesWorkUndone) {
  test::WideBodies<float> bodies(soups<float>(300, 6), {.width = 2, .leaf_size = 1}, active_kernel_set());
  bodies.seek(0);
  PairBuffer all, some;
  std::uint64_t tests = 0;
  bodies.query.run(bodies.side(0), bodies.side(1), all, tests);
  const QueryStatus status = bodies.query.run(bodies.side(0), bodies.side(1), some, tests, Budget{tests / 2});
  EXPECT_FALSE(status.complete());
  EXPECT_LT(some.size(), all.size());
}

/// Two bodies of `count` equal triangles; those of the second fly away by the second keyframe.
template <class S>
Scene<S> coincident(std::uint32_t count) {
  Scene<S> scene;
  for (int body = 0; body < 2; ++body) {
    Body<S> made;
    std::vector<S> positions;
    for (int keyframe = 0; keyframe < 2; ++keyframe)
      for (std::uint32_t p = 0; p < count; ++p)
        for (int corner = 0; corner < 3; ++corner) {
          positions.push_back(S(corner == 1) + S(9 * body * keyframe));
          positions.push_back(S(corner == 2));
          positions.push_back(S(0));
        }
    for (std::uint32_t p = 0; p < count; ++p)
      made.primitives.add(std::vector<std::uint32_t>{3 * p, 3 * p + 1, 3 * p + 2});
    made.plans = FlightPlans<S>(3 * count, {0, 1}, std::move(positions));
    scene.bodies.push_back(std::move(made));
  }
  scene.pairs = all_pairs(scene.bodies);
  return scene;
}

/// All pairs of many overlap: every buffer is filled more than once. Then none does, then all again.
template <class S>
void check_overflowing_buffers(std::uint32_t leaf_size) {
  const std::uint32_t count = 300;
  for (const KernelSet set : supported_kernel_sets())
    for (const std::uint32_t width : {2u, 8u}) {
      test::WideBodies<S> bodies(coincident<S>(count), {.width = width, .leaf_size = leaf_size}, set);
      for (const double t : {0.0, 1.0, 0.0}) {
        bodies.seek(t);
        std::uint64_t tests = 0;
        const PairBuffer pairs = bodies.candidates(tests);
        EXPECT_EQ(std::adjacent_find(pairs.begin(), pairs.end()), pairs.end());
        EXPECT_EQ(pairs.size(), t == 0 ? std::size_t(count) * count : 0) << name(set) << ", width " << width;
      }
    }
}

TEST(WideHierarchy, BuffersMayOverflowAndPositionsChange) {
  for (const std::uint32_t leaf_size : {1u, 4u, 16u}) {
    check_overflowing_buffers<float>(leaf_size);
    check_overflowing_buffers<double>(leaf_size);
  }
}

TEST(WideHierarchy, AQueryRefusesUnlikeHierarchies) {
  test::WideBodies<float> bodies(soups<float>(40, 8), {.width = 8, .leaf_size = 1}, active_kernel_set());
  bodies.build(1, {.width = 8, .leaf_size = 4}, active_kernel_set());
  bodies.seek(0);
  std::uint64_t tests = 0;
  EXPECT_THROW(bodies.candidates(tests), std::invalid_argument);
}

TEST(WideHierarchy, SubtreesAndWhatIsAboveMakeAllBoxes) {
  for (const BuildMethod method : {BuildMethod::median, BuildMethod::sah, BuildMethod::morton}) {
    const Scene<float> scene = soups<float>(20000, 7);
    const SceneView<float> view(scene);
    Playback<float> playback(scene);
    playback.evaluate_all();
    const auto boxes = primitive_boxes(view.primitives(0), playback.positions(0));
    const Topology topology = build_topology<float>(boxes, {.method = method, .width = 8, .leaf_size = 2});
    WideHierarchy<float> whole, parts;
    whole.assign(topology, view.primitives(0), active_kernel_set());
    parts.assign(topology, view.primitives(0), active_kernel_set());
    whole.refit(playback.positions(0));
    EXPECT_GE(parts.subtrees().size(), 4u) << name(method);
    for (const auto& subtree : parts.subtrees())
      parts.refit_nodes(playback.positions(0), subtree.begin, subtree.end);
    for (const std::uint32_t node : parts.above_subtrees())
      parts.refit_nodes(playback.positions(0), node, node + 1);
    for (std::uint32_t node = 0; node < topology.size(); ++node) ASSERT_EQ(parts.box(node), whole.box(node));
  }
}

TEST(KernelSets, AreNamedAndChecked) {
  EXPECT_EQ(supported_kernel_sets().front(), KernelSet::portable);
  EXPECT_THROW(kernel_set("mmx"), std::invalid_argument);
  const KernelSet before = active_kernel_set();
  for (const KernelSet set : supported_kernel_sets()) {
    EXPECT_EQ(kernel_set(name(set)), set);
    use_kernel_set(set);
    EXPECT_EQ(active_kernel_set(), set);
  }
  use_kernel_set(before);
}

}  // namespace
}  // namespace kbvh
