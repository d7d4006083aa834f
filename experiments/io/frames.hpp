#pragma once
#include <filesystem>
#include <vector>

#include "experiments/io/animated_mesh.hpp"

namespace kbvh::io {

/// Returns the .obj or .ply files of a folder, ordered by the last number in each name ("frame_2" before
/// "frame_10"). Throws InputError if there are none, a name has no number, two names share one, names differ
/// in more than the number, or the numbers are not equally spaced (names the first missing one).
std::vector<std::filesystem::path> numbered_frames(const std::filesystem::path& folder);

/// Reads a folder of numbered frames as keyframes at i / frames_per_second (0: 30 per second). All frames
/// must have the vertices and faces of the first; an InputError names both files and both values. Does not
/// call finish().
AnimatedMesh read_frames(const std::filesystem::path& folder, double frames_per_second);

/// Reads one .obj or .ply file by its extension. Throws InputError.
AnimatedMesh read_mesh_file(const std::filesystem::path& file);

/// Returns the extension in lower case, with its dot.
std::string lower_extension(const std::filesystem::path& file);

}  // namespace kbvh::io
