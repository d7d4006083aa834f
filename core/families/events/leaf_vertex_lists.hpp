#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "core/base/list_pool.hpp"
#include "core/topology/topology.hpp"
#include "core/topology/topology_edit.hpp"

namespace kbvh {

/// The unique vertices of every leaf of one body, ascending, by node, and, after `index`, the leaves of every
/// vertex. Both follow edits of the topology.
class LeafVertexLists {
 public:
  LeafVertexLists(const Topology& topology, const Primitives& primitives);
  ~LeafVertexLists();
  LeafVertexLists(LeafVertexLists&&) noexcept;
  LeafVertexLists& operator=(LeafVertexLists&&) noexcept;

  /// Returns the vertices of a leaf; empty for an inner node.
  std::span<const std::uint32_t> operator[](std::uint32_t node) const { return vertices_[node]; }

  /// Lists the leaves of every vertex at the first call. O(nodes + vertices of leaves).
  void index(std::uint32_t vertex_count);
  /// Appends the leaves of each of `vertices`. A vertex that was added after `index`, and is in no primitive,
  /// has none.
  void add_leaves_of(std::span<const std::uint32_t> vertices, std::vector<std::uint32_t>& leaves) const;

  /// Replaces the vertices of a leaf by `vertices`, after sorting them and removing duplicates.
  void assign(std::uint32_t leaf, std::vector<std::uint32_t>& vertices, std::uint32_t vertex_count);
  /// Moves the lists of nodes that have new ids after an edit, and makes room for `nodes` nodes.
  void follow(const TopologyEdit& edit, std::uint32_t nodes, std::uint32_t vertex_count);

  std::size_t bytes() const { return vertices_.bytes() + leaves_.bytes(); }

 private:
  /// Adds a leaf to the lists of its vertices.
  void list(std::uint32_t leaf, std::uint32_t vertex_count);
  /// Removes a leaf from the lists of its vertices.
  void unlist(std::uint32_t leaf);

  ListPool vertices_;  ///< by node
  ListPool leaves_;    ///< by vertex; empty before `index`
};

}  // namespace kbvh
