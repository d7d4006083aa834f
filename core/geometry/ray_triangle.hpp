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
  /// Bit c: corner c belongs to the smallest set of corners whose hull contains the meeting point, where the
  /// ray crosses the plane; 0: unknown.
  std::uint8_t corners = 0;
  bool rounded = false;  ///< the parameter is the exact one, correctly rounded
};

/// Tests whether a ray meets a closed triangle, and where first. The answer is that of real arithmetic on the
/// given numbers, for coordinates and directions up to admissible_magnitude<double>; no epsilon decides. Rays
/// through edges and corners meet the triangle, and so do rays that lie in its plane. Degenerate triangles
/// are the segments or points that their corners span; a ray without direction is a point. `corners` is
/// [corner][3]. Floats are converted to double without loss.
///
/// `meeting` is set if they meet; its error is at most 2^-42 of the parameter. Most tests cost three filtered
/// volumes (Segura & Feito 2001). If the meeting with another triangle is `known` to be at the same
/// parameter, a test that the filter leaves open copies it, unless it has been filtered. Allocates only if
/// exact integers exceed 1024 bits. Needs the default floating-point environment, like the predicates.
bool ray_meets_triangle(const RayLine& ray, const double* corners, RayMeeting& meeting,
                        TriangleTestStats& stats, const RayMeeting* known = nullptr);

/// Returns whether a ray that meets a triangle certainly meets another one first at the same point, because
/// of equal coordinates: either both have the same corners, or the ray crosses the planes of both, and the
/// other triangle shares the corners whose hull contains the meeting point. Sets `known` to the meeting, with
/// its corners in the other triangle. Computes no more than a filter.
bool meets_at_same_corners(const RayLine& ray, const double* met, const RayMeeting& meeting,
                           const double* other, RayMeeting& known);

/// Compares exactly the parameters at which a ray first meets two triangles: negative, zero or positive if
/// the first one is smaller, equal or larger. The ray must meet both. Microseconds.
int compare_meetings(const RayLine& ray, const double* first, const double* second);

}  // namespace kbvh
