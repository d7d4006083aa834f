#pragma once
#include <filesystem>

#include "experiments/io/animated_mesh.hpp"

namespace kbvh::io {

/// Reads a Wavefront OBJ file: its vertices in file order, every `f` as one primitive with all its vertices
/// (polygons are not cut into triangles), one keyframe at time 0. A file with B-spline or NURBS surfaces
/// (obj_surfaces.hpp) and no face gives their control nets; a file with neither gives a cloud of points:
/// those of its `p` statements, or else all vertices. Indices may be negative (relative) or refer to later
/// vertices. Lines end in '\n', "\r\n" or '\r'. A backslash at the end of a line continues the numbers of a
/// statement in the next line; comments and names end with their line.
///
/// Texture coordinates, normals, groups, materials and vertex colours are skipped. A note counts skipped
/// points, polylines (`l`), curves and lines that begin with an unknown word. Refused: a line that does not
/// begin with a word, a vertex with 5 or more than 7 numbers, a statement that includes another file.
///
/// kbvh does not use tinyobjloader: version 2.0rc10 reads "nan", a missing or a misspelt coordinate as 0
/// without a warning, drops faces of two vertices, wraps large indices, and rounds two thirds of 17-digit
/// coordinates wrongly. Here each coordinate is the double nearest to its text.
///
/// Throws InputError with the line. Does not call finish(). O(bytes).
AnimatedMesh read_obj(const std::filesystem::path& file);

/// Writes the first keyframe as OBJ; coordinates read back as the same doubles. Throws InputError if the file
/// cannot be written.
void save_obj(const AnimatedMesh& mesh, const std::filesystem::path& file);

}  // namespace kbvh::io
