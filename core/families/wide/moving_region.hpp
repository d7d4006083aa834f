#pragma once
#include <algorithm>
#include <cstring>
#include <utility>
#include <vector>

#include "core/families/wide/wide_hierarchy.hpp"

namespace kbvh {

/// The nodes of one hierarchy below which vertices move, and a refit of these nodes alone. The hierarchy must
/// not be edited.
template <class S>
class MovingRegion {
 public:
  using Marks = std::vector<std::uint8_t>;  ///< [wide node]: 1 for nodes of the region

  /// O(entries of vertex lists).
  void assign(WideHierarchy<S>& hierarchy, std::uint32_t vertices) {
    vertices_ = vertices;
    runs_.reserve(hierarchy.node_count() / 2 + 1);
    list_nodes_of_vertices(hierarchy);
  }

  /// Marks the nodes above all vertices that differ between two arrays [vertex][3]; marks all nodes if most
  /// vertices differ, because finding the others would not pay. O(vertices + nodes).
  void mark(WideHierarchy<S>& hierarchy, const S* first, const S* last, Marks& marks) const {
    constexpr std::uint32_t block = 16;  // vertices that are compared at once
    marks.assign(hierarchy.node_count(), 0);
    const auto differ = [&](std::size_t v, std::size_t many) {
      return std::memcmp(first + 3 * v, last + 3 * v, 3 * many * sizeof(S)) != 0;
    };
    std::uint32_t moving = 0;
    for (std::uint32_t v = 0; v < vertices_; v += block) {
      const std::uint32_t end = std::min(v + block, vertices_);
      if (!differ(v, end - v)) continue;
      for (std::uint32_t i = v; i < end; ++i) {
        if (!differ(i, 1)) continue;
        ++moving;
        for (std::uint32_t k = first_[i]; k < first_[i + 1]; ++k) marks[nodes_[k]] = 1;
      }
      if (2 * moving > vertices_) {
        std::fill(marks.begin(), marks.end(), 1);
        return;
      }
    }
    const WideNode* const nodes = hierarchy.arrays().nodes;
    for (std::size_t node = marks.size(); node-- > 0;)
      for (std::uint32_t i = nodes[node].leaf_count; i < nodes[node].count; ++i)
        marks[node] |= marks[nodes[node].first_child + i - nodes[node].leaf_count];
  }

  /// Takes the marked nodes for the next refits. O(nodes).
  void take(WideHierarchy<S>& hierarchy, const Marks& marks) {
    const WideNode* const nodes = hierarchy.arrays().nodes;
    runs_.clear();
    boxes_ = reads_ = 0;
    for (std::uint32_t node = hierarchy.node_count(); node-- > 0;) {
      if (marks[node] == 0) continue;
      if (!runs_.empty() && runs_.back().begin == node + 1)
        runs_.back().begin = node;
      else
        runs_.push_back({node, node + 1});
      boxes_ += nodes[node].count;
      reads_ += hierarchy.leaf_vertices_of(node);
    }
  }
  /// Refits these nodes.
  void refit(WideHierarchy<S>& hierarchy, const S* positions) const {
    for (const Run& run : runs_) hierarchy.refit_nodes(positions, run.begin, run.end);
  }
  /// Return the number of boxes that a refit writes, and of the vertices that it reads, each once per leaf.
  std::uint64_t boxes() const { return boxes_; }
  std::uint64_t reads() const { return reads_; }

  std::size_t bytes() const {
    return runs_.capacity() * sizeof(Run) + (first_.capacity() + nodes_.capacity()) * sizeof(std::uint32_t);
  }

 private:
  struct Run {
    std::uint32_t begin, end;  ///< wide nodes
  };

  /// Lists, for each vertex, the wide nodes with leaves that contain it, by counting.
  void list_nodes_of_vertices(WideHierarchy<S>& hierarchy) {
    constexpr std::uint32_t none = ~std::uint32_t(0);
    const WideArrays<S> arrays = hierarchy.arrays();
    std::vector<std::uint32_t> last(vertices_, none);  // node listed last
    const auto for_entries = [&](const auto& work) {
      std::fill(last.begin(), last.end(), none);
      for (std::uint32_t node = 0; node < hierarchy.node_count(); ++node) {
        const WideNode& wide = arrays.nodes[node];
        if (wide.leaf_count == 0) continue;
        for (std::uint32_t i = 0; i < wide.length * hierarchy.width(); ++i) {
          const std::uint32_t vertex = arrays.vertices[wide.list + i] / 3;
          if (std::exchange(last[vertex], node) != node) work(vertex, node);
        }
      }
    };
    first_.assign(vertices_ + 1, 0);
    for_entries([&](std::uint32_t vertex, std::uint32_t) { ++first_[vertex + 1]; });
    for (std::uint32_t v = 0; v < vertices_; ++v) first_[v + 1] += first_[v];
    nodes_.resize(first_[vertices_]);
    std::vector<std::uint32_t> next(first_.begin(), first_.end() - 1);
    for_entries([&](std::uint32_t vertex, std::uint32_t node) { nodes_[next[vertex]++] = node; });
  }

  std::uint32_t vertices_ = 0;
  std::vector<std::uint32_t> first_, nodes_;  ///< [vertex + 1] and its wide nodes
  std::vector<Run> runs_;                     ///< the last first: children before parents
  std::uint64_t boxes_ = 0, reads_ = 0;
};

}  // namespace kbvh
