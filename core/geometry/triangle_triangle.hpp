#pragma once
#include <cstdint>

#include "core/geometry/predicates.hpp"

namespace kbvh {

/// Counts how tests were decided, summed over all calls with the same object. tests = filtered + exact.
struct TriangleTestStats {
  std::uint64_t tests = 0;     ///< calls
  std::uint64_t filtered = 0;  ///< decided by floating-point filters and comparisons alone
  std::uint64_t exact = 0;  ///< reached the exact stage: coplanar, degenerate, or too close for the filters
  /// Exact decisions about rays: tests of a ray and a triangle that reached the exact stage, and comparisons
  /// of two meetings in exact arithmetic. A part of neither `tests` nor `exact`.
  std::uint64_t ray_decisions = 0;
};

/// Tests whether two closed triangles share a point. The test is exact: the answer is that of real arithmetic
/// on the given numbers, for all coordinates up to admissible_magnitude<S>; no epsilon decides. Contact in a
/// single point counts. Degenerate triangles are the segments or points that their corners span; coplanar
/// triangles are tested in their plane. The order of corners and of triangles does not matter.
///
/// S is float or double; each pointer is to 3 coordinates. Constant time: most pairs cost two filtered
/// plane-side tests (Moeller 1997), the others two more orientation signs (Guigue and Devillers 2003).
/// Allocates only if exact integers exceed 512 bits. Needs the default floating-point environment, like the
/// predicates. Thread-safe; `stats`, if given, must not be shared between threads.
template <class S>
bool triangles_intersect(const S* a0, const S* a1, const S* a2, const S* b0, const S* b1, const S* b2,
                         TriangleTestStats* stats = nullptr);

extern template bool triangles_intersect<float>(const float*, const float*, const float*, const float*,
                                                const float*, const float*, TriangleTestStats*);
extern template bool triangles_intersect<double>(const double*, const double*, const double*, const double*,
                                                 const double*, const double*, TriangleTestStats*);

}  // namespace kbvh
