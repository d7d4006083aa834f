#pragma once
#include <algorithm>
#include <cmath>

#include "core/families/linear/linear_segment.hpp"
#include "core/motion/admissible.hpp"

namespace kbvh {

/// Returns a box that contains a body throughout the segment.
template <class S>
Box<S> swept(const BodySegmentBounds<S>& side) {
  Box<S> box;
  for (const EndpointBounds<S>& end : side.at)
    for (int axis = 0; axis < 3; ++axis) {
      box.lower[axis] = std::min(box.lower[axis], side.widened_down(end.node_bounds[axis]));
      box.upper[axis] = std::max(box.upper[axis], side.widened_up(end.node_bounds[axis + 4]));
    }
  return box;
}

/// Tests whether the body stays near the admissible range until this end. Beyond it differences of boxes
/// could overflow.
template <class S>
bool admissible_root(const EndpointBounds<S>& end) {
  const auto near = [](S x) { return std::abs(x) <= 2 * admissible_reach<S>; };
  return std::all_of(end.node_bounds, end.node_bounds + 3, near) &&
         std::all_of(end.node_bounds + 4, end.node_bounds + 7, near);
}

}  // namespace kbvh
