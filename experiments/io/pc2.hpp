#pragma once
#include <filesystem>

#include "experiments/io/animated_mesh.hpp"

namespace kbvh::io {

/// The frame rate if neither the file nor the request gives one.
inline constexpr double default_frames_per_second = 30;

/// Replaces the keyframes of `mesh` by the samples of a PC2 point cache: a header of 32 bytes
/// ("POINTCACHE2\0", version 1, vertices, start frame, frames per sample, samples), then little-endian
/// float32 [sample][vertex][3], in the vertex order of the mesh.
///
/// Sample i lies at frame start + i * rate, as 3ds Max writes and Blender reads it (the "sample rate" is
/// frames per sample; a rate of 0 means unknown and counts as 1), so its time is (start + i * rate) /
/// frames_per_second seconds. The file does not contain the frames per second; 0 stands for
/// `default_frames_per_second`.
///
/// Throws InputError with sample and vertex (both from 0). Does not call finish(). `mesh_file` is named in
/// messages.
void read_pc2(AnimatedMesh& mesh, const std::filesystem::path& mesh_file, const std::filesystem::path& file,
              double frames_per_second);

/// Writes all keyframes as PC2. Coordinates are rounded to float32. Throws InputError if the keyframe times
/// are not equally spaced (the format has one step for all; the tolerance is 1e-5 of a step), a coordinate
/// leaves the range of float, or the file cannot be written.
void save_pc2(const AnimatedMesh& mesh, const std::filesystem::path& file,
              double frames_per_second = default_frames_per_second);

}  // namespace kbvh::io
