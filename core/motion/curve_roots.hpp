#pragma once
#include <cstdint>

#include "core/motion/curved_piece.hpp"
#include "core/motion/exact_piece.hpp"

namespace kbvh {

// Exact predicates on curved flight plans (truth A): the roots of the difference of two pieces of one
// segment, their order, and signs at them. A filter in double with a proven bound decides nearly always;
// Sturm sequences on big integers decide the rest (algebraic_time.hpp). Admissible numbers are those of
// round_positions.hpp, times are finite. Two pieces that are compared have the same t0 and t1. No function
// allocates before big integers.

/// Counts searches for roots, and what the filter left to big integers. Calls add to it.
struct CurveStats {
  std::uint64_t searches = 0, exact = 0;
};

/// A root of the difference of two pieces. Times are in s, the share of the segment.
struct CurveRoot {
  double begin = 0, end = 0;  ///< the root lies in [begin, end]; equal only if it is this number
  int after = 0;              ///< the sign of the difference right after the root
  /// Whether [begin, end] contains no other root, and no root at an end unless the ends are equal. Otherwise
  /// only big integers tell the roots apart.
  bool isolated = false;
};

/// The distinct roots of a difference in 0 <= s < 1, ascending.
struct SegmentRoots {
  int count = 0;
  bool equal = false;  ///< the difference is zero throughout; it then has no roots
  CurveRoot roots[3];
};

/// Returns the roots of a - b. Exchanging a and b gives the same roots with the opposite signs. About 40 ns
/// without a root, 150 ns with one.
template <class S>
SegmentRoots segment_roots(const CurvedPiece<S>& a, const CurvedPiece<S>& b, CurveStats* stats = nullptr);

/// An exact time: root number `root` of first - second.
template <class S>
struct CurveMoment {
  CurvedPiece<S> first, second;
  std::uint32_t root = 0;

  bool operator==(const CurveMoment&) const = default;
};

/// Approximates the time of a root with a guaranteed error bound, in seconds: 0 where the segment begins.
template <class S>
TimeEstimate moment_estimate(const CurvedPiece<S>& piece, const CurveRoot& root);

/// Returns the sign of a(t) - b(t), t0 <= t <= t1.
template <class S>
int compare_at(const CurvedPiece<S>& a, const CurvedPiece<S>& b, double t);

/// Returns the sign of x - y. The segments may differ. Roots at the beginning of a segment, where many curves
/// may start together, need no big integers.
template <class S>
int compare_moments(const CurveMoment<S>& x, const CurveMoment<S>& y, CurveStats* stats = nullptr);

/// Return the sign of x - t, and of x minus the time of a crossing of linear pieces.
template <class S>
int compare_moment_to(const CurveMoment<S>& x, double t);
template <class S>
int compare_moment_to(const CurveMoment<S>& x, const Crossing<S>& crossing);

/// Returns the sign of a - b at a moment of the same segment.
template <class S>
int compare_at_moment(const CurvedPiece<S>& a, const CurvedPiece<S>& b, const CurveMoment<S>& moment);

/// Returns the sign of a - b right after a moment of the same segment; 0 only if the difference is zero
/// throughout.
template <class S>
int compare_after_moment(const CurvedPiece<S>& a, const CurvedPiece<S>& b, const CurveMoment<S>& moment);

}  // namespace kbvh
