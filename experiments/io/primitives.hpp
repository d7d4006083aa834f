#pragma once
#include <cstdint>
#include <vector>

#include "experiments/io/animated_mesh.hpp"

namespace kbvh::io {

/// The interpretation of a mesh's primitives.
enum class TakeAs : std::uint8_t {
  given,      ///< as in the file: polygons of any number of corners stay whole
  triangles,  ///< polygons cut by ears (core/geometry/polygon_cut.hpp) at the first keyframe, in order
  points,     ///< every vertex one primitive, in any mesh
};

/// Converts the primitives. Throws InputError that names the mesh if points or control nets would have to
/// become triangles.
void take_as(AnimatedMesh& mesh, TakeAs how);

/// Makes every vertex of the mesh a primitive.
void make_points(AnimatedMesh& mesh);

/// A B-spline or NURBS surface over control points that are vertices of a mesh.
struct SplineSurface {
  std::uint32_t degree_u = 3, degree_v = 3;
  std::vector<double> knots_u, knots_v;  ///< not decreasing; as many as control points + degree + 1
  double first_u = 0, last_u = 0, first_v = 0, last_v = 0;  ///< the used part of the parameter range
  std::vector<std::uint32_t> points;                        ///< [v][u]: u is fastest
  std::uint32_t points_u() const { return std::uint32_t(knots_u.size()) - degree_u - 1; }
  std::uint32_t points_v() const { return std::uint32_t(knots_v.size()) - degree_v - 1; }
};

/// Returns the knot spans of positive length in a direction, within [first, last]: span k lies between knots
/// k and k + 1 and depends on the control points k - degree .. k.
std::vector<std::uint32_t> spans_of(const std::vector<double>& knots, std::uint32_t degree, double first,
                                    double last);

/// Appends one primitive for each pair of spans: its (degree_u + 1) x (degree_v + 1) control points, u
/// fastest. The patch lies in their convex hull, and therefore in their box, at every time and for all
/// positive weights: a point of the patch is a mean of control points with weights that are not negative and
/// sum to one. Between two keyframes control points move on straight lines, and the patch stays in their
/// hull.
void add_control_nets(AnimatedMesh& mesh, const SplineSurface& surface);

}  // namespace kbvh::io
