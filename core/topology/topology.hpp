#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "core/scene/scene.hpp"

namespace kbvh {

/// A node of a topology: one packed word without bounds. The children of an inner node, and the primitives of
/// a leaf, are contiguous.
class TopologyNode {
 public:
  /// Makes an inner node with the children [first, first + count).
  static TopologyNode inner(std::uint32_t first, std::uint32_t count) { return {first, count}; }
  /// Makes a leaf with the entries [first, first + count) of the topology's `primitives`.
  static TopologyNode leaf(std::uint32_t first, std::uint32_t count) { return {first, count | leaf_bit}; }
  TopologyNode() = default;

  bool is_leaf() const { return (word_ & leaf_bit) != 0; }
  std::uint32_t first() const { return first_; }
  std::uint32_t count() const { return word_ & ~leaf_bit; }
  bool operator==(const TopologyNode&) const = default;

 private:
  TopologyNode(std::uint32_t first, std::uint32_t word) : first_(first), word_(word) {}
  static constexpr std::uint32_t leaf_bit = 1u << 31;
  std::uint32_t first_ = 0;
  std::uint32_t word_ = leaf_bit;
};
static_assert(sizeof(TopologyNode) == 8);

/// The combinatorial part of a hierarchy over one body. Node 0 is the root; parents come before their
/// children, so a reverse sweep over `nodes` is bottom-up. A body without primitives has no nodes.
struct Topology {
  std::uint32_t width = 2;      ///< maximum number of children of a node: 2, 4 or 8
  std::uint32_t leaf_size = 1;  ///< maximum number of primitives of a leaf: 1..16
  std::vector<TopologyNode> nodes;
  std::vector<std::uint32_t> parents;     ///< of each node; the root is its own parent
  std::vector<std::uint8_t> depths;       ///< of each node, saturated at 255; the root has 0
  std::vector<std::uint32_t> primitives;  ///< primitive ids in leaf order
  /// All leaves lie at one depth and every inner node but the root has `width` children: positions of
  /// children are then implicit.
  bool perfect = false;

  std::uint32_t size() const { return std::uint32_t(nodes.size()); }
  bool empty() const { return nodes.empty(); }
  bool operator==(const Topology&) const = default;
  std::size_t bytes() const {
    return nodes.capacity() * sizeof(TopologyNode) + depths.capacity() +
           (parents.capacity() + primitives.capacity()) * sizeof(std::uint32_t);
  }
};

/// Sets the depths of all nodes below one from its depth. `open` is for temporary use. O(nodes below).
void set_depths_below(Topology& topology, std::uint32_t node, std::vector<std::uint32_t>& open);

/// The unique vertices of every leaf, ascending, as CSR lists indexed by node (inner nodes have none).
struct LeafVertices {
  std::vector<std::uint32_t> offsets;  ///< size nodes + 1
  std::vector<std::uint32_t> vertices;
  std::span<const std::uint32_t> operator[](std::uint32_t node) const {
    return {vertices.data() + offsets[node], vertices.data() + offsets[node + 1]};
  }
};
LeafVertices unique_leaf_vertices(const Topology& topology, const Primitives& primitives);

/// Checks the combinatorial invariants against the primitive count: every node but the root has exactly one
/// parent, every primitive lies in exactly one leaf, counts respect width and leaf size, parents precede
/// children, `parents`, `depths` and `perfect` are correct. Returns an empty text, or the first violation.
std::string check_topology(const Topology& topology, std::uint32_t primitive_count);
/// Checks the same, with exactly the living primitives in leaves.
std::string check_topology(const Topology& topology, const Primitives& primitives);

}  // namespace kbvh
