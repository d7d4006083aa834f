#pragma once
#include "core/scene/scene.hpp"
#include "experiments/theory/measurements.hpp"

namespace kbvh::theory {

/// Plays the clip through kinetic incremental collision detection, event by event, and at `instants` times
/// between events compares the list with a new traversal in rational arithmetic.
SeparationRun measure_separation(const Scene<float>& scene, std::uint32_t instants);

/// Measures the sizes of the list at the first, a middle and the last keyframe, each from a fresh start.
ListSizeRun measure_list_size(const Scene<float>& scene);

}  // namespace kbvh::theory
