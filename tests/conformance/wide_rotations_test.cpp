// A refit over wide nodes whose topologies are edited at every frame conforms on every synthetic scene.

#include <gtest/gtest.h>

#include <algorithm>

#include "core/families/wide/stored_hierarchy.hpp"
#include "core/topology/subtree_swap.hpp"
#include "tests/conformance/check.hpp"

namespace kbvh::test::wide_rotations_test {
namespace {

enum class Boxes : std::uint8_t { recomputed, as_before_the_edit };

/// Edits every moving body at each frame, after the refit: rotates random nodes and rebuilds a subtree. The
/// query reads the edited layout.
template <class S, Boxes boxes>
class Restructuring : public StoredHierarchyStrategy<S>,
                      public AnswersSelfPairs,
                      public TakesGeometryChanges<S> {
  using Base = StoredHierarchyStrategy<S>;

 public:
  static constexpr Foresight foresight = Foresight::none;
  using Base::Base;
  void follow_geometry(double /*t*/, const GeometryChange<S>& change) override {
    this->edit_geometry(change);
  }
  static inline std::uint64_t edits = 0;

 private:
  void update(std::uint32_t body) override {
    this->refit(body);
    WideHierarchy<S>& hierarchy = this->hierarchies_[body];
    const Topology& topology = hierarchy.topology();
    if (topology.size() < 5) return;
    for (int i = 0; i < 6; ++i) rotate(body);
    const std::uint32_t node = any_node(topology);
    if (topology.nodes[node].is_leaf()) return;
    edit(body, [&](Topology& edited, TopologyEdit& list) {
      TopologyEditor editor(edited, this->scene_.primitives(body).count());
      editor.rebalance(edited, node, list, [&](std::uint32_t n) { return to_double(hierarchy.box(n)); });
    });
  }
  /// Exchanges a child of a random node with a child of one of its siblings.
  void rotate(std::uint32_t body) {
    const Topology& topology = this->hierarchies_[body].topology();
    const std::uint32_t node = any_node(topology);
    if (node == 0) return;
    const TopologyNode siblings = topology.nodes[topology.parents[node]];
    const std::uint32_t sibling = siblings.first() + random_.below(siblings.count());
    const TopologyNode content = topology.nodes[sibling];
    if (sibling == node || content.is_leaf()) return;
    const std::uint32_t grandchild = content.first() + random_.below(content.count());
    edit(body, [&](Topology& edited, TopologyEdit& list) { swap_.exchange(edited, node, grandchild, list); });
  }
  template <class Change>
  void edit(std::uint32_t body, const Change& change) {
    this->hierarchies_[body].edit(change);
    if (boxes == Boxes::recomputed) this->hierarchies_[body].refit_edited(this->sampled_.positions(body));
    ++edits;
  }
  std::uint32_t any_node(const Topology& topology) {
    for (;;) {
      const std::uint32_t node = random_.below(topology.size());
      if (topology.parents[node] < topology.size()) return node;
    }
  }

  Random random_{97};
  SubtreeSwap swap_;
};
template <class S>
using Sound = Restructuring<S, Boxes::recomputed>;
template <class S>
using Faulty = Restructuring<S, Boxes::as_before_the_edit>;

template <template <class> class T>
StrategyEntry restructuring() {
  Info info;
  info.id = "restructuring";
  info.declares = {.restructures = true, .time_budget = true};
  return make_entry<T>(std::move(info));
}

class WideRotations : public testing::TestWithParam<std::string> {};

TEST_P(WideRotations, AtEveryFrameKeepEveryGuarantee) {
  Sound<float>::edits = 0;
  const StrategyEntry entry = restructuring<Sound>();
  for (const std::uint32_t width : {2u, 4u, 8u})
    for (const std::uint32_t leaf : {1u, 4u}) {
      const BuilderConfig builder{
          .method = leaf == 1 ? BuildMethod::sah : BuildMethod::median, .width = width, .leaf_size = leaf};
      const std::string where = "width " + std::to_string(width) + ", leaf " + std::to_string(leaf);
      EXPECT_EQ(check(entry, synthetic_scene<float>(GetParam(), 3), 3, {}, builder), "") << where;
      EXPECT_EQ(check(entry, synthetic_scene<double>(GetParam(), 3), 3, {}, builder), "") << where;
    }
  if (GetParam() == "soups" || GetParam() == "sheets") {
    EXPECT_GT((Sound<float>::edits), 100u);
  }
}

INSTANTIATE_TEST_SUITE_P(Synthetic, WideRotations, testing::ValuesIn(all_synthetic_names()),
                         [](const auto& test) { return test.param; });

TEST(WideRotation, WithoutNewBoxesIsSeen) {
  const BuilderConfig builder{.method = BuildMethod::sah, .width = 8, .leaf_size = 1};
  EXPECT_NE(check(restructuring<Faulty>(), synthetic_scene<float>("soups", 3), 3, {}, builder), "");
}

TEST(WideRotation, IsTakenBackByReset) {
  expect_reset_restores_topology(restructuring<Sound>());
}

}  // namespace
}  // namespace kbvh::test::wide_rotations_test
