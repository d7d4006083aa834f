#pragma once
#include <vector>

#include "experiments/io/animated_mesh.hpp"

namespace kbvh::io {

/// Makes one vertex of those that have equal `rest` positions ([vertex][3]) and equal positions at all
/// keyframes, and drops vertices that no primitive uses. What is left keeps its order; indices follow. glTF
/// splits vertices where normals or texture coordinates differ; without this, two triangles at such a seam
/// would not know that they are neighbours. Expected O(keyframes * vertices).
void weld(AnimatedMesh& mesh, const std::vector<double>& rest);

}  // namespace kbvh::io
