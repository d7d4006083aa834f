#pragma once
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/families/linear/linear_segment.hpp"
#include "core/motion/flight_plans.hpp"

namespace kbvh {

/// Returns the largest coordinate of the root's box.
template <class S>
S largest_coordinate(const EndpointBounds<S>& end) {
  S largest = 0;
  for (std::size_t i = 0; i < 8; ++i)
    if (i % 4 != 3) largest = std::max(largest, std::abs(end.node_bounds[i]));
  return largest;
}

/// Boxes at the end of a segment over which a body translates, from those at its start: all of them, or only
/// the root's. They contain the same vertices and exceed tight boxes by rounding only.
template <class S>
struct TranslatedBoxes {
  S lower[3], upper[3];  ///< the added vectors
  S excess;              ///< of the result

  TranslatedBoxes(const EndpointBounds<S>& from, const Translation<S>& step) : excess(from.excess) {
    S largest = largest_coordinate(from);
    for (std::size_t axis = 0; axis < 3; ++axis)
      largest += std::max(std::abs(step.lower[axis]), std::abs(step.upper[axis]));
    // More than the rounding of two additions.
    const bool exact = step.exact && from.excess == 0;
    const S rounding = exact ? S(0) : std::numeric_limits<S>::epsilon() * largest;
    S width = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      lower[axis] = step.lower[axis] - rounding;
      upper[axis] = step.upper[axis] + rounding;
      width = std::max(width, upper[axis] - lower[axis]);
    }
    excess += width + rounding;
  }
  void move(const S* from_lanes, const S* from_own, std::size_t width, std::size_t nodes, S* child_bounds,
            S* node_bounds) const {
    for (std::size_t node = 0; node < nodes; ++node)
      for (std::size_t row = 0; row < 6; ++row) {
        const S by = row < 3 ? lower[row] : -upper[row - 3];  // rows have -upper
        const std::size_t first = node * lane_scalars(std::uint32_t(width)) + row * width;
        for (std::size_t i = first; i < first + width; ++i) child_bounds[i] = from_lanes[i] + by;
      }
    for (std::size_t node = 0; node < nodes; ++node) move_own(from_own + 8 * node, node_bounds + 8 * node);
  }
  void move_own(const S* from, S* to) const {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      to[axis] = from[axis] + lower[axis];
      to[axis + 4] = from[axis + 4] + upper[axis];
    }
  }
};

}  // namespace kbvh
