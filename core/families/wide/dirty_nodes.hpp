#pragma once
#include <algorithm>
#include <bit>
#include <cstdint>
#include <numeric>
#include <span>
#include <vector>

#include "core/base/assert.hpp"
#include "core/families/wide/wide_hierarchy.hpp"

namespace kbvh {

/// Finds the nodes of a wide hierarchy that have to be refitted when only some vertices have moved: those
/// with a leaf at such a vertex, and all above. For layouts that were never edited: children have larger
/// numbers than their parents.
template <class S>
class DirtyNodes {
 public:
  /// Lists the nodes with leaves at each of the body's vertices. O(vertices of leaves).
  void assign(WideHierarchy<S>& hierarchy, std::uint32_t vertices) {
    KBVH_ASSERT(!hierarchy.edited());
    const WideArrays<S> arrays = hierarchy.arrays();
    const std::uint32_t count = hierarchy.node_count(), width = hierarchy.width();
    constexpr std::uint32_t none = ~std::uint32_t(0);
    std::vector<std::uint32_t> last(vertices);
    // Calls take(vertex, node) once for each vertex and each node with leaves at it; lists repeat vertices.
    const auto for_each = [&](const auto& take) {
      std::fill(last.begin(), last.end(), none);
      for (std::uint32_t n = 0; n < count; ++n) {
        if (arrays.nodes[n].leaf_count == 0) continue;
        const std::size_t begin = arrays.nodes[n].list, entries = std::size_t(arrays.nodes[n].length) * width;
        for (std::size_t i = begin; i < begin + entries; ++i) {
          const std::uint32_t vertex = arrays.vertices[i] / 3;
          if (last[vertex] == n) continue;
          last[vertex] = n;
          take(vertex, n);
        }
      }
    };
    first_.assign(std::size_t(vertices) + 1, 0);
    for_each([&](std::uint32_t vertex, std::uint32_t /*node*/) { ++first_[vertex + 1]; });
    std::partial_sum(first_.begin(), first_.end(), first_.begin());
    nodes_.resize(first_.back());
    std::vector<std::uint32_t> next(first_.begin(), first_.end() - 1);
    for_each([&](std::uint32_t vertex, std::uint32_t node) { nodes_[next[vertex]++] = node; });
    parents_.assign(count, 0);
    for (std::uint32_t n = 0; n < count; ++n)
      for (std::uint32_t lane = arrays.nodes[n].leaf_count; lane < arrays.nodes[n].count; ++lane)
        parents_[arrays.nodes[n].first_child + lane - arrays.nodes[n].leaf_count] = n;
    marks_.assign((std::size_t(count) + 63) / 64, 0);
    order_.clear();
    order_.reserve(count);
  }

  /// Returns the nodes to refit, children before their parents; valid until the next call. Vertices may
  /// repeat. O(leaves at the vertices + returned nodes + nodes / 64).
  std::span<const std::uint32_t> find(std::span<const std::uint32_t> moved) {
    for (const std::uint32_t vertex : moved)
      for (std::uint32_t i = first_[vertex]; i < first_[vertex + 1]; ++i) mark(nodes_[i]);
    order_.clear();
    for (std::size_t word = marks_.size(); word-- > 0;)
      while (marks_[word] != 0) {
        const auto bit = std::uint32_t(std::bit_width(marks_[word]) - 1);
        marks_[word] ^= std::uint64_t(1) << bit;
        const std::uint32_t node = std::uint32_t(64 * word) + bit;
        order_.push_back(node);
        if (node != 0) mark(parents_[node]);
      }
    return order_;
  }

  std::size_t bytes() const {
    return (first_.capacity() + nodes_.capacity() + parents_.capacity() + order_.capacity()) *
               sizeof(std::uint32_t) +
           marks_.capacity() * sizeof(std::uint64_t);
  }

 private:
  void mark(std::uint32_t node) { marks_[node / 64] |= std::uint64_t(1) << node % 64; }

  std::vector<std::uint32_t> first_, nodes_;  ///< of vertex v: nodes_[first_[v] .. first_[v + 1])
  std::vector<std::uint32_t> parents_;        ///< of nodes; the root is its own
  std::vector<std::uint64_t> marks_;          ///< a bit for each node; 0 between calls
  std::vector<std::uint32_t> order_;
};

}  // namespace kbvh
