#pragma once
#include "core/scene/scene.hpp"
#include "experiments/theory/measurements.hpp"

namespace kbvh::theory {

enum class Proof : std::uint8_t { none, exact_envelopes };

/// Plays the clip through kinetic BoxTrees of the paper's topology, event by event, beside what `counts` says
/// of the AABB trees. With a proof, the log of every stored bound is held against its exact envelope.
BoxTreeRun measure_boxtree(const Scene<float>& scene, const CountRun& counts, Proof proof);

/// Points that wander through `axes` dimensions, in trees that are split as `tree` says: "one axis", "root x,
/// else y" (fig. 10), "mixed". Throws std::invalid_argument on others.
SearchRun measure_searches(const std::string& tree, std::uint32_t leaves);

}  // namespace kbvh::theory
