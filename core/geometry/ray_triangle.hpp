#pragma once
#include "core/geometry/triangle_triangle.hpp"

namespace kbvh {

/// The points origin + s * direction with 0 <= s <= length; `length` may be infinite.
struct RayLine {
  double origin[3], direction[3];
  double length;
};

/// The first parameter of a ray at which it meets a triangle, and a bound on its error.
struct RayMeeting {
  double parameter = 0, error = 0;
};

/// Tests whether a ray meets a closed triangle, and where first. The answer is that of real arithmetic on the
/// given numbers, for coordinates and directions up to admissible_magnitude<double>; no epsilon decides. Rays
/// through edges and corners meet the triangle, and so do rays that lie in its plane. Degenerate triangles
/// are the segments or points that their corners span; a ray without direction is a point. `corners` is
/// [corner][3]. Floats are converted to double without any loss.
///
/// `meeting` is set if they meet; its error is at most 2^-42 of the parameter. Most tests cost three filtered
/// volumes (Segura & Feito 2001). Allocates only if exact integers exceed 1024 bits. Needs the default
/// floating-point environment, like the predicates.
bool ray_meets_triangle(const RayLine& ray, const double* corners, RayMeeting& meeting,
                        TriangleTestStats& stats);

/// Compares the parameters at which a ray first meets two triangles, exactly: negative, zero or positive as
/// the first one is smaller, equal or larger. The ray must meet both. Microseconds.
int compare_meetings(const RayLine& ray, const double* first, const double* second);

}  // namespace kbvh
