#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "experiments/scenes/scene_spec.hpp"

namespace kbvh::test {

/// $KBVH_DATA, or ../shared/data next to the repository.
std::filesystem::path data_folder();

/// A scene of real or simulated meshes; its name gives the source.
struct RealScene {
  std::string name;
  bool needs_data = false;
};
/// The tablecloth with its table; garments on their figures; each sequence cut by a sphere; two sequences
/// overlapping; the scenes of several bodies; the built-in scenes that age trees.
std::vector<RealScene> real_scenes();

/// Loads one. `keyframes` 0: all; otherwise this many from the middle of the clip. Large scenes are left out
/// (no bodies) if they exceed `most_triangles`.
experiments::LoadedScene load_real_scene(const std::string& name, std::size_t keyframes,
                                         std::size_t most_triangles);

}  // namespace kbvh::test
