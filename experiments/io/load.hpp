#pragma once
#include <cstdint>
#include <filesystem>
#include <string>

#include "experiments/io/animated_mesh.hpp"

namespace kbvh::io {

/// The description of a mesh to load.
struct LoadRequest {
  /// The treatment of vertices that a file stores once per normal or texture coordinate (weld.hpp).
  enum class Seams : std::uint8_t {
    weld,        ///< primitives on both sides share them
    keep_apart,  ///< for callers that move single vertices; a note counts them. glTF files are welded all the
                 ///< same: their vertices have no numbers outside
  };
  /// A file .obj, .ply, .gltf or .glb, or a folder of numbered frames (.obj or .ply).
  std::filesystem::path mesh;
  /// Optional: a point cache (.pc2) that moves the vertices of an .obj or .ply.
  std::filesystem::path motion;
  /// glTF: the animation's name, or else its index from 0. Empty: the only one; with several, an error that
  /// lists them.
  std::string clip;
  /// For folders of frames and point caches, which have frames but no seconds. 0: 30.
  double frames_per_second = 0;
  Seams seams = Seams::weld;
};

/// Reads a mesh and its motion from files; static meshes get a single keyframe at time 0. Throws InputError
/// of one sentence with file, place (line, sample, vertex, accessor) and value. Folders: the last number in
/// each name gives the order (frame_2 before frame_10), names differ in nothing else, the numbers are equally
/// spaced (a gap is a missing frame), all frames have the same faces; frame i gets time i /
/// frames_per_second. Vertices of polygons and control nets are welded at seams after their motion is known
/// (`welded_vertices` counts): all keep their numbers, so that point caches and scripts find them; those of
/// glTF files are renumbered. Every result has passed finish() (validate.hpp). No network access; glTF
/// buffers are read from files next to the mesh only. O(bytes); glTF: O(keyframes * vertices * influences).
AnimatedMesh load_animated_mesh(const LoadRequest& request);

}  // namespace kbvh::io
