#pragma once
#include <cstdint>
#include <nlohmann/json.hpp>

#include "experiments/scenes/scene_spec.hpp"

namespace kbvh::experiments {

/// Returns a scene in the format kbvh-scene of the lab (analysis/lab/README.md), with all its keyframes and
/// this many frames for each interval between two of them.
nlohmann::json lab_scene(const LoadedScene& scene, std::uint32_t frames_per_keyframe);

}  // namespace kbvh::experiments
