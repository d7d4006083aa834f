#pragma once
#include <span>

namespace kbvh {

/// The points p with lower <= normal . p <= upper; the normal may have any nonzero length.
struct Slab {
  double normal[3] = {0, 0, 0};
  double lower = 0, upper = 0;
};

/// Computes the surface area of the intersection of slabs. The first three slabs are along the axes x, y and
/// z, and no two are parallel. Each of the 2 n planes' polygons is clipped by the other slabs, in double
/// relative to the middle, up to rounding; at most 32 slabs. O(n^2).
double slab_area(std::span<const Slab> slabs);

}  // namespace kbvh
