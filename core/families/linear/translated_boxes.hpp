#pragma once
#include <algorithm>
#include <array>
#include <cmath>

#include "core/families/linear/linear_segment.hpp"
#include "core/motion/flight_plans.hpp"

namespace kbvh {

/// Computes the boxes at the end of a segment over which a body translates from those at its start: all of
/// them, or only the root's. They contain the same vertices and exceed tight boxes by rounding only.
///
/// Let s(x) be x plus the step, rounded, which grows with x. A vertex at P moves to s(P), up to an epsilon of
/// the larger magnitude (FlightPlans::translation): to s(P) - eps max(|P|, |s(P)|) or above, up to eps^2 of
/// it. For the lower side x of a box above the vertex, s(x) - eps max(|x|, |s(x)|) is no larger, again up to
/// eps^2 of it; one more rounding follows.
template <class S>
struct TranslatedBoxes {
  std::array<S, 3> step;
  S share;   ///< of a coordinate, by which a side moves outwards
  S excess;  ///< of the result

  TranslatedBoxes(const EndpointBounds<S>& from, const Translation<S>& by)
      : step(by.lower),
        share(by.exact && from.excess == 0 ? S(0) : 4 * unit_rounding<S>),
        excess(from.excess + 2 * share) {}
  void move(const S* from_lanes, const S* from_own, std::size_t width, std::size_t nodes, S* child_bounds,
            S* node_bounds) const {
    for (std::size_t node = 0; node < nodes; ++node)
      for (std::size_t row = 0; row < 6; ++row) {
        const S by = row < 3 ? step[row] : -step[row - 3];  // rows have -upper
        const std::size_t first = node * lane_scalars(std::uint32_t(width)) + row * width;
        for (std::size_t i = first; i < first + width; ++i) child_bounds[i] = moved_down(from_lanes[i], by);
      }
    for (std::size_t node = 0; node < nodes; ++node) move_own(from_own + 8 * node, node_bounds + 8 * node);
  }
  void move_own(const S* from, S* to) const {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      to[axis] = moved_down(from[axis], step[axis]);
      to[axis + 4] = -moved_down(-from[axis + 4], -step[axis]);
    }
  }

 private:
  S moved_down(S side, S by) const {
    const S sum = side + by, least = share == 0 ? S(0) : least_margin<S>;
    return sum - (share * std::max(std::abs(side), std::abs(sum)) + least);
  }
};

}  // namespace kbvh
