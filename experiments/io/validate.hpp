#pragma once
#include <filesystem>

#include "experiments/io/animated_mesh.hpp"

namespace kbvh::io {

/// The largest admissible magnitude of a coordinate: 1e30 as a float, so that files of floats and files of
/// text have one limit. Products of three such coordinates still fit a double.
inline constexpr double largest_coordinate = 1e30f;

/// Performs the last step of every reader: checks the invariants of a mesh, and repairs minor defects in
/// place:
/// - structure: sizes fit together, there is at least one vertex, primitive and keyframe, every polygon has
///   at least three vertices and every other primitive at least one, every index is below vertex_count;
/// - every coordinate is finite and at most `largest_coordinate` in magnitude; a negative zero becomes zero;
/// - keyframe times are finite and increase; neighbours of equal time are merged if all their positions are
///   equal, and are an error if not (`merged_keyframes` counts);
/// - polygons whose corners all lie on one line at the first keyframe are counted (`degenerate_primitives`)
///   and kept.
/// Throws InputError that names `file`, the place and the value. O(size of the mesh), and exact arithmetic
/// only for areas near zero.
void finish(AnimatedMesh& mesh, const std::filesystem::path& file);

/// Counts the polygons whose corners lie on one line at the first keyframe (`degenerate_primitives`).
void count_degenerate(AnimatedMesh& mesh);

/// Returns true if all corners of a polygon lie on one line, decided exactly for coordinates whose products
/// neither overflow nor underflow. `positions` is [vertex][3].
bool is_degenerate(const std::uint32_t* vertices, std::size_t count, const double* positions);

}  // namespace kbvh::io
