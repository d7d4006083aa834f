#pragma once
#include <algorithm>

namespace kbvh {

/// One segment of one coordinate of a flight plan, of degree at most 3: an exact function of the stored
/// numbers (truth A),
///   x(t) = x0 + (x1 - x0) s + s (1 - s) (bend + twist s),   s = (t - t0) / (t1 - t0),   t0 <= t <= t1.
/// The ends are stored numbers, as those of a chord (piece.hpp): pieces meet at keyframes without rounding.
/// With twist = 0 the piece is a parabola with the acceleration -2 bend / (t1 - t0)^2; with bend = twist = 0
/// it is the chord. Vertices with equal bend and twist have differences that are linear in time. Times are
/// doubles in seconds, t0 < t1; the other numbers are in units of length.
template <class S>
struct CurvedPiece {
  double t0 = 0, t1 = 1;
  S x0 = 0, x1 = 0, bend = 0, twist = 0;

  bool operator==(const CurvedPiece&) const = default;
};

/// Returns the bend of a segment of constant acceleration (units per second^2), rounded to S.
template <class S>
S bend_of_acceleration(double acceleration, double duration) {
  return static_cast<S>(-0.5 * acceleration * duration * duration);
}

/// The cubic through x0 and x1 with given velocities (units per second) at the ends: Hermite keyframes.
template <class S>
void bend_by_velocities(S x0, S x1, double velocity0, double velocity1, double duration, S& bend, S& twist) {
  const double way = static_cast<double>(x1) - static_cast<double>(x0);
  bend = static_cast<S>(velocity0 * duration - way);
  twist = static_cast<S>(way - velocity1 * duration - static_cast<double>(bend));
}

/// The largest and the least distance of a piece above the chord of its ends are within [lower, upper]; both
/// are exact in S but for underflow. s (1 - s) is at most 1/4, and bend + twist s lies between its ends.
template <class S>
struct Bulge {
  double lower, upper;
};
template <class S>
Bulge<S> bulge(S bend, S twist) {
  // The sum of two floats is exact in double, or rounded by far less than the last factor adds.
  const double first = static_cast<double>(bend), last = first + static_cast<double>(twist);
  constexpr double above = 0.25 * (1 + 0x1p-50);
  return {std::min({0.0, first, last}) * above, std::max({0.0, first, last}) * above};
}

}  // namespace kbvh
