// Leaves of a wide hierarchy that exchange primitives: the layout equals a new one, sorts give the tree of
// the median builder, and a strategy that sorts at every frame conforms, while seeded faults are found.

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "core/families/restructure/leaf_contents.hpp"
#include "core/families/wide/stored_hierarchy.hpp"
#include "core/families/wide/surface_sums.hpp"
#include "core/topology/builders.hpp"
#include "tests/conformance/check.hpp"
#include "tests/support/polygon_soups.hpp"

namespace kbvh::test::leaf_contents_test {
namespace {

/// The first body of a soup of polygons with 3 to 5 corners, and its hierarchy.
template <class S>
struct Soup {
  Soup(std::uint32_t count, const BuilderConfig& config) : scene(polygon_soups<S>(count, random)) {
    const FlightPlans<S>& plans = scene.bodies[0].plans;
    positions.assign(plans.keyframe(0), plans.keyframe(0) + std::size_t(3) * plans.vertex_count());
    positions.push_back(0);
    hierarchy.assign(build_topology(primitives(), positions.data(), config), primitives(),
                     active_kernel_set());
    hierarchy.refit(positions.data());
    contents.prepare(hierarchy);
  }
  const Primitives& primitives() const { return scene.bodies[0].primitives; }
  void mix_positions() {
    for (std::size_t i = 0; i + 1 < positions.size(); ++i) positions[i] = S(random.unit() * 8);
    hierarchy.positions_changed();
    hierarchy.refit(positions.data());
  }
  /// Returns the first difference from a new layout, or nothing.
  std::string fault() {
    const Topology& topology = hierarchy.topology();
    if (const std::string broken = check_topology(topology, primitives()); !broken.empty()) return broken;
    WideHierarchy<S> fresh;
    fresh.assign(topology, primitives(), active_kernel_set());
    fresh.refit(positions.data());
    for (std::uint32_t node = 0; node < topology.size(); ++node)
      if (!(hierarchy.box(node) == fresh.box(node))) return "another box of node " + std::to_string(node);
    if (hierarchy.leaf_vertex_count() != fresh.leaf_vertex_count()) return "another number of vertices";
    for (std::uint32_t leaf = 0; leaf < fresh.leaf_count(); ++leaf) {
      const auto ours = hierarchy.leaf_primitives(leaf), theirs = fresh.leaf_primitives(leaf);
      if (!std::equal(ours.begin(), ours.end(), theirs.begin(), theirs.end())) return "other primitives";
    }
    PairBuffer ours, theirs;
    std::uint64_t tests = 0, fresh_tests = 0;
    WideQuery<S> query;
    query.run({&hierarchy, 0, positions.data()}, {&hierarchy, 0, positions.data()}, ours, tests);
    query.run({&fresh, 0, positions.data()}, {&fresh, 0, positions.data()}, theirs, fresh_tests);
    return ours == theirs && tests == fresh_tests ? "" : "other pairs";
  }

  Random random{71};
  Scene<S> scene;
  std::vector<S> positions;
  WideHierarchy<S> hierarchy;
  LeafContents<S> contents;
};

constexpr std::uint32_t root[] = {0};

template <class S>
class LeafContentsOf : public testing::Test {};
using Scalars = testing::Types<float, double>;
TYPED_TEST_SUITE(LeafContentsOf, Scalars);

std::vector<BuilderConfig> configs() {
  std::vector<BuilderConfig> all;
  for (const BuildMethod method : {BuildMethod::median, BuildMethod::sah})
    for (const std::uint32_t width : {2u, 4u, 8u})
      for (const std::uint32_t leaf : {1u, 4u, 16u})
        all.push_back({.method = method, .width = width, .leaf_size = leaf});
  return all;
}

// A strategy whose geometry vanishes at run time needs this, too.
TYPED_TEST(LeafContentsOf, ATreeWithoutNodesOrOfOneLeafIsSorted) {
  using S = TypeParam;
  const BuilderConfig config{.method = BuildMethod::median, .width = 8, .leaf_size = 16};
  Soup<S> soup(3, config);
  ASSERT_EQ(soup.hierarchy.topology().size(), 1U);
  const std::vector<std::uint32_t> before = soup.hierarchy.topology().primitives;
  EXPECT_TRUE(soup.contents.sort_in_parts(soup.hierarchy, soup.primitives(), soup.positions.data(),
                                          MedianSort::unlimited));
  EXPECT_EQ(soup.hierarchy.topology().primitives, before);
  EXPECT_EQ(soup.fault(), "");

  const Primitives none;
  soup.hierarchy.assign(build_topology(none, soup.positions.data(), config), none, active_kernel_set());
  soup.contents.prepare(soup.hierarchy);
  EXPECT_TRUE(
      soup.contents.sort_in_parts(soup.hierarchy, none, soup.positions.data(), MedianSort::unlimited));
  EXPECT_FALSE(soup.contents.in_parts());
}

TYPED_TEST(LeafContentsOf, RefilledLayoutEqualsANewOne) {
  for (const BuilderConfig& config : configs()) {
    Soup<TypeParam> soup(700, config);
    const Topology start = soup.hierarchy.topology();
    for (int round = 0; round < 5; ++round) {
      soup.mix_positions();
      soup.hierarchy.positions_changed();
      const auto& topology = soup.hierarchy.topology();
      const std::uint32_t child = topology.nodes[0].first(), children[] = {child, child + 1};
      if (round == 0)
        soup.contents.sort_primitives(soup.hierarchy, soup.primitives(), soup.positions.data(), root);
      else if (round == 1)
        soup.contents.sort_primitives(soup.hierarchy, soup.primitives(), soup.positions.data(), children);
      else
        soup.contents.renew_leaves(soup.hierarchy, soup.primitives(), soup.positions.data(),
                                   round == 2 ? 0 : soup.contents.full_leaf_count() / 3);
      soup.hierarchy.refit(soup.positions.data());
      ASSERT_EQ(soup.fault(), "") << "width " << config.width << ", leaf " << config.leaf_size << ", round "
                                  << round;
    }
    EXPECT_FALSE(soup.hierarchy.topology() == start);
    soup.hierarchy.undo_edits(soup.primitives());
    soup.hierarchy.refit(soup.positions.data());
    EXPECT_TRUE(soup.hierarchy.topology() == start);
    EXPECT_EQ(soup.fault(), "");
  }
}

TYPED_TEST(LeafContentsOf, ASortedTreeIsAsGoodAsABuiltOne) {
  const BuilderConfig config{.method = BuildMethod::median, .width = 8, .leaf_size = 4};
  Soup<TypeParam> soup(3000, config);
  soup.mix_positions();
  const double aged = surface_ratio(soup.hierarchy);
  WideHierarchy<TypeParam> built;
  built.assign(build_topology(soup.primitives(), soup.positions.data(), config), soup.primitives(),
               active_kernel_set());
  built.refit(soup.positions.data());
  const double best = surface_ratio(built);
  soup.contents.sort_primitives(soup.hierarchy, soup.primitives(), soup.positions.data(), root);
  soup.hierarchy.refit(soup.positions.data());
  EXPECT_LT(surface_ratio(soup.hierarchy), 1.02 * best);
  EXPECT_GT(aged, 1.2 * best);

  // A second sort exchanges nothing between leaves.
  EXPECT_EQ(soup.fault(), "");
  const auto leaves = [&] {
    std::vector<std::vector<std::uint32_t>> all;
    for (std::uint32_t leaf = 0; leaf < soup.hierarchy.leaf_count(); ++leaf) {
      const auto primitives = soup.hierarchy.leaf_primitives(leaf);
      auto& sorted = all.emplace_back(primitives.begin(), primitives.end());
      std::sort(sorted.begin(), sorted.end());
    }
    return all;
  };
  const auto sorted = leaves();
  soup.contents.sort_primitives(soup.hierarchy, soup.primitives(), soup.positions.data(), root);
  EXPECT_TRUE(leaves() == sorted);
}

TYPED_TEST(LeafContentsOf, ASortInPartsEqualsOneAtOnce) {
  const BuilderConfig config{.method = BuildMethod::median, .width = 8, .leaf_size = 4};
  Soup<TypeParam> at_once(1000, config), in_parts(1000, config);
  at_once.mix_positions();
  in_parts.mix_positions();
  at_once.contents.sort_primitives(at_once.hierarchy, at_once.primitives(), at_once.positions.data(), root);
  int parts = 1;
  while (!in_parts.contents.sort_in_parts(in_parts.hierarchy, in_parts.primitives(),
                                          in_parts.positions.data(), 500)) {
    ++parts;
    EXPECT_TRUE(in_parts.contents.in_parts());
  }
  EXPECT_GT(parts, 4);
  EXPECT_TRUE(in_parts.hierarchy.topology() == at_once.hierarchy.topology());
}

TEST(MedianSort, TakesEqualKeysAndOneItem) {
  MedianSort sort;
  for (const std::uint32_t count : {1u, 2u, 49u, 1000u}) {
    sort.resize(count);
    for (std::uint32_t i = 0; i < count; ++i) sort.items()[i] = {{7, i % 2, 7}, i};
    sort.sort_groups(0, count, 16);
    std::vector<bool> seen(count, false);
    for (std::uint32_t i = 0; i < count; ++i) {
      ASSERT_LT(sort.items()[i].id, count);
      EXPECT_FALSE(seen[sort.items()[i].id]);
      seen[sort.items()[i].id] = true;
    }
  }
}

enum class Fault : std::uint8_t { none, boxes_before, lost_primitive };

/// Sorts all primitives and renews a third of the leaves, alternately.
template <class S, Fault fault>
class Sorting : public StoredHierarchyStrategy<S>, public AnswersSelfPairs, public TakesGeometryChanges<S> {
  using Base = StoredHierarchyStrategy<S>;

 public:
  static constexpr Foresight foresight = Foresight::none;
  Sorting(const SceneView<S>& scene, const SampledMotion<S>& motion, Topologies topologies,
          const Params& params)
      : Base(scene, motion, std::move(topologies), params), contents_(scene.body_count()) {
    for (std::uint32_t body = 0; body < contents_.size(); ++body) topology_changed(body);
  }
  void follow_geometry(double /*t*/, const GeometryChange<S>& change) override {
    this->edit_geometry(change);
  }

 private:
  void topology_changed(std::uint32_t body) override { contents_[body].prepare(this->hierarchies_[body]); }
  void update(std::uint32_t body) override {
    auto& hierarchy = this->hierarchies_[body];
    const Primitives& primitives = this->scene_.primitives(body);
    const S* const positions = this->sampled_.positions(body);
    this->refit(body);
    if (hierarchy.topology().size() < 3) return;
    if (++frame_ % 2 == 0)
      contents_[body].sort_primitives(hierarchy, primitives, positions, root);
    else
      contents_[body].renew_leaves(hierarchy, primitives, positions, contents_[body].full_leaf_count() / 3);
    if (fault == Fault::lost_primitive) {
      std::vector<std::uint32_t> order = hierarchy.topology().primitives;
      order.front() = order.back();
      hierarchy.refill(order, primitives);
    }
    if (fault != Fault::boxes_before) this->refit(body);
  }
  std::vector<LeafContents<S>> contents_;
  int frame_ = 0;
};
template <Fault fault>
struct With {
  template <class S>
  using Strategy = Sorting<S, fault>;
};
template <Fault fault>
StrategyEntry entry() {
  Info info;
  info.id = "sorting";
  info.declares = {.restructures = true, .time_budget = true};
  return make_entry<With<fault>::template Strategy>(std::move(info));
}

TEST(LeafContents, SortedAtEveryFrameKeepEveryGuarantee) {
  for (const std::string& name : all_synthetic_names())
    for (const std::uint32_t leaf : {1u, 4u}) {
      const BuilderConfig builder{
          .method = leaf == 1 ? BuildMethod::sah : BuildMethod::median, .width = 8, .leaf_size = leaf};
      EXPECT_EQ(check(entry<Fault::none>(), synthetic_scene<float>(name, 3), 3, {}, builder), "") << name;
      EXPECT_EQ(check(entry<Fault::none>(), synthetic_scene<double>(name, 3), 3, {}, builder), "") << name;
    }
}
TEST(LeafContents, AreTakenBackByReset) {
  expect_reset_restores_topology(entry<Fault::none>());
}
TEST(LeafContents, OldBoxesAreSeen) {
  const BuilderConfig builder{.method = BuildMethod::median, .width = 8, .leaf_size = 4};
  EXPECT_NE(check(entry<Fault::boxes_before>(), synthetic_scene<float>("soups", 3), 3, {}, builder), "");
}
TEST(LeafContents, ALostPrimitiveIsSeen) {
  const BuilderConfig builder{.method = BuildMethod::median, .width = 8, .leaf_size = 4};
  EXPECT_NE(check(entry<Fault::lost_primitive>(), synthetic_scene<float>("soups", 3), 3, {}, builder), "");
}

}  // namespace
}  // namespace kbvh::test::leaf_contents_test
