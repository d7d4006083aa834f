#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "core/geometry/box.hpp"
#include "core/topology/topology.hpp"

namespace kbvh {

/// A primitive while a tree is built over it.
struct BuildItem {
  std::array<double, 3> centroid;  ///< of its box
  std::uint32_t primitive;
};

template <class S>
BuildItem build_item(const Box<S>& box, std::uint32_t primitive) {
  BuildItem item{{}, primitive};
  for (std::size_t axis = 0; axis < 3; ++axis)
    item.centroid[axis] = 0.5 * double(box.lower[axis]) + 0.5 * double(box.upper[axis]);
  return item;
}

/// The smallest and the largest centroid of some items, per axis.
struct CentroidBounds {
  std::array<double, 3> lower, upper;
  explicit CentroidBounds(std::span<const BuildItem> items);
};

/// Moves the items with the smallest centroids along the longest axis of their bounds before `middle`. Equal
/// centroids are ordered by primitive, so both sides are unique as sets. O(items).
void split_at_median(std::span<BuildItem> items, std::size_t middle);

/// Sorts items into the leaves of a tree that the median builder made of as many primitives; its shape
/// depends on their number only. Afterwards items[i].primitive is entry i of the tree that the builder would
/// make of these items. Allocates nothing. O(n log n).
void sort_by_medians(const Topology& topology, std::span<BuildItem> items);

}  // namespace kbvh
