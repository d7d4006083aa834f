#pragma once
#include <algorithm>
#include <boost/align/aligned_allocator.hpp>
#include <cstdint>
#include <span>
#include <vector>

#include "core/base/unfilled_array.hpp"
#include "core/families/wide/kernels/wide_overlap.hpp"
#include "core/geometry/box.hpp"
#include "core/kernels/kernel_set.hpp"
#include "core/scene/scene.hpp"

namespace kbvh {

/// An array that starts on a cache line.
template <class T>
using AlignedArray = std::vector<T, boost::alignment::aligned_allocator<T, 64>>;

/// The part of a wide hierarchy that queries read: nodes, boxes, and the primitives of leaves with their
/// boxes. Derived classes fill it in: WideHierarchy from a topology, others without one.
template <class S>
class WideTree {
 public:
  std::uint32_t width() const { return width_; }
  /// Returns the largest number of primitives of a leaf.
  std::uint32_t leaf_size() const { return leaf_size_; }
  bool empty() const { return nodes_.empty(); }
  KernelSet kernels() const { return kernels_; }
  /// Returns the box of the root; not for empty trees.
  Box<S> root_box() const {
    Box<S> box;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      box.lower[axis] = node_bounds_[axis];
      box.upper[axis] = node_bounds_[axis + 4];
    }
    return box;
  }

  /// Invalidates the boxes of primitives, because positions changed; queries recompute them on demand.
  void positions_changed() {
    if (++stamp_ == 0) {
      std::fill(stamps_.begin(), stamps_.end(), 0);
      std::fill(fetched_.begin(), fetched_.end(), 0);
      stamp_ = 1;
    }
  }

  WideArrays<S> arrays() {
    return {nodes_.data(), child_bounds_.data(), node_bounds_.data(), vertices_.data()};
  }
  WideLeaves<S> leaves(const S* positions) {
    return {leaf_lists(), rows_.data(), stamps_.data(), stamp_, positions};
  }
  WideLeafLists leaf_lists() const {
    return {first_entry_.data(), end_entries(), first_corner_.data(), corners_.data(), primitives_.data()};
  }
  /// Returns the corners of the leaves' entries, [entry][3], times 3, if they are listed and all primitives
  /// are triangles; else null.
  const std::uint32_t* triangle_corners() const { return only_triangles_ ? corners_.data() : nullptr; }
  std::uint32_t leaf_count() const { return std::uint32_t(stamps_.size()); }
  /// Returns true at the first call since `positions_changed` for a leaf, numbered as by
  /// `WideNode::first_leaf`.
  bool to_be_fetched(std::uint32_t leaf) {
    const bool first = fetched_[leaf] != stamp_;
    fetched_[leaf] = stamp_;
    return first;
  }
  std::uint32_t leaf_number(LeafSlot slot) const { return nodes_[slot.node()].first_leaf + slot.lane(); }
  std::span<const std::uint32_t> leaf_primitives(std::uint32_t leaf) const {
    return {primitives_.data() + first_entry_[leaf], primitives_.data() + end_entries()[leaf]};
  }
  /// Returns the number of lanes for the primitives of a leaf in a query; 1: the leaf's box is that of its
  /// only primitive.
  std::uint32_t padded_leaf_size() const {
    return leaf_size_ == 1 ? 1 : leaf_size_ <= 4 ? 4 : leaf_size_ <= 8 ? 8 : 16;
  }
  /// Returns whether one query can process both hierarchies.
  bool suits(const WideTree& other) const {
    return empty() || other.empty() ||
           (width_ == other.width_ && padded_leaf_size() == other.padded_leaf_size());
  }

 protected:
  /// Returns the memory of this part in bytes.
  std::size_t tree_bytes() const {
    return nodes_.capacity() * sizeof(WideNode) +
           (child_bounds_.capacity() + node_bounds_.capacity() + rows_.capacity()) * sizeof(S) +
           (vertices_.capacity() + first_entry_.capacity() + end_entry_.capacity() +
            first_corner_.capacity() + corners_.capacity() + primitives_.capacity() + stamps_.capacity() +
            fetched_.capacity()) *
               sizeof(std::uint32_t);
  }
  /// Lists the corners of the leaves' entries, in their order.
  void list_corners(const Primitives& primitives) {
    first_corner_.assign(1, 0);
    corners_.clear();
    only_triangles_ = true;
    for (const std::uint32_t primitive : primitives_) {
      const std::span<const std::uint32_t> vertices = primitives[primitive];
      only_triangles_ = only_triangles_ && vertices.size() == 3;
      for (const std::uint32_t vertex : vertices) corners_.push_back(3 * vertex);
      first_corner_.push_back(std::uint32_t(corners_.size()));
    }
  }
  const std::uint32_t* end_entries() const {
    if (!end_entry_.empty()) return end_entry_.data();
    return first_entry_.empty() ? nullptr : first_entry_.data() + 1;
  }

  std::uint32_t width_ = 2, leaf_size_ = 1;
  KernelSet kernels_ = KernelSet::portable;
  AlignedArray<WideNode> nodes_;
  UnfilledArray<S> child_bounds_, node_bounds_;
  UnfilledArray<std::uint32_t> vertices_;
  std::vector<std::uint32_t> first_entry_;
  std::vector<std::uint32_t> end_entry_;  ///< empty: each leaf ends where the next one begins
  std::vector<std::uint32_t> first_corner_, corners_, primitives_, stamps_, fetched_;
  UnfilledArray<S> rows_;  ///< of a leaf: set when its stamp is
  std::uint32_t stamp_ = 1;
  bool only_triangles_ = false;  ///< true if corners are listed, too
};

}  // namespace kbvh
