#pragma once

namespace kbvh {

/// Two triangles that move linearly over a segment: pointers to the 3 coordinates of each corner at the
/// segment's start (corner[0]) and end (corner[1]), and the queried part of the segment, as fractions.
/// Corners 0..2 belong to the first triangle, corners 3..5 to the second.
template <class S>
struct SpanPair {
  const S* corner[2][6];
  float begin, end;
};

}  // namespace kbvh
