#pragma once
#include <vector>

#include "experiments/io/animated_mesh.hpp"

namespace kbvh::io {

/// Merges vertices that have equal `rest` positions ([vertex][3]) and equal positions at all keyframes, and
/// drops vertices that no primitive uses. The remaining vertices keep their order; indices follow. glTF
/// splits vertices where normals or texture coordinates differ; without welding, two triangles at such a seam
/// would not be recognised as neighbours. Expected O(keyframes * vertices).
void weld(AnimatedMesh& mesh, const std::vector<double>& rest);

}  // namespace kbvh::io
