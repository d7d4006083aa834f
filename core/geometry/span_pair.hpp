#pragma once

namespace kbvh {

/// Two triangles that move linearly over a segment, by pointers to their corners' 3 coordinates at its begin
/// (corner[0]) and its end (corner[1]), and the part of the segment that is asked about, as fractions.
/// Corners 0..2 are those of the one triangle, 3..5 those of the other.
template <class S>
struct SpanPair {
  const S* corner[2][6];
  float begin, end;
};

}  // namespace kbvh
