#pragma once
#include <optional>
#include <string>
#include <vector>

#include "core/judge/session.hpp"
#include "core/scene/scene.hpp"

namespace kbvh::theory {

/// Returns the moving bodies of a built-in scene: resting bodies have no events. The scene is called like the
/// family. Throws io::InputError.
Scene<float> moving_scene(const std::string& family, std::uint32_t triangles, std::uint32_t keyframes);

/// Returns a whole built-in scene, with as many triangles in the body next to the moving one. The scene is
/// called like the family.
Scene<float> colliding_scene(const std::string& family, std::uint32_t triangles, std::uint32_t keyframes);

/// Returns a sequence of the data folder, with at most this many keyframes (0: all); nothing if it does not
/// exist.
std::optional<Scene<float>> data_scene(const std::string& name, std::size_t keyframes);

/// Makes one polygon of `vertices` vertices whose x are tangents to a parabola: over one segment, of one
/// second, its upper x bound passes through all of them (claim T9). All coordinates are exact in float.
Scene<float> tangents_scene(std::uint32_t vertices);

/// Make one control net of vertices that move along x in one segment, of one second, so that its upper x
/// bound has as many changes as the degree allows (parabolas: 2 n - 2), or more than any parabolas (cubics: 3
/// n - 3; every two of them cross three times). Vertex 0 is at rest. At least two vertices; at most 12
/// cubics, for their coefficients grow by a factor of 8 each.
Scene<float> parabolas_scene(std::uint32_t vertices);
Scene<float> cubics_scene(std::uint32_t vertices);

/// Makes a fan: `triangles` around one vertex, at rest. Its hub takes part in every leaf's certificates (T4).
Scene<float> fan_scene(std::uint32_t triangles);

/// Makes points that move randomly on the first `axes` axes, four keyframes; other coordinates are 0.
Scene<float> wandering_points(std::uint32_t count, std::size_t axes);

/// A sphere's vertices on a lattice, moved by lattice steps: a translation that float holds exactly, near the
/// origin. `far` moves it to coordinates of 1e6, by steps that are not multiples of float's spacing there.
struct Translation {
  Scene<float> scene;
  std::uint64_t rounded = 0;  ///< coordinates of keyframes that differ from those of the exact translation
};
Translation near_translation(std::uint32_t triangles, std::uint32_t keyframes);
Translation far_translation(std::uint32_t triangles, std::uint32_t keyframes);

/// Makes a script of velocities that change at run time: at every fourth keyframe, and in the middle of every
/// fourth interval, up to `changed` vertices get their own plans. Deterministic.
PlanScript<float> velocity_script(const Scene<float>& scene, std::uint32_t frames_per_keyframe,
                                  std::uint32_t changed);

}  // namespace kbvh::theory
