#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "core/families/boxtree/boxtree_bounds.hpp"
#include "core/families/wide/rows_on_demand.hpp"
#include "core/scene/motion_view.hpp"

namespace kbvh {

/// The boxes of a kinetic BoxTree of one body, in the rows of a wide hierarchy, computed on demand. A wide
/// node is a part of the binary tree: the box of its child is the wide node's box with the own sides of the
/// few binary nodes in between, each read once. With LeafBoxes::tight the boxes of leaves are computed from
/// their vertices. A wide node's rows are computed from its parent's rows, which must be current.
template <class S>
class BoxTreeRows : public RowsOnDemand<S> {
 public:
  /// Maximum number of children of a wide node.
  static constexpr std::uint32_t width = 8;

  /// Lays out the rows for the current tree. Does nothing if the tree has not changed since the last call.
  /// O(nodes).
  void follow(const BoxTreeBounds& tree, const Primitives& primitives, LeafBoxes leaf_boxes);

  /// Computes the boxes of the root's children and of the children of the nodes that recent queries visited.
  /// Returns the number of positions read.
  std::uint64_t make_visited(const BoxTreeBounds& tree, const SegmentMotion<S>& motion, std::uint32_t body);
  /// Computes the boxes of a wide node's children, and records the visit. Returns the number of positions
  /// read.
  std::uint64_t make_wanted(std::uint32_t node, const BoxTreeBounds& tree, const SegmentMotion<S>& motion,
                            std::uint32_t body) {
    return make(this->visit(node), tree, motion, body);
  }

  /// Returns the box of a node of the binary tree, stored in `room`, if a query may have read it: the node is
  /// a child of a wide node with current rows. Returns null otherwise.
  const Box<S>* read_box(std::uint32_t node, Box<S>& room) const;

  std::size_t bytes() const;

 private:
  /// One side of the binary tree that a wide node reads.
  struct Plane {
    std::uint32_t place;  ///< place of the bound
    std::uint32_t side;
  };
  using RowsOnDemand<S>::made_together;
  static constexpr std::size_t most_planes = 2 * (width - 1) + 6;
  static constexpr std::uint32_t rows = 6;

  void lay_out(const BoxTreeBounds& tree, const Primitives& primitives, LeafBoxes leaf_boxes);
  void list_planes(const BoxTreeBounds& tree, std::span<const std::uint32_t> node_of);
  std::uint64_t make(std::span<const std::uint32_t> nodes, const BoxTreeBounds& tree,
                     const SegmentMotion<S>& motion, std::uint32_t body);
  std::uint64_t read_planes(std::span<const std::uint32_t> nodes, const BoxTreeBounds& tree,
                            const SegmentMotion<S>& motion, std::uint32_t body, S* values);
  void write_rows(std::uint32_t node, const S* values);

  LeafBoxes leaf_boxes_ = LeafBoxes::tight;
  std::uint32_t version_ = 0;           ///< version of the tree
  std::vector<std::uint32_t> wide_of_;  ///< by node of the binary tree: node of the wide topology, or none
  std::vector<std::uint32_t> first_plane_;  ///< by wide node, plus the end
  std::vector<Plane> planes_;
  std::vector<std::uint8_t> sources_;        ///< [wide node][6][width]: indices of a node's table
  std::vector<std::uint32_t> first_vertex_;  ///< by wide node, plus the end
  std::vector<std::uint32_t> vertices_;      ///< unique vertices of each wide node's leaves
  std::vector<std::uint32_t> parent_row_;    ///< by wide node: offset of its box in the parent's rows
  std::vector<std::uint32_t> fetched_;
};

extern template class BoxTreeRows<float>;
extern template class BoxTreeRows<double>;

}  // namespace kbvh
