#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "core/families/wide/kernels/wide_layout.hpp"

namespace kbvh {

/// The wide nodes of an edited hierarchy by height, so that children precede their parents. A node's height
/// is 0 if all its children are leaves, and otherwise one more than the greatest of its children. Each change
/// of a height by one exchanges two nodes of the order.
class HeightOrder {
 public:
  /// Orders the nodes of a new layout, in which children have larger numbers than their parents. Nodes of
  /// one height keep the order of their numbers.
  void assign(std::span<const WideNode> nodes);
  /// Makes room for the numbers below `count`.
  void resize(std::size_t count) {
    heights_.resize(count, 0);
    ranks_.resize(count, 0);
  }

  std::span<const std::uint32_t> nodes() const { return nodes_; }
  std::uint32_t height(std::uint32_t node) const { return heights_[node]; }
  std::uint32_t rank(std::uint32_t node) const { return ranks_[node]; }

  /// Adds a node of height 0. O(greatest height).
  void insert(std::uint32_t node);
  /// Removes a node. O(greatest height).
  void remove(std::uint32_t node);
  /// Replaces the number of the node at a place of the order; its height is given. O(1).
  void renumber(std::uint32_t rank, std::uint32_t node, std::uint32_t height) {
    nodes_[rank] = node;
    ranks_[node] = rank;
    heights_[node] = height;
  }
  /// O(difference of heights).
  void set_height(std::uint32_t node, std::uint32_t height) {
    while (heights_[node] < height) raise(node);
    while (heights_[node] > height) lower(node);
  }

  std::size_t bytes() const {
    return (nodes_.capacity() + heights_.capacity() + ranks_.capacity() + begin_.capacity()) *
           sizeof(std::uint32_t);
  }

 private:
  void raise(std::uint32_t node);
  void lower(std::uint32_t node);
  void put(std::uint32_t node, std::uint32_t rank);

  std::vector<std::uint32_t> nodes_;            ///< by height
  std::vector<std::uint32_t> begin_;            ///< [height]: its first place in nodes_
  std::vector<std::uint32_t> heights_, ranks_;  ///< [node]
};

}  // namespace kbvh
