#pragma once
#include <cstddef>
#include <vector>

#include "experiments/io/animated_mesh.hpp"

namespace kbvh::io {

/// Lets primitives share vertices at seams, where a file stores a vertex once per normal or texture
/// coordinate. Vertices with equal positions at all keyframes, and equal `rest` positions ([vertex][3];
/// empty: the file has none besides its keyframes), count as one vertex, and every primitive uses the first
/// of them that any primitive uses. Otherwise two triangles at a seam would not be recognised as neighbours.
/// No vertex is removed or renumbered. Returns the number of vertices that no primitive uses any longer.
/// Expected O(keyframes * vertices).
std::size_t weld(AnimatedMesh& mesh, const std::vector<double>& rest);

/// Counts what `weld` would return, without a change.
std::size_t copies_at_seams(const AnimatedMesh& mesh, const std::vector<double>& rest);

/// Drops vertices that no primitive uses. The remaining ones keep their order; indices follow.
void drop_unused_vertices(AnimatedMesh& mesh);

}  // namespace kbvh::io
