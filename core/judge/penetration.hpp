#pragma once
#include "core/scene/pairs.hpp"
#include "core/scene/playback.hpp"

namespace kbvh {

/// The depth of the overlap of two primitives.
struct Penetration {
  double depth = 0;     ///< in length units of the scene
  double in_edges = 0;  ///< the same over the mean edge length of the two primitives; 0 without edges
};

/// Returns the penetration depth of two intersecting triangles: the length of the shortest translation of one
/// of them that separates them. Exact up to roundings of double: the shortest translation is along the normal
/// of a triangle or across an edge of each (the facets of their Minkowski difference). 0 for triangles that
/// only touch, for coplanar and degenerate ones, and for those that do not intersect. Each triangle is 3
/// corners of 3 coordinates.
double penetration_depth(const double (&a)[3][3], const double (&b)[3][3]);

/// Returns the penetration of a pair at the playback's current positions, all of which must be evaluated: the
/// largest over all triangles into which its polygons are cut. Points and control nets intersect where their
/// boxes overlap; their penetration is the smallest overlap of the boxes along an axis.
template <class S>
Penetration penetration(const Scene<S>& scene, const Playback<S>& playback, const PrimitivePair& pair);

}  // namespace kbvh
