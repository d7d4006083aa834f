#pragma once
#include <cstdint>

#include "core/scene/pairs.hpp"

namespace kbvh {

/// Four points in linear motion: `begin[i]` and `end[i]` are the 3 coordinates of point i at t = 0 and at t =
/// 1; at t the point is at exactly (1 - t) begin + t end. Vertex-face: the vertex, then the face's corners.
/// Edge-edge: the two ends of one edge, then those of the other.
struct MovingPoints {
  const double* begin[4];
  const double* end[4];
};

/// Whether a closed vertex and a closed face, or two closed edges, touch at some t in [0, 1]. If so, the
/// first such t lies in [begin, end], which is no wider than `impact_width`.
struct Impact {
  bool touches = false;
  double begin = 0, end = 0;
};

/// The largest width of the interval that encloses a time of impact, as a fraction of the motion.
inline constexpr double impact_width = 0x1p-20;

/// Counts how impacts were decided, summed over all calls with the same object. tests = filtered + exact.
struct ImpactStats {
  std::uint64_t tests = 0;     ///< calls
  std::uint64_t filtered = 0;  ///< decided by comparisons and floating-point filters alone
  std::uint64_t exact =
      0;  ///< reached exact arithmetic: degenerate, just touching, or too close for the filter
};

/// Decides continuous collision detection exactly for one vertex and one face, or for two edges. The verdict
/// is that of real arithmetic on the given numbers: no epsilon, no false positive and no false negative.
/// Contact in a single point at a single instant counts, including t = 0 and t = 1. Degenerate faces and
/// edges count as the segments or points that their corners span at t; motion in one plane is covered, too.
///
/// Contact is possible only while the four points are coplanar: at the roots of a cubic (Provot 1997), or
/// always. The filter subdivides the cubic and the quadratics that describe the inside, in Bernstein form,
/// with bounds on all rounding. The remaining cases are decided with integers: Sturm sequences isolate the
/// roots, and the signs of the quadratics at a root, which is never approximated, are Tarski queries (Basu,
/// Pollack & Roy 2006, ch. 2), so that contact exactly on a border is decided. Brochu, Edwards & Bridson 2012
/// compute only the parity of the number of contacts; Wang et al. 2021 are conservative.
///
/// Any finite coordinates up to admissible_magnitude<double> are decided exactly. A filtered test costs 0.1
/// to 1 us, an exact test about 10 us, more if exponents differ much; an exact test may allocate.
/// Thread-safe; `stats`, if given, must not be shared between threads. Many queries are decided faster in
/// batches (impact_batch.hpp).
Impact find_impact(Contact::Kind kind, const MovingPoints& points, ImpactStats* stats = nullptr);

/// Decides the same without the filter, for tests.
Impact find_impact_exact(Contact::Kind kind, const MovingPoints& points);

}  // namespace kbvh
