#pragma once
#include <limits>

#include "core/families/wide/wide_hierarchy.hpp"

namespace kbvh {

/// Rows of all nodes of one body: ranges of a field of vectors below each child.
template <class S>
struct FieldRows {
  AlignedArray<S> child_bounds, node_bounds;  ///< as in WideArrays

  /// Computes the ranges of `field`, [vertex][3] and one scalar of padding: a refit with the field as
  /// positions. The hierarchy must not be empty.
  void fit(const WideHierarchy<S>& hierarchy, const S* field) {
    child_bounds.assign(std::size_t(hierarchy.node_count()) * lane_scalars(hierarchy.width()),
                        std::numeric_limits<S>::infinity());
    node_bounds.assign(std::size_t(8) * hierarchy.node_count(), 0);
    hierarchy.refit_into(child_bounds.data(), node_bounds.data(), field);
  }
  std::size_t bytes() const { return (child_bounds.capacity() + node_bounds.capacity()) * sizeof(S); }
};

}  // namespace kbvh
