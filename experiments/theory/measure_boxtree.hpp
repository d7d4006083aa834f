#pragma once
#include "core/scene/scene.hpp"
#include "experiments/theory/measurements.hpp"

namespace kbvh::theory {

enum class Proof : std::uint8_t { none, exact_envelopes };

/// Plays the clip through kinetic BoxTrees of the paper's topology, event by event, for comparison with the
/// AABB trees of `counts`. With a proof, the log of every stored bound is checked against its exact envelope.
BoxTreeRun measure_boxtree(const Scene<float>& scene, const CountRun& counts, Proof proof);

/// Measures points that wander through `axes` dimensions, in trees that are split according to `tree`: "one
/// axis", "root x, else y" (fig. 10), "mixed". Throws std::invalid_argument on others.
SearchRun measure_searches(const std::string& tree, std::uint32_t leaves);

}  // namespace kbvh::theory
