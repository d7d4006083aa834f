#pragma once
#include <algorithm>
#include <cstdint>
#include <limits>

#include "core/scene/motion_view.hpp"

namespace kbvh {

/// The time from `begin` to `end` for which linear bounds are built at once.
struct SegmentInterval {
  double begin = 0, end = 0;
  double knot = 0;       ///< end of the flight plans' segment, of which the interval may be a piece
  bool endless = false;  ///< no plan ends: the length is an estimate, and the interval is not cut into pieces
};

/// Returns the interval that contains t, in which every vertex of all `bodies` bodies moves on one line: the
/// intersection of their segments, cut into `pieces` pieces of equal length. If no plan ends, the interval
/// lasts for `endless_duration` seconds from t on.
template <class S>
SegmentInterval segment_interval(const SegmentMotion<S>& motion, std::uint32_t bodies, double t,
                                 std::uint32_t pieces, double endless_duration) {
  constexpr double infinity = std::numeric_limits<double>::infinity();
  double begin = -infinity, end = infinity;
  bool rest = true;
  for (std::uint32_t body = 0; body < bodies; ++body) {
    begin = std::max(begin, motion.lines_begin(body));
    end = std::min(end, motion.lines_end(body));
    rest = rest && motion.at_rest(body);
  }
  if (rest || begin == -infinity) begin = t;
  if (!rest && end == infinity) {
    const double until = t + endless_duration;
    return {std::max(begin, t), until, until, true};
  }
  if (pieces == 1 || rest) return {begin, end, end, false};
  const auto cut = [&](std::uint32_t k) {
    return k == pieces ? end : begin + (end - begin) * (double(k) / double(pieces));
  };
  std::uint32_t k = 0;
  while (k + 1 < pieces && t >= cut(k + 1)) ++k;
  // A segment may be so short that there are not enough doubles between its ends.
  if (!(cut(k) < cut(k + 1))) return {begin, end, end, false};
  return {cut(k), cut(k + 1), end, false};
}

}  // namespace kbvh
