// Local edits of topologies: sound after each of many random operations, never deep for long, and with
// bounded memory.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/base/list_pool.hpp"
#include "core/topology/builders.hpp"
#include "core/topology/topology_edit.hpp"
#include "tests/support/synthetic_scenes.hpp"

namespace kbvh::test::topology_edit_test {
namespace {

/// Primitives of one vertex each, with given boxes; an edited topology, and boxes that are kept up to date.
class Edited {
 public:
  Edited(std::uint32_t count, const BuilderConfig& config, std::uint64_t seed) : random_(seed) {
    for (std::uint32_t p = 0; p < count; ++p) add(random_box());
    topology_ = build_topology<double>(boxes_, config);
    editor_.emplace(topology_, count);
    refit();
  }

  Random& random() { return random_; }
  const Topology& topology() const { return topology_; }
  const TopologyEditor& editor() const { return *editor_; }
  const Primitives& primitives() const { return primitives_; }

  Box<double> random_box() {
    Box<double> box;
    double centre[3] = {random_.unit(), random_.unit(), random_.unit()};
    for (int corner = 0; corner < 2; ++corner) {
      double point[3];
      for (int axis = 0; axis < 3; ++axis) point[axis] = centre[axis] + 0.1 * random_.unit();
      box.extend(point);
    }
    return box;
  }
  /// Returns the number of leaves that were rebalanced.
  std::size_t insert(const Box<double>& box) {
    const std::uint32_t p = add(box);
    const std::uint32_t at = leaf_for(topology_, box, [&](std::uint32_t n) { return node_boxes_[n]; });
    const std::uint32_t leaf = editor_->insert(topology_, at, p, edit_);
    refit();
    EXPECT_EQ(editor_->leaf_of(p), leaf);
    std::size_t relaid = 0;
    for (std::uint32_t top; (top = editor_->unbalanced_above(topology_, p)) != TopologyEditor::none;) {
      editor_->rebalance(topology_, top, edit_, [&](std::uint32_t n) { return node_boxes_[n]; });
      refit();
      relaid += edit_.moved.size();
    }
    return relaid;
  }
  void remove(std::uint32_t p) {
    living_.erase(std::find(living_.begin(), living_.end(), p));
    primitives_.remove(p);
    editor_->remove(topology_, p, edit_);
    refit();
  }
  std::uint32_t any_primitive() { return living_[random_.below(std::uint32_t(living_.size()))]; }
  std::size_t living() const { return living_.size(); }

  /// Returns the first fault, or nothing: of the exported topology, the primitives' places, or the sizes.
  std::string fault() const {
    std::vector<std::uint32_t> order;
    const Topology exported = compacted(topology_, order);
    const std::string broken = check_topology(exported, primitives_);
    if (!broken.empty()) return broken;
    std::uint32_t leaves = 0;
    for (std::uint32_t i = 0; i < exported.size(); ++i) {
      const TopologyNode node = exported.nodes[i];
      const std::uint32_t old = order[i];
      if (i > 0 && exported.parents[i] != 0 && topology_.parents[old] != order[exported.parents[i]])
        return "parents differ";
      if (i > 0 && topology_.depths[old] != 255 &&
          topology_.depths[old] <= topology_.depths[topology_.parents[old]])
        return "depths do not grow downwards";
      if (!node.is_leaf()) continue;
      ++leaves;
      for (std::uint32_t k = node.first(); k < node.first() + node.count(); ++k)
        if (editor_->leaf_of(exported.primitives[k]) != old) return "a primitive is not where it should be";
    }
    if (leaves != editor_->leaf_count()) return "leaves miscounted";
    return "";
  }
  std::uint32_t depth() const {
    std::vector<std::uint32_t> order, depths;
    const Topology exported = compacted(topology_, order);
    std::uint32_t deepest = 0;
    for (std::uint32_t i = 0; i < exported.size(); ++i) {
      depths.push_back(i == 0 ? 0 : depths[exported.parents[i]] + 1);
      deepest = std::max(deepest, depths.back());
    }
    return deepest;
  }

 private:
  std::uint32_t add(const Box<double>& box) {
    const std::uint32_t vertex[1] = {primitives_.count()};
    primitives_.add(vertex);
    boxes_.push_back(box);
    living_.push_back(primitives_.count() - 1);
    return living_.back();
  }
  void refit() {
    std::vector<std::uint32_t> order;
    const Topology exported = compacted(topology_, order);
    node_boxes_.assign(topology_.size(), {});
    for (std::uint32_t i = exported.size(); i-- > 0;) {
      const TopologyNode node = exported.nodes[i];
      for (std::uint32_t k = node.first(); k < node.first() + node.count(); ++k)
        node_boxes_[order[i]].extend(node.is_leaf() ? boxes_[exported.primitives[k]] : node_boxes_[order[k]]);
    }
  }

  Random random_;
  Primitives primitives_;
  std::vector<Box<double>> boxes_, node_boxes_;
  std::vector<std::uint32_t> living_;
  Topology topology_;
  std::optional<TopologyEditor> editor_;
  TopologyEdit edit_;
};

TEST(TopologyEdit, StaysSoundOverTenThousandRandomOperations) {
  for (const std::uint32_t width : {2u, 4u, 8u})
    for (const std::uint32_t leaf_size : {1u, 4u}) {
      SCOPED_TRACE("width " + std::to_string(width) + ", leaf size " + std::to_string(leaf_size));
      Edited edited(40, {.width = width, .leaf_size = leaf_size}, 7 * width + leaf_size);
      std::uint32_t most_leaves = edited.editor().leaf_count();
      const std::uint32_t nodes_at_start = edited.topology().size();
      for (int i = 0; i < 10'000; ++i) {
        // Tides: towards 150 primitives, towards none, and so on.
        const std::uint32_t chance = (i / 500) % 2 == 0 ? 6 : 4;
        if (edited.living() == 0 || (edited.living() < 150 && edited.random().below(10) < chance))
          edited.insert(edited.random_box());
        else
          edited.remove(edited.any_primitive());
        most_leaves = std::max(most_leaves, edited.editor().leaf_count());
        ASSERT_EQ(edited.fault(), "") << "operation " << i;
      }
      EXPECT_LT(edited.topology().size(), nodes_at_start + 2 * most_leaves);
      if (width == 2) {
        EXPECT_LE(edited.topology().size(), 2 * most_leaves);
      }
      while (edited.living() > 0) {
        edited.remove(edited.any_primitive());
        ASSERT_EQ(edited.fault(), "");
      }
      EXPECT_TRUE(edited.topology().empty());
      edited.insert(edited.random_box());
      EXPECT_EQ(edited.fault(), "");
    }
}

// Each box is far from all earlier ones and larger: without balance every insertion would be one level
// deeper.
TEST(TopologyEdit, DepthStaysLogarithmicUnderAdversarialInsertions) {
  Edited edited(1, {.width = 2, .leaf_size = 1}, 5);
  std::size_t relaid = 0;
  const int n = 600;
  for (int i = 0; i < n; ++i) {
    Box<double> box;
    const double at[3] = {std::ldexp(1.0, i), 0, 0}, and_at[3] = {std::ldexp(1.0, i), 1, 1};
    box.extend(at);
    box.extend(and_at);
    relaid += edited.insert(box);
    ASSERT_EQ(edited.fault(), "") << i;
    ASSERT_LE(edited.depth(), 2 * std::log2(i + 2) + 1) << i;
  }
  EXPECT_GT(relaid, 0u);
  // Amortised over insertions, a small multiple of the depth (Galperin & Rivest 1993).
  EXPECT_LT(double(relaid), 4.0 * n * std::log2(n));
}

// A hierarchy that wanders: inserted at one end, removed at the other. Ids and depths must not grow with it.
TEST(TopologyEdit, NodesAreUsedAgain) {
  Edited edited(0, {.width = 2, .leaf_size = 1}, 6);
  for (std::uint32_t i = 0; i < 3000; ++i) {
    Box<double> box;
    const double at[3] = {double(i), 0, 0}, and_at[3] = {i + 0.5, 1, 1};
    box.extend(at);
    box.extend(and_at);
    edited.insert(box);
    if (i >= 50) edited.remove(i - 50);
    ASSERT_EQ(edited.fault(), "") << i;
  }
  EXPECT_LE(edited.topology().size(), 2u * 51u);
  EXPECT_LE(edited.topology().primitives.size(), 2u * 51u);
}

// A primitive is removed and inserted again: the tree is as perfect as before, and declared so.
TEST(Compacted, SaysWhatIsPerfectNow) {
  std::vector<Box<double>> boxes(8);
  for (std::uint32_t i = 0; i < boxes.size(); ++i) {
    const double at[3] = {double(i), 0, 0};
    boxes[i].extend(at);
  }
  Topology topology =
      build_topology<double>(boxes, {.method = BuildMethod::median, .width = 2, .leaf_size = 1});
  ASSERT_TRUE(topology.perfect);
  TopologyEditor editor(topology, 8);
  TopologyEdit edit;
  std::vector<std::uint32_t> order;
  const std::uint32_t neighbour =
      topology.parents[editor.leaf_of(3)] == topology.parents[editor.leaf_of(2)] ? 2 : 4;
  editor.remove(topology, 3, edit);
  EXPECT_FALSE(compacted(topology, order).perfect);
  editor.insert(topology, editor.leaf_of(neighbour), 3, edit);
  EXPECT_TRUE(compacted(topology, order).perfect);
}

TEST(ListPool, KeepsListsApart) {
  const std::vector<std::uint32_t> offsets{0, 2, 2, 5};
  ListPool pool(offsets, {1, 2, 3, 4, 5});
  std::vector<std::vector<std::uint32_t>> expected{{1, 2}, {}, {3, 4, 5}};
  Random random(3);
  for (int i = 0; i < 20'000; ++i) {
    const std::uint32_t key = random.below(pool.keys());
    std::vector<std::uint32_t>& list = expected[key];
    switch (random.below(7)) {
      case 0:
      case 1:
        list.push_back(std::uint32_t(i));
        ASSERT_EQ(pool.push(key, std::uint32_t(i)), list.size() - 1);
        break;
      case 2:
        if (list.empty()) break;
        pool.erase(key, list.front());
        list.front() = list.back();
        list.pop_back();
        break;
      case 3:
        list.assign(random.below(9), std::uint32_t(i));
        pool.assign(key, list);
        break;
      case 4:
        if (random.below(4) == 0) list.clear(), pool.clear(key);
        break;
      case 5:
        if (random.below(20) != 0) break;
        expected.resize(1 + random.below(40));
        pool.resize(std::uint32_t(expected.size()));
        break;
      case 6:
        if (list.empty()) break;
        const std::uint32_t index = random.below(std::uint32_t(list.size()));
        ASSERT_EQ(pool.erase_at(key, index), list.back());
        list[index] = list.back();
        list.pop_back();
        break;
    }
    for (std::uint32_t k = 0; k < pool.keys(); ++k)
      ASSERT_TRUE(std::equal(pool[k].begin(), pool[k].end(), expected[k].begin(), expected[k].end())) << i;
  }
  EXPECT_LT(pool.bytes(), std::size_t(64) << 10);  // abandoned space is used again
  pool.clear();
  EXPECT_EQ(pool.keys(), expected.size());
  for (std::uint32_t k = 0; k < pool.keys(); ++k) EXPECT_TRUE(pool[k].empty());
}

}  // namespace
}  // namespace kbvh::test::topology_edit_test
