#pragma once
#include <cstdint>

#include "core/geometry/predicates.hpp"

namespace kbvh {

/// How tests were decided, summed over the calls that were given it. tests = filtered + exact.
struct TriangleTestStats {
  std::uint64_t tests = 0;     ///< calls
  std::uint64_t filtered = 0;  ///< decided by floating-point filters and comparisons alone
  std::uint64_t exact = 0;  ///< came to the exact stage: coplanar, degenerate, or too close for the filters
};

/// Do two closed triangles share a point? Exact: the answer is that of real arithmetic on the given numbers,
/// for all coordinates up to admissible_magnitude<S>; nothing is decided by an epsilon. Contact in a single
/// point counts. Degenerate triangles are the segments or points that their corners span; coplanar ones are
/// tested in their plane. The order of corners and of triangles makes no difference.
///
/// S is float or double; each pointer is to 3 coordinates. Constant time; most pairs cost two filtered
/// plane-side tests (Moeller 1997), those that pass them two orientation signs more (Guigue and Devillers
/// 2003). Allocates only where exact integers leave 512 bits. Needs the default floating-point environment,
/// as the predicates do. Thread-safe; `stats`, if given, must not be shared between threads.
template <class S>
bool triangles_intersect(const S* a0, const S* a1, const S* a2, const S* b0, const S* b1, const S* b2,
                         TriangleTestStats* stats = nullptr);

extern template bool triangles_intersect<float>(const float*, const float*, const float*, const float*,
                                                const float*, const float*, TriangleTestStats*);
extern template bool triangles_intersect<double>(const double*, const double*, const double*, const double*,
                                                 const double*, const double*, TriangleTestStats*);

}  // namespace kbvh
