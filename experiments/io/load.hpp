#pragma once
#include <filesystem>
#include <string>

#include "experiments/io/animated_mesh.hpp"

namespace kbvh::io {

/// What to load.
struct LoadRequest {
  /// A file .obj, .ply, .gltf or .glb, or a folder of numbered frames (.obj or .ply).
  std::filesystem::path mesh;
  /// Optional: a point cache (.pc2) that moves the vertices of an .obj or .ply.
  std::filesystem::path motion;
  /// glTF: the animation's name, or else its index from 0. Empty: the only one; an error that names them if
  /// several.
  std::string clip;
  /// For folders of frames and point caches, which know frames but not seconds. 0: 30.
  double frames_per_second = 0;
};

/// Reads a mesh and its motion from files; static ones get a single keyframe at time 0. What is wrong is
/// said by an InputError of one sentence with file, place (line, sample, vertex, accessor) and value.
/// Folders: the last number in each name gives the order (frame_2 before frame_10), names differ in nothing
/// else, the numbers are equally spaced (a gap is a missing frame), all frames have the same faces; frame i
/// gets time i / frames_per_second. Every result has passed finish() (validate.hpp). No network; glTF buffers
/// are read from beside the file only. O(bytes); glTF: O(keyframes * vertices * influences).
AnimatedMesh load_animated_mesh(const LoadRequest& request);

}  // namespace kbvh::io
