#pragma once
#include <algorithm>
#include <cstdint>
#include <vector>

#include "core/geometry/box.hpp"
#include "core/topology/topology.hpp"
#include "core/topology/traversal.hpp"

namespace kbvh {

/// A binary tree over one body's primitives that is never built: primitives are inserted and removed one by
/// one, and rotations on the way up keep it good (Catto 2019, as in Box2D). Leaves hold boxes that are larger
/// than their primitives. Ids of nodes are recycled; memory grows only with the number of primitives.
///
/// Surface areas alone make a chain of boxes that are equal or lie in each other. Therefore the heights of
/// two siblings never differ by more than `slack`. This limits the depth to 3.6 log2(primitives), up to a
/// constant, because a tree of height h has at least as many leaves as trees of heights h - 1 and h - 1 -
/// slack together.
template <class S>
class DynamicTree {
 public:
  static constexpr std::uint32_t none = ~std::uint32_t(0);
  static constexpr std::uint32_t slack = 8;
  struct Node {
    Box<S> box;
    std::uint32_t parent = none;
    std::uint32_t first = none;   ///< a child; of a leaf, its primitive
    std::uint32_t second = none;  ///< a child; none for a leaf
    std::uint32_t height = 0;     ///< 0 for a leaf
    bool is_leaf() const { return second == none; }
  };

  /// Forgets all primitives, and makes room for the ids below `primitives`.
  void clear(std::uint32_t primitives);
  /// Makes room for more ids.
  void grow(std::uint32_t primitives);
  /// Inserts a primitive that is not in the tree. O(log n).
  void insert(std::uint32_t primitive, const Box<S>& box);
  /// Removes a primitive that is in the tree. O(log n).
  void remove(std::uint32_t primitive);

  bool contains(std::uint32_t primitive) const {
    return primitive < leaf_of_.size() && leaf_of_[primitive] != none;
  }
  /// Returns the box of a primitive's leaf.
  const Box<S>& leaf_box(std::uint32_t primitive) const { return nodes_[leaf_of_[primitive]].box; }
  bool empty() const { return root_ == none; }
  std::uint32_t root() const { return root_; }
  const Node& node(std::uint32_t id) const { return nodes_[id]; }
  /// Returns the number of nodes that insertions and removals have visited since `clear`.
  std::uint64_t visited() const { return visited_; }

  /// Calls on_leaves(primitive of a, primitive of b) for all leaves whose boxes, and those of all nodes above
  /// them, overlap; within one tree, for each two leaves once. Adds the box tests made to `tests`.
  template <class OnLeaves>
  static void search(const DynamicTree& a, const DynamicTree& b, std::vector<NodePair>& stack,
                     std::uint64_t& tests, OnLeaves&& on_leaves) {
    stack.clear();
    if (a.empty() || b.empty()) return;
    const bool within = &a == &b;
    const auto push = [&](std::uint32_t first, std::uint32_t second) {
      ++tests;
      if (overlap(a.nodes_[first].box, b.nodes_[second].box)) stack.push_back({first, second});
    };
    push(a.root_, b.root_);
    while (!stack.empty()) {
      const NodePair pair = stack.back();
      stack.pop_back();
      const Node &first = a.nodes_[pair.first], &second = b.nodes_[pair.second];
      if (within && pair.first == pair.second) {
        if (first.is_leaf()) continue;
        stack.push_back({first.first, first.first});
        stack.push_back({first.second, first.second});
        push(first.first, first.second);
      } else if (first.is_leaf() && second.is_leaf()) {
        on_leaves(first.first, second.first);
      } else if (second.is_leaf() ||
                 (!first.is_leaf() && surface_area(first.box) > surface_area(second.box))) {
        push(first.first, pair.second);
        push(first.second, pair.second);
      } else {
        push(pair.first, second.first);
        push(pair.first, second.second);
      }
    }
  }

  /// Returns the tree as a topology, and the box of each node: for audits.
  Topology topology(std::vector<Box<double>>& boxes) const;
  std::size_t bytes() const {
    return nodes_.capacity() * sizeof(Node) +
           (leaf_of_.capacity() + free_.capacity()) * sizeof(std::uint32_t);
  }

 private:
  std::uint32_t new_node();
  std::uint32_t best_sibling(const Box<S>& box);
  /// Recomputes the boxes from a node upwards, and rotates where that makes a box smaller.
  void refit_from(std::uint32_t node);
  void rotate(std::uint32_t node);
  void balance(std::uint32_t node);
  void exchange(std::uint32_t node, std::uint32_t down, std::uint32_t up);
  void join(std::uint32_t node);
  std::uint32_t height_above(std::uint32_t first, std::uint32_t second) const {
    return 1 + std::max(nodes_[first].height, nodes_[second].height);
  }
  static bool balanced(std::uint32_t height, std::uint32_t other) {
    return std::max(height, other) - std::min(height, other) <= slack;
  }

  std::vector<Node> nodes_;
  std::vector<std::uint32_t> leaf_of_;  ///< by primitive
  std::vector<std::uint32_t> free_;     ///< unused nodes
  std::uint32_t root_ = none;
  std::uint64_t visited_ = 0;
};

extern template class DynamicTree<float>;
extern template class DynamicTree<double>;

}  // namespace kbvh
