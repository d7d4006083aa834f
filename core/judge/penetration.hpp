#pragma once
#include "core/scene/pairs.hpp"
#include "core/scene/playback.hpp"

namespace kbvh {

/// How deep two primitives reach into each other.
struct Penetration {
  double depth = 0;     ///< length units of the scene
  double in_edges = 0;  ///< the same over the mean edge length of the two primitives; 0 without edges
};

/// Returns the penetration depth of two intersecting triangles: the length of the shortest translation of one
/// of them after which they do not intersect. Exact but for roundings of double: the shortest translation is
/// along the normal of a triangle or across an edge of each (the facets of their Minkowski difference). 0 for
/// triangles that only touch, for coplanar and for degenerate ones, and for those that do not intersect. Each
/// triangle is 3 corners of 3 coordinates.
double penetration_depth(const double (&a)[3][3], const double (&b)[3][3]);

/// Returns the penetration of a pair at the playback's current positions, all of which must be evaluated: the
/// largest of all triangles into which its polygons are cut. Points and control nets intersect where their
/// boxes overlap: of them, the smallest overlap of the boxes along an axis.
template <class S>
Penetration penetration(const Scene<S>& scene, const Playback<S>& playback, const PrimitivePair& pair);

}  // namespace kbvh
