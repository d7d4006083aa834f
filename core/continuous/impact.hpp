#pragma once
#include <cstdint>

#include "core/scene/pairs.hpp"

namespace kbvh {

/// Four points in linear motion: `begin[i]` and `end[i]` are the 3 coordinates of point i at t = 0 and at
/// t = 1; at t it is at exactly (1 - t) begin + t end. Vertex-face: the vertex, then the face's corners.
/// Edge-edge: the two ends of one edge, then those of the other.
struct MovingPoints {
  const double* begin[4];
  const double* end[4];
};

/// Do a closed vertex and a closed face, or two closed edges, touch at some t in [0, 1]? If so, the first
/// such t lies in [begin, end], which is no wider than `impact_width`.
struct Impact {
  bool touches = false;
  double begin = 0, end = 0;
};

/// The largest width of the interval that encloses a time of impact, as a fraction of the motion.
inline constexpr double impact_width = 0x1p-20;

/// How impacts were decided, summed over the calls that were given it. tests = filtered + exact.
struct ImpactStats {
  std::uint64_t tests = 0;     ///< calls
  std::uint64_t filtered = 0;  ///< decided by comparisons and floating-point filters alone
  std::uint64_t exact =
      0;  ///< came to exact arithmetic: degenerate, just touching, or too close for the filter
};

/// The exact verdict of continuous collision detection for one vertex and one face, or for two edges: that of
/// real arithmetic on the given numbers, with no epsilon, no false positive and no false negative. Contact in
/// a single point at a single instant counts, be it t = 0 or t = 1; so do degenerate faces and edges, which
/// are the segments or points that their corners span at t, and motion in one plane.
///
/// They touch only while their four points are coplanar: at the roots of a cubic (Provot 1997), or always.
/// The filter subdivides it and the quadratics that say what is inside, in Bernstein form, with bounds on all
/// rounding. What it leaves is decided with integers: roots are isolated by Sturm's sequences, and the signs
/// of the quadratics at a root, which is never approximated, are Tarski queries (Basu, Pollack & Roy 2006,
/// ch. 2), so that what is exactly on a border is known to be. Verdicts can be compared with those of Brochu,
/// Edwards & Bridson 2012, which give the parity of the number of contacts only, and of Wang et al. 2021.
///
/// Any finite coordinates up to admissible_magnitude<double> are exact. A filtered test costs 0.1 to 1 us, an
/// exact one some 10 us and more where exponents differ much; it may allocate. Thread-safe; `stats`, if
/// given, must not be shared between threads.
Impact find_impact(Contact::Kind kind, const MovingPoints& points, ImpactStats* stats = nullptr);

/// The same without the filter: for tests.
Impact find_impact_exact(Contact::Kind kind, const MovingPoints& points);

}  // namespace kbvh
