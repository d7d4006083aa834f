#pragma once
#include <algorithm>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "core/base/inverted_lists.hpp"
#include "core/base/list_pool.hpp"
#include "core/topology/topology.hpp"
#include "core/topology/topology_edit.hpp"

namespace kbvh {

/// The unique vertices of every leaf of one body, ascending, by node, and, after `index`, the leaves of every
/// vertex. Both follow edits of the topology.
class LeafVertexLists {
 public:
  LeafVertexLists(const Topology& topology, const Primitives& primitives) {
    LeafVertices lists = unique_leaf_vertices(topology, primitives);
    vertices_ = ListPool(lists.offsets, std::move(lists.vertices));
  }

  /// Returns the vertices of a leaf; empty for an inner node.
  std::span<const std::uint32_t> operator[](std::uint32_t node) const { return vertices_[node]; }

  /// Lists the leaves of every vertex at the first call. O(nodes + vertices of leaves).
  void index(std::uint32_t vertex_count) {
    if (leaves_.keys() == 0) leaves_ = inverted(vertices_, vertex_count);
  }
  /// Appends the leaves of each of `vertices`. A vertex that was added after `index`, and is in no primitive,
  /// has none.
  void add_leaves_of(std::span<const std::uint32_t> vertices, std::vector<std::uint32_t>& leaves) const {
    for (std::uint32_t v : vertices) {
      if (v >= leaves_.keys()) continue;
      leaves.insert(leaves.end(), leaves_[v].begin(), leaves_[v].end());
    }
  }

  /// Replaces the vertices of a leaf by `vertices`, after sorting them and removing duplicates.
  void assign(std::uint32_t leaf, std::vector<std::uint32_t>& vertices, std::uint32_t vertex_count) {
    std::sort(vertices.begin(), vertices.end());
    vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());
    unlist(leaf);
    vertices_.assign(leaf, vertices);
    list(leaf, vertex_count);
  }
  /// Moves the lists of nodes that have new ids after an edit, and makes room for `nodes` nodes.
  void follow(const TopologyEdit& edit, std::uint32_t nodes, std::uint32_t vertex_count) {
    std::vector<std::pair<std::uint32_t, std::vector<std::uint32_t>>> moved;
    for (const TopologyEdit::Move& move : edit.moved) {
      const auto vertices = vertices_[move.from];
      if (vertices.empty()) continue;
      moved.emplace_back(move.to, std::vector<std::uint32_t>(vertices.begin(), vertices.end()));
      unlist(move.from);
      vertices_.clear(move.from);
    }
    vertices_.resize(nodes);
    for (const auto& [to, vertices] : moved) {
      unlist(to);
      vertices_.assign(to, vertices);
      list(to, vertex_count);
    }
  }

  std::size_t bytes() const { return vertices_.bytes() + leaves_.bytes(); }

 private:
  /// Adds a leaf to the lists of its vertices.
  void list(std::uint32_t leaf, std::uint32_t vertex_count) {
    if (leaves_.keys() == 0) return;
    leaves_.resize(vertex_count);
    for (std::uint32_t v : vertices_[leaf]) leaves_.push(v, leaf);
  }
  /// Removes a leaf from the lists of its vertices.
  void unlist(std::uint32_t leaf) {
    if (leaves_.keys() == 0) return;
    for (std::uint32_t v : vertices_[leaf]) leaves_.erase(v, leaf);
  }

  ListPool vertices_;  ///< by node
  ListPool leaves_;    ///< by vertex; empty before `index`
};

}  // namespace kbvh
