#pragma once
#include <filesystem>

#include "experiments/io/animated_mesh.hpp"

namespace kbvh::io {

/// Reads a PLY file, ascii or binary of either byte order: x, y, z of the element "vertex" (any number type),
/// the list "vertex_indices" (or "vertex_index") of the element "face" as one primitive each, polygons kept
/// whole, and "tristrips", if present, cut into triangles (-1 starts a new strip). Other properties are
/// skipped, and so, with a note, are other elements; a file without faces is a cloud of points, one primitive
/// per vertex, unless it has edges. All lines end as the first one does: in '\n', "\r\n" or '\r'. In ascii
/// every element begins on a line of its own and may continue in the next ones (a note counts these): a
/// missing value cannot silently shift the others. Vertices keep their order. One keyframe at time 0.
///
/// assimp would reorder vertices, and Debian has no small library that reports the place of an error. Throws
/// InputError with the header line, or the element and its number (from 0). Does not call finish(). O(bytes).
AnimatedMesh read_ply(const std::filesystem::path& file);

}  // namespace kbvh::io
