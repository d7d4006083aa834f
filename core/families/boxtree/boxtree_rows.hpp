#pragma once
#include <algorithm>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "core/families/boxtree/boxtree_bounds.hpp"
#include "core/families/wide/wide_hierarchy.hpp"

namespace kbvh {

/// The boxes of a kinetic BoxTree of one body, made when a query asks for them, in the rows of a wide
/// hierarchy, so that the query runs on the kernels of stored boxes. Wide nodes are parts of the binary tree:
/// the box of a child is that of the wide node with the sides that the few binary nodes between own, each
/// read once. With LeafBoxes::tight boxes of leaves are made of their vertices.
///
/// A wide node's rows are made from those of its parent, which must be current. Call by call, a coordinate
/// costs several times as much as one of many: nodes that the last queries came to are made together.
template <class S>
class BoxTreeRows {
 public:
  /// Children of a wide node, at most.
  static constexpr std::uint32_t width = 8;

  /// Forgets what was made, and learnt from queries: a clip that is played again costs the same again.
  void start_over() {
    std::fill(stale_.begin(), stale_.end(), std::uint8_t(1));
    visited_.clear();
    frames_ = 0;
    wake();
  }
  /// Lays everything out for the tree as it is now, unless it has not changed since the last time. O(nodes).
  void follow(const BoxTreeBounds& tree, const Primitives& primitives, LeafBoxes leaf_boxes);

  WideHierarchy<S>& hierarchy() { return hierarchy_; }
  const WideHierarchy<S>& hierarchy() const { return hierarchy_; }
  /// By wide node: not 0 while its children's boxes are to be made.
  const std::uint8_t* stale() const { return stale_.data(); }

  /// The present time is another, or realisers are: nothing of what was made holds. Bodies that rest from one
  /// time to the next keep what they have.
  void new_frame(const SegmentMotion<S>& motion, std::uint32_t body);
  /// The body does not rest any more: plans of its vertices have changed.
  void wake() { rests_until_ = -std::numeric_limits<double>::infinity(); }

  /// Makes the boxes of the root's children and of those nodes that the last queries came to. Returns how
  /// many positions were read.
  std::uint64_t make_visited(const BoxTreeBounds& tree, const SegmentMotion<S>& motion, std::uint32_t body);
  /// Makes the boxes of a wide node's children, and remembers it.
  std::uint64_t make_wanted(std::uint32_t node, const BoxTreeBounds& tree, const SegmentMotion<S>& motion,
                            std::uint32_t body) {
    visited_.push_back(node);
    return make({&visited_.back(), 1}, tree, motion, body);
  }

  /// The box of a node of the binary tree if a query may have read it: a child of a wide node whose rows are
  /// current.
  const Box<S>* read_box(std::uint32_t node, Box<S>& room) const;

  std::size_t bytes() const;

 private:
  /// One side of the binary tree, as a wide node reads it.
  struct Plane {
    std::uint32_t place;  ///< of the bound
    std::uint32_t side;
  };
  static constexpr std::uint32_t visits_kept = 16;  ///< frames; then they are learnt anew
  static constexpr std::size_t made_together = 16;  ///< nodes
  static constexpr std::size_t most_planes = 2 * (width - 1) + 6;
  static constexpr std::uint32_t rows = 6;

  void lay_out(const BoxTreeBounds& tree, const Primitives& primitives, LeafBoxes leaf_boxes);
  void list_planes(const BoxTreeBounds& tree, std::span<const std::uint32_t> node_of);
  std::uint64_t make(std::span<const std::uint32_t> nodes, const BoxTreeBounds& tree,
                     const SegmentMotion<S>& motion, std::uint32_t body);
  std::uint64_t read_planes(std::span<const std::uint32_t> nodes, const BoxTreeBounds& tree,
                            const SegmentMotion<S>& motion, std::uint32_t body, S* values);
  void write_rows(std::uint32_t node, const S* values);

  WideHierarchy<S> hierarchy_;
  LeafBoxes leaf_boxes_ = LeafBoxes::tight;
  std::uint32_t version_ = 0;           ///< of the tree
  std::vector<std::uint32_t> wide_of_;  ///< by node of the binary tree: that of the wide topology, or none
  std::vector<std::uint32_t> first_plane_;  ///< by wide node, and the end
  std::vector<Plane> planes_;
  std::vector<std::uint8_t> sources_;        ///< [wide node][6][width]: entries of a node's table
  std::vector<std::uint32_t> first_vertex_;  ///< by wide node, and the end
  std::vector<std::uint32_t> vertices_;      ///< of a wide node's leaves, each once
  std::vector<std::uint32_t> parent_row_;    ///< by wide node: where its box begins in the parent's rows
  std::vector<std::uint8_t> stale_;
  std::vector<std::uint32_t> visited_;  ///< nodes whose rows were made since it was emptied, parents first
  std::vector<std::uint32_t> fetched_;
  std::uint32_t frames_ = 0;  ///< since then
  double rests_until_ = -std::numeric_limits<double>::infinity();
  // Stored positions between which the vertices move, or null.
  const S* line_ends_[2] = {nullptr, nullptr};
  double line_times_[2] = {0, 0};
};

extern template class BoxTreeRows<float>;
extern template class BoxTreeRows<double>;

}  // namespace kbvh
