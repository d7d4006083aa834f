#pragma once
#include <cstdint>
#include <vector>

#include "core/families/volumes/volume_hierarchy.hpp"
#include "core/families/wide/kernels/wide_overlap.hpp"
#include "core/families/wide/wide_tree.hpp"

namespace kbvh {

/// One body's tree in wide nodes of up to eight children, for volumes whose numbers lie in rows of eight
/// lanes per node. Stores no volumes, only nodes, the points of leaves in lists (as in wide_layout.hpp, for
/// width 8), the points below each node in one row, and the primitives of leaves with their boxes.
///
/// A point is a vertex; if leaves must cover the boxes of primitives (Cover::boxes), it is a corner of such a
/// box.
template <class S>
class LaneTree {
 public:
  static constexpr std::uint32_t lanes = 8;
  /// The points below a wide node, as a range of `points`.
  struct Range {
    std::uint32_t begin, end;
  };

  /// Takes a topology of width 8 over primitives that must outlive this object. Throws std::length_error
  /// beyond 2^28 nodes, 65,535 points in a leaf, or 2^32 entries of lists.
  void assign(Topology topology, const Primitives& primitives, Cover cover);
  /// Returns the array [point][3] to which lists refer, from positions [vertex][3] readable up to one scalar
  /// past the end. Places corners of boxes, and invalidates the boxes of primitives.
  const S* place(const S* positions);

  const Topology& topology() const { return topology_; }
  const Primitives& primitives() const { return *primitives_; }
  Cover cover() const { return cover_; }
  bool empty() const { return nodes_.empty(); }
  std::uint32_t node_count() const { return std::uint32_t(nodes_.size()); }
  const WideNode* nodes() const { return nodes_.data(); }
  /// [list][length][8]: points of leaves, times 3; lanes that are no leaves repeat a point.
  const std::uint32_t* lists() const { return lists_.data(); }
  /// The largest length of a list.
  std::uint32_t longest_list() const { return longest_list_; }
  /// Points, times 3: those of each node lie in one row. A node whose children are all leaves lists each
  /// point once. The last point is repeated up to a multiple of eight.
  const AlignedArray<std::uint32_t>& points() const { return points_; }
  const std::vector<Range>& ranges() const { return ranges_; }

  static constexpr std::uint32_t none = ~std::uint32_t(0);
  /// Returns the wide node of an inner node of the topology; for a leaf `none`.
  std::uint32_t wide_node(std::uint32_t node) const { return wide_[node]; }
  /// Returns the slot that holds a node of the topology as a child; a root that is not a leaf has none.
  LeafSlot slot(std::uint32_t node) const { return {slots_[node]}; }
  std::size_t leaf_point_count() const { return listed_; }

  /// The numbers of a leaf's rows: the boxes of its primitives as in WideLeaves, and then their common box in
  /// the same order of sides.
  static constexpr std::size_t row_scalars(std::size_t padded) { return 6 * padded + 8; }
  std::uint32_t padded_leaf_size() const {
    return topology_.leaf_size <= 4 ? 4 : topology_.leaf_size <= 8 ? 8 : 16;
  }
  /// Returns the data of the leaves that a query reads; `placed` is the result of `place`.
  WideLeaves<S> leaves(const S* placed) {
    return {{first_entry_.data(), first_entry_.data() + 1, first_corner_.data(), corners_.data(),
             topology_order_.data()},
            rows_.data(),
            stamps_.data(),
            stamp_,
            placed};
  }
  std::size_t bytes() const;

 private:
  void place_nodes();
  void list_points(const LeafVertices& of_leaves);
  void list_ranges(const LeafVertices& of_leaves);
  void list_leaves();

  Topology topology_;
  const Primitives* primitives_ = nullptr;
  Cover cover_ = Cover::vertices;
  AlignedArray<WideNode> nodes_;
  std::vector<std::uint32_t> wide_, slots_;  ///< [node of the topology]
  std::vector<std::uint32_t> leaf_of_;       ///< [leaf]: node of the topology
  AlignedArray<std::uint32_t> lists_, points_;
  std::vector<Range> ranges_;
  std::uint32_t longest_list_ = 0;
  std::size_t listed_ = 0;
  std::vector<std::uint32_t> first_entry_, first_corner_, corners_, topology_order_, stamps_;
  AlignedArray<S> rows_;
  std::uint32_t stamp_ = 1;
  std::vector<S> placed_;  ///< [primitive][8][3], if boxes are covered
};

extern template class LaneTree<float>;
extern template class LaneTree<double>;

}  // namespace kbvh
