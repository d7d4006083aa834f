#pragma once
#include <algorithm>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "core/base/inverted_lists.hpp"
#include "core/base/list_pool.hpp"
#include "core/geometry/lane_box.hpp"
#include "core/topology/topology.hpp"

namespace kbvh {

/// The vertices of leaves, unique and ascending. A list is keyed by the leaf's first primitive entry, not by
/// its node, so that lists do not change when leaves move to other nodes.
class BoxTreeLeaves {
 public:
  BoxTreeLeaves(const Topology& topology, const Primitives& primitives) {
    const LeafVertices by_node = unique_leaf_vertices(topology, primitives);
    std::vector<std::uint32_t> offsets(topology.primitives.size() + 1, 0);
    for (std::uint32_t node = 0; node < topology.size(); ++node)
      if (const TopologyNode n = topology.nodes[node]; n.is_leaf())
        offsets[n.first() + 1] = std::uint32_t(by_node[node].size());
    for (std::size_t i = 1; i < offsets.size(); ++i) offsets[i] += offsets[i - 1];
    std::vector<std::uint32_t> vertices(offsets.back());
    for (std::uint32_t node = 0; node < topology.size(); ++node)
      if (const TopologyNode n = topology.nodes[node]; n.is_leaf())
        std::copy(by_node[node].begin(), by_node[node].end(), vertices.begin() + offsets[n.first()]);
    lists_ = ListPool(offsets, std::move(vertices));
  }

  std::span<const std::uint32_t> operator[](TopologyNode leaf) const { return lists_[leaf.first()]; }
  template <class S>
  Box<S> box(TopologyNode leaf, const S* positions) const {
    return LaneBox<S>::of((*this)[leaf], positions).box();
  }

  /// Makes the lists of leaves by vertex, unless they exist. O(nodes + vertices).
  void index(const Topology& topology, std::uint32_t vertex_count) {
    if (users_.keys() != 0) return;
    users_ = inverted(lists_, vertex_count);
    nodes_.assign(lists_.keys(), 0);
    for (std::uint32_t node = 0; node < topology.size(); ++node)
      if (const TopologyNode n = topology.nodes[node]; n.is_leaf() && n.count() > 0) nodes_[n.first()] = node;
  }
  /// Calls visit(node) for every leaf that has the vertex. Requires a call of `index`.
  template <class Visit>
  void for_leaves_of(std::uint32_t vertex, Visit&& visit) const {
    if (vertex >= users_.keys()) return;  // a new vertex, in no primitive yet
    for (std::uint32_t entry : users_[vertex]) visit(nodes_[entry]);
  }

  /// Records that a leaf's content is stored at `node` now.
  void placed(TopologyNode leaf, std::uint32_t node) {
    if (!nodes_.empty() && leaf.is_leaf() && leaf.count() > 0) nodes_[leaf.first()] = node;
  }
  /// Sets the vertices of a leaf at `node`. `vertices` must be ascending, unique and below vertex_count.
  /// O(length of the list).
  void assign(TopologyNode leaf, std::uint32_t node, std::span<const std::uint32_t> vertices,
              std::uint32_t vertex_count) {
    if (lists_.keys() <= leaf.first()) lists_.resize(leaf.first() + leaf.count());
    drop(leaf);
    lists_.assign(leaf.first(), vertices);
    if (users_.keys() == 0) return;
    if (nodes_.size() < lists_.keys()) nodes_.resize(lists_.keys(), 0);
    users_.resize(std::max(users_.keys(), vertex_count));
    for (std::uint32_t v : vertices) users_.push(v, leaf.first());
    nodes_[leaf.first()] = node;
  }
  /// Removes the list of a leaf.
  void drop(TopologyNode leaf) {
    if (users_.keys() != 0)
      for (std::uint32_t v : lists_[leaf.first()]) users_.erase(v, leaf.first());
    lists_.clear(leaf.first());
  }

  std::size_t bytes() const {
    return lists_.bytes() + users_.bytes() + nodes_.size() * sizeof(std::uint32_t);
  }

 private:
  ListPool lists_;                    ///< by the leaf's first entry in the topology's primitives
  ListPool users_;                    ///< by vertex: first entries of leaves; empty before `index`
  std::vector<std::uint32_t> nodes_;  ///< by first entry: the leaf's node; empty before `index`
};

}  // namespace kbvh
