// Exchanging subtrees in place: the validator finds the topology sound, contents go where the edit states,
// and the work is in proportion to the change. Collapsed trees are those that were exchanged.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/topology/builders.hpp"
#include "core/topology/collapse.hpp"
#include "core/topology/subtree_swap.hpp"
#include "tests/support/synthetic_scenes.hpp"

namespace kbvh::test::subtree_swap_test {
namespace {

Topology random_tree(std::uint32_t primitives, BuildMethod method, Random& random, std::uint32_t width = 2) {
  std::vector<Box<double>> boxes(primitives);
  for (Box<double>& box : boxes)
    for (int corner = 0; corner < 2; ++corner) {
      const double point[3] = {random.unit(), std::pow(random.unit(), 3), std::pow(random.unit(), 5)};
      box.extend(point);
    }
  return build_topology<double>(boxes, {.method = method, .width = width, .leaf_size = 2});
}

/// Lists the primitives below a node, and below all nodes below it, ascending. Parents may have larger ids
/// than their children.
void list_below(const Topology& topology, std::uint32_t node,
                std::vector<std::vector<std::uint32_t>>& below) {
  const TopologyNode content = topology.nodes[node];
  std::vector<std::uint32_t> found;
  for (std::uint32_t k = content.first(); k < content.first() + content.count(); ++k) {
    if (content.is_leaf()) {
      found.push_back(topology.primitives[k]);
      continue;
    }
    list_below(topology, k, below);
    found.insert(found.end(), below[k].begin(), below[k].end());
  }
  std::sort(found.begin(), found.end());
  below[node] = std::move(found);
}
/// The primitives below each node, ascending.
std::vector<std::vector<std::uint32_t>> primitives_below(const Topology& topology) {
  std::vector<std::vector<std::uint32_t>> below(topology.size());
  if (!topology.empty()) list_below(topology, 0, below);
  return below;
}

std::uint32_t nodes_below(const Topology& topology, std::uint32_t node) {
  const TopologyNode content = topology.nodes[node];
  if (content.is_leaf()) return 1;
  return 1 + nodes_below(topology, content.first()) + nodes_below(topology, content.first() + 1);
}

bool above(const Topology& topology, std::uint32_t upper, std::uint32_t node) {
  for (; node != upper; node = topology.parents[node])
    if (node == 0) return false;
  return true;
}

/// Any two nodes of which neither is above the other.
std::pair<std::uint32_t, std::uint32_t> two_places(const Topology& topology, Random& random) {
  for (;;) {
    const std::uint32_t a = random.below(topology.size()), b = random.below(topology.size());
    if (!above(topology, a, b) && !above(topology, b, a)) return {a, b};
  }
}

/// Exchanges two subtrees and compares the result with the former state.
void exchange_and_check(Topology& topology, std::uint32_t primitives, std::uint32_t a, std::uint32_t b,
                        SubtreeSwap& swapping, TopologyEdit& edit) {
  const auto before = primitives_below(topology);
  std::vector<std::uint32_t> order;
  swapping.exchange(topology, a, b, edit);
  ASSERT_EQ(check_topology(compacted(topology, order), primitives), "") << a << " and " << b;
  ASSERT_FALSE(topology.perfect);
  // The new place of everything.
  std::vector<std::uint32_t> now(topology.size());
  for (std::uint32_t node = 0; node < topology.size(); ++node) now[node] = node;
  for (const auto& move : edit.moved) now[move.from] = move.to;
  ASSERT_EQ(edit.moved.size(), 2u);
  ASSERT_EQ(now[a], b);
  ASSERT_EQ(now[b], a);
  // Every node has the same primitives below as before, except those above one of the places and not above
  // both.
  const auto after = primitives_below(topology);
  const std::uint32_t at_a = now[a], at_b = now[b];
  ASSERT_EQ(after[at_a], before[a]);
  ASSERT_EQ(after[at_b], before[b]);
  for (std::uint32_t node = 0; node < topology.size(); ++node) {
    const std::uint32_t there = now[node];
    const bool holds_a = there != at_a && above(topology, there, at_a),
               holds_b = there != at_b && above(topology, there, at_b);
    if (holds_a == holds_b) {
      ASSERT_EQ(after[there], before[node]) << node;
    } else {
      ASSERT_TRUE(std::includes(after[there].begin(), after[there].end(), before[holds_a ? a : b].begin(),
                                before[holds_a ? a : b].end()));
    }
  }
  for (const std::uint32_t node : {at_a, at_b})
    ASSERT_NE(std::find(edit.changed.begin(), edit.changed.end(), topology.parents[node]),
              edit.changed.end());
}

TEST(SubtreeSwap, StaysSoundOverThousandsOfRandomExchanges) {
  Random random(3);
  for (const BuildMethod method : {BuildMethod::median, BuildMethod::sah, BuildMethod::morton})
    for (const std::uint32_t primitives : {5u, 16u, 100u}) {
      Topology topology = random_tree(primitives, method, random);
      SubtreeSwap swapping;
      TopologyEdit edit;
      for (int i = 0; i < 400; ++i) {
        const auto [a, b] = two_places(topology, random);
        exchange_and_check(topology, primitives, a, b, swapping, edit);
        if (HasFatalFailure()) return;
      }
    }
}

TEST(SubtreeSwap, TakesItselfBack) {
  Random random(5);
  const Topology start = random_tree(64, BuildMethod::sah, random);
  for (int i = 0; i < 200; ++i) {
    Topology topology = start;
    SubtreeSwap swapping;
    TopologyEdit edit;
    const auto [a, b] = two_places(topology, random);
    for (int twice = 0; twice < 2; ++twice) swapping.exchange(topology, a, b, edit);
    EXPECT_EQ(topology.nodes, start.nodes);
    EXPECT_EQ(topology.parents, start.parents);
    EXPECT_EQ(topology.depths, start.depths);
  }
}

TEST(SubtreeSwap, RotatesAChildWithAGrandchild) {
  Random random(7);
  Topology topology = random_tree(200, BuildMethod::median, random);
  SubtreeSwap swapping;
  TopologyEdit edit;
  std::vector<std::uint32_t> order;
  std::size_t rotations = 0;
  for (int i = 0; i < 20'000; ++i) {
    const std::uint32_t node = 1 + random.below(topology.size() - 1);
    const TopologyNode siblings = topology.nodes[topology.parents[node]];
    const std::uint32_t sibling = siblings.first() + (node == siblings.first() ? 1 : 0);
    if (topology.nodes[sibling].is_leaf()) continue;
    swapping.exchange(topology, node, topology.nodes[sibling].first() + random.below(2), edit);
    if (++rotations % 50 == 0) {
      ASSERT_EQ(check_topology(compacted(topology, order), 200u), "") << i;
    }
  }
  EXPECT_EQ(check_topology(compacted(topology, order), 200u), "");
  EXPECT_GT(rotations, 5000u);
}

// A rotation far down in a large tree walks through a few nodes, not the tree.
TEST(SubtreeSwap, CostsWhatItChanges) {
  Random random(9);
  Topology topology = random_tree(1 << 15, BuildMethod::median, random);
  SubtreeSwap swapping;
  TopologyEdit edit;
  std::vector<std::uint32_t> order;
  std::size_t rotations = 0;
  for (int i = 0; i < 30'000; ++i) {
    const std::uint32_t node = 1 + random.below(topology.size() - 1);
    if (nodes_below(topology, topology.parents[node]) > 15) continue;
    const TopologyNode siblings = topology.nodes[topology.parents[node]];
    const std::uint32_t sibling = siblings.first() + (node == siblings.first() ? 1 : 0);
    if (topology.nodes[sibling].is_leaf()) continue;
    swapping.exchange(topology, node, topology.nodes[sibling].first() + random.below(2), edit);
    ++rotations;
  }
  EXPECT_EQ(check_topology(compacted(topology, order), 1u << 15), "");
  EXPECT_GT(rotations, 1000u);
  EXPECT_LE(swapping.bytes(), 256u);
}

TEST(SubtreeSwap, RefusesWhatIsNoExchange) {
  Random random(11);
  Topology topology = random_tree(40, BuildMethod::median, random);
  const Topology before = topology;
  SubtreeSwap swapping;
  TopologyEdit edit;
  const std::uint32_t left = topology.nodes[0].first(), below = topology.nodes[left].first();
  EXPECT_THROW(swapping.exchange(topology, left, left, edit), std::invalid_argument);
  EXPECT_THROW(swapping.exchange(topology, left, below, edit), std::invalid_argument);
  EXPECT_THROW(swapping.exchange(topology, below, left, edit), std::invalid_argument);
  EXPECT_THROW(swapping.exchange(topology, 0, left, edit), std::invalid_argument);
  EXPECT_THROW(swapping.exchange(topology, left, topology.size(), edit), std::invalid_argument);
  EXPECT_TRUE(topology == before);
}

// In topologies of any width, the primitives below exchanged places change sides, and no other id changes.
TEST(SubtreeSwap, ExchangesInAnyWidth) {
  Random random(21);
  for (const std::uint32_t width : {2u, 4u, 8u}) {
    Topology topology = random_tree(300, BuildMethod::sah, random, width);
    SubtreeSwap swapping;
    TopologyEdit edit;
    std::vector<std::uint32_t> order;
    for (int i = 0; i < 300; ++i) {
      const auto [a, b] = two_places(topology, random);
      const Topology before = topology;
      swapping.exchange(topology, a, b, edit);
      ASSERT_EQ(check_topology(compacted(topology, order), 300u), "") << a << " and " << b;
      ASSERT_EQ(topology.nodes[a], before.nodes[b]);
      ASSERT_EQ(topology.nodes[b], before.nodes[a]);
      ASSERT_EQ(edit.moved.size(), 2u);
      for (std::uint32_t node = 0; node < topology.size(); ++node) {
        ASSERT_TRUE(node == a || node == b || topology.nodes[node] == before.nodes[node]);
        ASSERT_EQ(topology.depths[node], node == 0 ? 0 : topology.depths[topology.parents[node]] + 1);
      }
    }
    EXPECT_THROW(swapping.exchange(topology, 0, 5, edit), std::invalid_argument);
    EXPECT_THROW(swapping.exchange(topology, 5, 5, edit), std::invalid_argument);
    EXPECT_THROW(swapping.exchange(topology, 5, topology.size(), edit), std::invalid_argument);
  }
}

TEST(Collapse, EditedTreesBecomeWideOnes) {
  Random random(11);
  SubtreeSwap swapping;
  TopologyEdit edit;
  for (const BuildMethod method : {BuildMethod::median, BuildMethod::sah, BuildMethod::morton})
    for (const std::uint32_t primitives : {1u, 2u, 3u, 9u, 200u}) {
      Topology binary = random_tree(primitives, method, random);
      for (int i = 0; binary.size() > 5 && i < 100; ++i) {
        const auto [a, b] = two_places(binary, random);
        swapping.exchange(binary, a, b, edit);
      }
      std::vector<std::uint32_t> order;
      binary = compacted(binary, order);
      std::vector<double> weights(binary.size());
      for (double& weight : weights) weight = random.unit();
      const auto below = primitives_below(binary);
      for (const std::uint32_t width : {4u, 8u}) {
        std::vector<std::uint32_t> node_of;
        const Topology wide = collapsed(binary, width, weights, node_of);
        ASSERT_EQ(check_topology(wide, primitives), "") << name(method) << ", " << primitives;
        std::uint32_t narrow = 0;
        const auto wide_below = primitives_below(wide);
        ASSERT_EQ(node_of.size(), wide.size());
        for (std::uint32_t node = 0; node < wide.size(); ++node)
          ASSERT_EQ(wide_below[node], below[node_of[node]]);
        // A node has space left only if all its children are leaves.
        for (const TopologyNode node : wide.nodes) {
          if (node.is_leaf() || node.count() == width) continue;
          ++narrow;
          for (std::uint32_t c = node.first(); c < node.first() + node.count(); ++c)
            ASSERT_TRUE(wide.nodes[c].is_leaf());
        }
        if (primitives == 200) {
          EXPECT_GT(narrow, 0u);
        }
      }
    }
}

TEST(Collapse, OpensTheHeaviestChild) {
  // Chains to the left: only the weights decide which pair of grandchildren comes up.
  Random random(2);
  const Topology binary = random_tree(64, BuildMethod::median, random);
  std::vector<double> weights(binary.size(), 0);
  const TopologyNode root = binary.nodes[0];
  const std::uint32_t heavy = root.first() + 1;
  weights[heavy] = 2;
  weights[binary.nodes[heavy].first()] = 1;
  std::vector<std::uint32_t> node_of;
  const Topology wide = collapsed(binary, 4, weights, node_of);
  ASSERT_EQ(wide.nodes[0].count(), 4u);
  const auto below = primitives_below(binary), found = primitives_below(wide);
  const std::uint32_t opened = binary.nodes[heavy].first();
  const std::uint32_t expected[4] = {root.first(), binary.nodes[opened].first(),
                                     binary.nodes[opened].first() + 1, opened + 1};
  for (std::uint32_t c = 0; c < 4; ++c) EXPECT_EQ(found[wide.nodes[0].first() + c], below[expected[c]]) << c;
}

TEST(Collapse, RefusesWhatItCannotDo) {
  Random random(3);
  const Topology binary = random_tree(20, BuildMethod::sah, random);
  const std::vector<double> weights(binary.size(), 1), few(3, 1);
  std::vector<std::uint32_t> node_of;
  EXPECT_THROW(collapsed(binary, 2, weights, node_of), std::invalid_argument);
  EXPECT_THROW(collapsed(binary, 8, few, node_of), std::invalid_argument);
  const Topology wide = random_tree(20, BuildMethod::sah, random, 4);
  EXPECT_THROW(collapsed(wide, 8, std::vector<double>(wide.size(), 1), node_of), std::invalid_argument);
  EXPECT_TRUE(collapsed(Topology{}, 8, {}, node_of).empty());
}

}  // namespace
}  // namespace kbvh::test::subtree_swap_test
