#pragma once

namespace kbvh {

/// Returns the exact sign of |p - centre| - radius: 1 outside, 0 on the sphere, -1 inside. A filter decides
/// most cases, integers of as many bits as needed decide the others. Points are 3 doubles; the radius is not
/// negative. All numbers are finite.
int side_of_sphere(const double* centre, double radius, const double* p);

/// Returns the exact sign of |axis . (p - centre)| - half: 1 outside the slab, 0 on one of its planes, -1
/// inside. A filter decides most cases, rational arithmetic (microseconds) the others.
int side_of_slab(const double* axis, const double* centre, double half, const double* p);

}  // namespace kbvh
