#pragma once
#include <algorithm>
#include <cstdint>
#include <vector>

#include "core/families/wide/wide_hierarchy.hpp"

namespace kbvh {

/// Returns half the surface of each child's box of a wide node, summed.
template <class S>
inline double children_surface(const WideArrays<S>& arrays, std::uint32_t width, std::uint32_t node) {
  const S* const rows = arrays.child_bounds + node * lane_scalars(width);
  double sum = 0;
  for (std::uint32_t lane = 0; lane < arrays.nodes[node].count; ++lane) {
    double side[3];
    for (std::uint32_t axis = 0; axis < 3; ++axis)
      side[axis] = -double(rows[axis * width + lane]) - double(rows[(axis + 3) * width + lane]);
    sum += side[0] * side[1] + side[1] * side[2] + side[2] * side[0];
  }
  return sum;
}

/// Returns half the surface of a wide node's own box.
template <class S>
inline double own_surface(const WideArrays<S>& arrays, std::uint32_t node) {
  const S* const own = arrays.node_bounds + std::size_t(8) * node;
  double side[3];
  for (int axis = 0; axis < 3; ++axis) side[axis] = double(own[axis + 4]) - double(own[axis]);
  return side[0] * side[1] + side[1] * side[2] + side[2] * side[0];
}

/// Returns the quality of a refitted, unedited hierarchy: the summed surface of all boxes below the root,
/// divided by that of the root. This is the part of the surface-area heuristic that depends on the boxes. 0
/// for a root without surface. O(nodes).
template <class S>
double surface_ratio(WideHierarchy<S>& hierarchy) {
  if (hierarchy.empty()) return 0;
  const WideArrays<S> arrays = hierarchy.arrays();
  const std::uint32_t width = hierarchy.topology().width;
  double sum = 0;
  for (std::uint32_t node = 0; node < hierarchy.node_count(); ++node)
    sum += children_surface(arrays, width, node);
  const double root = own_surface(arrays, 0);
  return root > 0 ? sum / root : 0;
}

}  // namespace kbvh
