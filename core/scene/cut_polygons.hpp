#pragma once
#include "core/geometry/polygon_cut.hpp"
#include "core/scene/scene.hpp"

namespace kbvh {

/// The findings of cutting polygons of more than three corners. Coordinates from files are rounded, so a
/// polygon counts as bent only from a millionth of its size on.
struct CutFindings {
  std::uint64_t cut = 0;
  std::uint64_t bent = 0;      ///< not planar
  std::uint64_t crossing = 0;  ///< cross themselves (PolygonCut::crosses)
  double most_bent = 0;        ///< the largest distance from the plane, divided by the polygon's size

  void add(const PolygonCut& one);
  void add(const CutFindings& other);
};

/// Cuts every polygon of more than three corners that has not been cut yet into triangles, at the positions
/// of its body's first keyframe (for a body whose positions are handed in: those with which it was made).
/// From then on the polygon is the union of these triangles, at every time: for pairs, spans and rays. The
/// rule is PolygonCutter's (core/geometry/polygon_cut.hpp). A scene must be cut before it is played. The
/// scene must be valid (`validate`).
template <class S>
CutFindings cut_polygons(Scene<S>& scene);

/// Does the same for one body.
template <class S>
CutFindings cut_polygons(Body<S>& body);

/// Cuts one polygon at positions [vertex][3] of a given time, unless it has at most three corners.
template <class S>
CutFindings cut_polygon(Primitives& primitives, std::uint32_t primitive, const S* positions, double time);

/// Throws std::invalid_argument, naming body and primitive, if a polygon of more than three corners has not
/// been cut.
template <class S>
void check_cut(const Scene<S>& scene);

}  // namespace kbvh
