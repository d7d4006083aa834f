#pragma once

namespace kbvh {

/// Two triangles as pointers to the 3 coordinates of each corner: corner[0..2] of the first triangle,
/// corner[3..5] of the second.
template <class S>
struct TrianglePair {
  const S* corner[6];
};

}  // namespace kbvh
