#pragma once
#include <span>

#include "core/judge/session.hpp"
#include "core/scene/scene.hpp"
#include "experiments/theory/measurements.hpp"

namespace kbvh::theory {

/// The topology of all checks, as in the paper: binary, one primitive per leaf, median splits.
inline constexpr BuilderConfig paper_builder{.method = BuildMethod::median, .width = 2, .leaf_size = 1};

/// Plays the clip event by event and counts. O(events x log^2 + vertices x log).
CountRun measure_counts(const Scene<float>& scene);

/// Plays the clip at each l; logs are compared with the first. Counts bottom_up on the same topology.
std::vector<FrameRun> measure_frames(const Scene<float>& scene, std::span<const std::uint32_t> ls);

/// Plays a translation and classifies its events.
TranslationRun measure_translation(const Scene<float>& scene, std::uint64_t rounded);

/// Checks swept and linear boxes of the topology against the positions at all frames.
LooseRun measure_loose(const Scene<float>& scene, std::uint32_t l);

}  // namespace kbvh::theory
