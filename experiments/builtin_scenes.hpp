#pragma once
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "experiments/io/animated_mesh.hpp"

namespace kbvh::experiments {

/// What every built-in scene can be asked for.
struct BuiltinOptions {
  std::uint32_t triangles = 2000;        ///< of the body that moves; the nearest that its pattern allows
  std::uint32_t obstacle_triangles = 0;  ///< of the body beside it; 0: what suits the scene
  std::uint64_t seed = 1;                ///< where chance plays a part
  std::uint32_t keyframes = 60;
};

/// Told what long work is doing and the finished fraction; may be empty.
using MakeProgress = std::function<void(const std::string& what, double fraction)>;

/// A scene that needs no files.
struct BuiltinScene {
  std::string name;
  std::string meaning;
  std::vector<io::AnimatedMesh> (*make)(const BuiltinOptions& options, const MakeProgress& progress);
};

const std::vector<BuiltinScene>& builtin_scenes();

/// Throws io::InputError that lists the known names.
const BuiltinScene& find_builtin_scene(const std::string& name);

}  // namespace kbvh::experiments
