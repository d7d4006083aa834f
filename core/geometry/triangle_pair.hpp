#pragma once

namespace kbvh {

/// Two triangles by pointers to their corners' 3 coordinates: corner[0..2] of the one, corner[3..5] of the
/// other.
template <class S>
struct TrianglePair {
  const S* corner[6];
};

}  // namespace kbvh
