#pragma once
#include <cstdint>

#include "core/scene/scene.hpp"

namespace kbvh {

// Pairs within a distance, by any strategy that takes control nets: each vertex is replaced by the two
// corners of a box around it, grown by radius / 2. A box of a primitive's corners is the primitive's box,
// grown as much, because rounding is monotone; so boxes of leaves, nodes and primitives are right without
// any knowledge of the radius, for every machinery and at every time.

/// Returns the scene whose vertex v has become the corners 2 v (lower) and 2 v + 1 (upper) of its box, grown
/// by radius / 2 on each side. Primitives keep their ids and become control nets, whose pairs are those of
/// overlapping boxes; pairs, names and vertex sets are the same. Two primitives at a distance of at most
/// `radius` are always a pair.
///
/// Corners of vertices at rest are rounded outward. Corners of moving vertices have flight plans of their
/// own, whose positions are rounded at every time. Their keyframes therefore lie outward by as much more as
/// that rounding may take back: boxes are too large by at most 8 epsilon of S times the sum of the radius and
/// the largest coordinate of the body's keyframes.
///
/// Throws std::invalid_argument for a radius that is negative or no admissible length, for vertices on curves
/// or with plans of their own, and if a corner or a number of corners is not admissible. O(keyframes x
/// vertices).
template <class S>
Scene<S> with_radius(const Scene<S>& scene, double radius);

/// Writes the corners of `vertices` vertices, [2 * vertices][3], for positions [vertex][3] that are handed in
/// frame by frame (Playback::hand_in): rounded outward. Throws std::invalid_argument for the radius like
/// `with_radius`.
template <class S>
void write_corners(const S* positions, std::uint32_t vertices, double radius, S* corners);

}  // namespace kbvh
