#pragma once
#include <Eigen/Core>
#include <cstdint>

namespace kbvh::experiments::loop {

/// The pairs that contact is about.
enum class ContactKind : std::uint8_t { face_vertex, edge_edge };

/// Four points, one in each column. face_vertex: the vertex, then the corners of the face; edge_edge: the two
/// ends of one edge, then those of the other.
using FourPoints = Eigen::Matrix<double, 3, 4>;

/// The closest points of a vertex and a face, or of two edges, all closed. Their difference is the weighted
/// sum of the four points. `parameters` coordinates (0 to 2) of the closest points are free: the closest
/// points lie inside an edge or a face, not at a corner. The squared distance is the minimum over these
/// coordinates, at which its derivatives are those of the difference with fixed weights, and its second
/// derivatives follow from those of the weights.
struct ClosestPoints {
  Eigen::Vector4d weights;
  Eigen::Vector3d difference;
  double squared_distance;
  int parameters;
  Eigen::Matrix<double, 4, 2> weight_derivatives;  ///< [.][parameter], of the first `parameters` columns
};

/// Finds the closest points. Degenerate faces and edges are the segments or points that their corners span,
/// up to rounding.
ClosestPoints closest_points(ContactKind kind, const FourPoints& points);

}  // namespace kbvh::experiments::loop
