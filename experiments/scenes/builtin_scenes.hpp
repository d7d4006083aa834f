#pragma once
#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "experiments/io/animated_mesh.hpp"

namespace kbvh::experiments {

/// The options common to all built-in scenes.
struct BuiltinOptions {
  std::uint32_t triangles = 2000;        ///< of the moving body; the nearest number that its pattern allows
  std::uint32_t obstacle_triangles = 0;  ///< of the body next to it; 0: the scene's default
  std::uint64_t seed = 1;                ///< of random parts
  std::uint32_t keyframes = 60;
  /// Garments only: the number of triangles that is simulated in full before a second level refines; 0: the
  /// usual number.
  std::uint32_t full_triangles = 0;
};

/// Receives the name of long work and the finished fraction; may be empty.
using MakeProgress = std::function<void(const std::string& what, double fraction)>;

/// The response of outward-moving vertices to contact (Z&W s.9): after every frame's query, each
/// outward-moving vertex of a colliding primitive reverses, and each inward-moving vertex that has reached
/// the lowest radius turns outwards again, both at their previous speed. The motion can therefore continue
/// indefinitely.
struct ReversalRule {
  std::vector<std::array<double, 3>> centres;  ///< of every body
  double lowest_radius = 0;
  double frames_per_second = 60;
  std::uint32_t frames = 0;
};

/// A hand that drags a part of the first body along a straight path and back, while keyframes move the rest.
struct DragRule {
  std::array<double, 3> grip;  ///< position at the first keyframe
  double radius = 0;           ///< vertices up to this distance are held, less firmly the further away
  std::array<double, 3> path;  ///< of the grip, relative to its motion without the hand
  double frames_per_second = 60;
  std::uint32_t frames = 0;
};

/// Which bodies form a scene's pairs.
enum class BodiesOf : std::uint8_t {
  several,  ///< pairs between bodies
  one,      ///< the scene has one body: pairs within it; the option `obstacle` is refused
};

/// Which simulations of cloth a scene has.
enum class ClothLevels : std::uint8_t {
  one,  ///< at most one, of all triangles; the option `full_triangles` is refused
  two,  ///< above `full_triangles` a second one refines the first
};

/// A scene that needs no files.
struct BuiltinScene {
  std::string name;
  std::string meaning;
  std::vector<io::AnimatedMesh> (*make)(const BuiltinOptions& options, const MakeProgress& progress);
  /// For scenes whose plans change at run time: they are played at the rule's frames. Else nullptr.
  ReversalRule (*reversal)(const BuiltinOptions& options) = nullptr;
  BodiesOf bodies = BodiesOf::several;
  /// Does the same for scenes with a dragged part, as a function of the generated bodies.
  DragRule (*drag)(const BuiltinOptions& options, const std::vector<io::AnimatedMesh>& meshes) = nullptr;
  ClothLevels levels = ClothLevels::one;

  /// Returns whether the scene makes its own changes of plans, and defines its frames.
  bool changes_plans() const { return reversal != nullptr || drag != nullptr; }
};

const std::vector<BuiltinScene>& builtin_scenes();

/// Finds a scene by its name. Throws io::InputError that lists the known names.
const BuiltinScene& find_builtin_scene(const std::string& name);

}  // namespace kbvh::experiments
