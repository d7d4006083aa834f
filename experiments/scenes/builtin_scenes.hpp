#pragma once
#include <array>
#include <cstdint>
#include <functional>
#include <optional>
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
  /// Garments only: how many triangles are simulated in full before a second level refines; 0: the usual
  /// number.
  std::uint32_t full_triangles = 0;
};

/// Told what long work is doing and the finished fraction; may be empty.
using MakeProgress = std::function<void(const std::string& what, double fraction)>;

/// How vertices that fly outwards answer contact (Z&W s.9): after every frame's query, each vertex of a
/// colliding primitive that moves outwards turns round, and each that moves inwards and has come to the
/// lowest radius turns outwards again, both at the speed they had. So motion goes on for as long as one
/// likes.
struct ReversalRule {
  std::vector<std::array<double, 3>> centres;  ///< of every body
  double lowest_radius = 0;
  double frames_per_second = 60;
  std::uint32_t frames = 0;
};

/// A scene that needs no files.
struct BuiltinScene {
  std::string name;
  std::string meaning;
  std::vector<io::AnimatedMesh> (*make)(const BuiltinOptions& options, const MakeProgress& progress);
  /// For scenes whose plans change at run time: they are played at the rule's frames. Else nullptr.
  ReversalRule (*reversal)(const BuiltinOptions& options) = nullptr;
};

const std::vector<BuiltinScene>& builtin_scenes();

/// Throws io::InputError that lists the known names.
const BuiltinScene& find_builtin_scene(const std::string& name);

}  // namespace kbvh::experiments
