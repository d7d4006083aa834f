#pragma once
#include "core/motion/piece.hpp"

namespace kbvh {

// Exact predicates on truth A, the flight plan: they return signs of exact rational quantities, never of
// rounded ones. A filter in double decides nearly always. Error-free transforms decide ties of pieces in a
// common frame (same kind and t0, and for chords the same t1: vertices of one body). Big integers decide the
// rest. Pieces are treated as whole lines, also beyond their segment. Admissible numbers are those of
// round_positions.hpp; chords need t0 < t1, times are finite. O(1), no allocation before big integers.

/// Returns the sign (-1, 0, 1) of a(t) - b(t). About 10 ns.
template <class S>
int compare_at(const Piece<S>& a, const Piece<S>& b, double t);

/// Returns the sign of a' - b', the difference of slopes.
template <class S>
int compare_slopes(const Piece<S>& a, const Piece<S>& b);

/// The time at which `loser` meets `winner`: the root of loser(t) - winner(t). The slopes must differ; the
/// functions below throw std::invalid_argument if they find equal slopes. For the minimum side of a bound the
/// caller negates both pieces or exchanges them: the root is the same.
template <class S>
struct Crossing {
  Piece<S> winner, loser;

  bool operator==(const Crossing&) const = default;
};

/// A time with its error bound: |exact - time| <= error.
struct TimeEstimate {
  double time = 0;
  double error = 0;
};

/// Approximates the root in double with a guaranteed error bound, for sorting; ties within the errors need
/// compare_crossings. In a common frame the error is a few ulps of max(|t0|, |root|); it is infinite only for
/// a root beyond the range of double. Throws std::invalid_argument for parallel pieces.
template <class S>
TimeEstimate crossing_estimate(const Crossing<S>& crossing);

/// Returns the sign of root - t.
template <class S>
int compare_crossing_to(const Crossing<S>& crossing, double t);

/// Returns the sign of root(x) - root(y). Crossings of four pieces in one frame need no division and no hint.
template <class S>
int compare_crossings(const Crossing<S>& x, const Crossing<S>& y);

/// Returns the sign of a(r) - b(r) at the exact root r of `crossing`.
template <class S>
int compare_at_crossing(const Piece<S>& a, const Piece<S>& b, const Crossing<S>& crossing);

}  // namespace kbvh
