#pragma once
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "core/geometry/box.hpp"
#include "core/scene/geometry_change.hpp"
#include "core/topology/topology.hpp"

namespace kbvh {

/// The effects of one edit on the nodes of a topology. Apply `moved` and `vacated` first, then `fresh` and
/// `changed`.
struct TopologyEdit {
  struct Move {
    std::uint32_t from, to;
  };
  std::vector<Move> moved;             ///< contents that lie under other ids now; all simultaneous
  std::vector<std::uint32_t> vacated;  ///< ids that lost their previous meaning
  std::vector<std::uint32_t> fresh;    ///< ids with new contents
  std::vector<std::uint32_t> changed;  ///< ids that stay, with other children or primitives

  void clear() {
    moved.clear();
    vacated.clear();
    fresh.clear();
    changed.clear();
  }
};

/// Inserts primitives into a topology and removes them, by local edits. A full leaf becomes the parent of
/// itself and a new leaf. When one of two sibling leaves has lost its last primitive, its sibling replaces
/// their parent. O(width + leaf size) per edit, after O(nodes) for the construction.
///
/// An edited topology no longer has the layout of a built one (`compacted` restores it): ids and entries may
/// be unused, parents may have larger ids than their children, and `depths` are only known to grow from
/// parent to child (saturated), which suffices for the order of events. Freed pairs of nodes are recycled, so
/// a binary topology never has more than twice as many nodes as it had leaves at one time. For wider nodes
/// and fuller leaves, the initial nodes and entries are not recycled.
class TopologyEditor {
 public:
  static constexpr std::uint32_t none = std::numeric_limits<std::uint32_t>::max();

  /// Makes an editor of this topology, whose primitives have ids below `primitive_ids`.
  TopologyEditor(const Topology& topology, std::uint32_t primitive_ids);

  /// Returns the leaf that holds a primitive.
  std::uint32_t leaf_of(std::uint32_t primitive) const { return leaf_of_[primitive]; }
  std::uint32_t leaf_count() const { return leaf_count_; }

  /// Adds a primitive at a leaf (any number if the topology is empty) and splits the leaf if it is full.
  /// Returns the leaf that holds the primitive. `edit` is cleared first and then lists the changes to the
  /// nodes.
  std::uint32_t insert(Topology& topology, std::uint32_t leaf, std::uint32_t primitive, TopologyEdit& edit);
  /// Removes a primitive from its leaf.
  void remove(Topology& topology, std::uint32_t primitive, TopologyEdit& edit);

  /// Returns the lowest node above a primitive that is unbalanced: one child has more than 1/sqrt(2) of its
  /// leaves. Returns `none` unless the primitive's leaf lies deeper than 2 log2(leaves), where such a node
  /// must exist (Galperin & Rivest 1993). Call it again after `rebalance`: removals may have left several
  /// such nodes. O(depth), and O(leaves below the result) if there is one.
  std::uint32_t unbalanced_above(const Topology& topology, std::uint32_t primitive) const;
  /// Replaces everything below an inner node by a balanced binary subtree over its leaves, by medians of
  /// their boxes' centres. `box_of(leaf)` returns a Box<double>. O(leaves log leaves).
  template <class BoxOf>
  void rebalance(Topology& topology, std::uint32_t node, TopologyEdit& edit, BoxOf&& box_of) {
    std::vector<PlacedLeaf> leaves;
    collect(topology, node, leaves);
    for (PlacedLeaf& leaf : leaves) {
      const Box<double> box = box_of(leaf.node);
      for (int axis = 0; axis < 3; ++axis) leaf.centre[axis] = 0.5 * box.lower[axis] + 0.5 * box.upper[axis];
    }
    rebuild(topology, node, leaves, edit);
  }

  /// Records that another function moved a leaf's content to this node.
  void placed(const Topology& topology, std::uint32_t leaf);

  std::size_t bytes() const {
    return (leaf_of_.capacity() + free_pairs_.capacity() + free_entries_.capacity()) * sizeof(std::uint32_t);
  }

 private:
  struct PlacedLeaf {
    std::uint32_t node;
    TopologyNode content;
    double centre[3] = {0, 0, 0};
  };
  std::uint32_t new_pair(Topology& topology);
  std::uint32_t new_entries(Topology& topology);
  void free_entries(const Topology& topology, std::uint32_t first);
  void move(Topology& topology, std::uint32_t from, std::uint32_t to);
  void take_out(Topology& topology, std::uint32_t node, TopologyEdit& edit);
  static void collect(const Topology& topology, std::uint32_t node, std::vector<PlacedLeaf>& leaves);
  void rebuild(Topology& topology, std::uint32_t node, std::span<PlacedLeaf> leaves, TopologyEdit& edit);
  void place(Topology& topology, std::uint32_t node, std::span<PlacedLeaf> leaves, TopologyEdit& edit);

  std::vector<std::uint32_t> leaf_of_;  ///< by primitive; `none` for those in no leaf
  std::uint32_t leaf_count_ = 0;
  std::uint32_t packed_entries_;             ///< entries as built; blocks of `leaf_size` follow
  std::vector<std::uint32_t> free_pairs_;    ///< first ids of pairs of nodes
  std::vector<std::uint32_t> free_entries_;  ///< first entries of blocks
};

/// Returns the leaf at which to insert a box: starts from the root and always takes the child whose surface
/// area grows least; among equals, the smaller one. `box_of(node)` returns the node's Box<S>. `none` for an
/// empty topology. O(depth x width).
template <class S, class BoxOf>
std::uint32_t leaf_for(const Topology& topology, const Box<S>& box, BoxOf&& box_of) {
  if (topology.empty()) return TopologyEditor::none;
  std::uint32_t node = 0;
  while (!topology.nodes[node].is_leaf()) {
    const TopologyNode parent = topology.nodes[node];
    double least_growth = 0, least_area = 0;
    for (std::uint32_t child = parent.first(); child < parent.first() + parent.count(); ++child) {
      Box<S> grown = box_of(child);
      const double area = surface_area(grown);
      grown.extend(box);
      const double growth = surface_area(grown) - area;
      if (child != parent.first() &&
          !(growth < least_growth || (growth == least_growth && area < least_area)))
        continue;
      node = child;
      least_growth = growth;
      least_area = area;
    }
  }
  return node;
}

/// Returns the correct value of `Topology::perfect` for a topology in built layout. O(nodes).
bool is_perfect(const Topology& topology);

/// Returns the same hierarchy in built layout: depth first, siblings in a row, no holes, exact depths.
/// order[i] is the previous id of node i.
Topology compacted(const Topology& topology, std::vector<std::uint32_t>& order);

/// Returns a built topology after a change of one body's geometry, edited locally and compacted: for
/// hierarchies that are laid out again in any case. `boxes` are those of its nodes, `positions` those of all
/// vertices, at the time of the change. O(nodes).
template <class S>
Topology edited_topology(Topology topology, std::vector<Box<S>> boxes, const BodyChange& change,
                         const Primitives& primitives, const S* positions);

}  // namespace kbvh
