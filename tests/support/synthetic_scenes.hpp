#pragma once
#include <string>
#include <vector>

#include "core/judge/session.hpp"
#include "tests/support/random.hpp"

namespace kbvh::test {

/// A small scene made by formula, with an optional script of plan changes; its keyframes are short enough for
/// the brute-force oracle.
template <class S>
struct TestScene {
  Scene<S> scene;
  PlanScript<S> script;  ///< empty unless plans change
  /// l for each keyframe interval, or the scene's own frames if single keyframes define no times.
  std::vector<double> frames;
};

/// Returns the names of all synthetic scenes, each aimed at one practical problem.
const std::vector<std::string>& synthetic_scene_names();

/// Scenes whose geometry changes, at every frame or every second one, for strategies that can follow.
const std::vector<std::string>& geometry_scene_names();

/// Scenes that ask for pairs within bodies, too; some of these change plans, or geometry.
const std::vector<std::string>& self_scene_names();

/// Returns the names of all three lists, in this order.
std::vector<std::string> all_synthetic_names();

/// Returns those of the first list in which a gap of 0.1 between two sheets lies among numbers whose half
/// unit of rounding is 0.005: far from the origin, or because of one vertex or triangle of the same body.
const std::vector<std::string>& far_scene_names();

/// Makes such a scene with sheets of n x n vertices, or the same without the large numbers.
enum class FarPart : std::uint8_t { far, near };
template <class S>
Scene<S> far_scene(const std::string& name, std::uint32_t n, std::uint32_t keyframes, FarPart part);

/// Makes one by name; deterministic. `frames_per_keyframe` places the script's changes at frames, keyframes
/// and events.
template <class S>
TestScene<S> synthetic_scene(const std::string& name, std::uint32_t frames_per_keyframe = 1);

}  // namespace kbvh::test
