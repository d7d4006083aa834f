#pragma once
#include "core/scene/scene.hpp"
#include "experiments/theory/measurements.hpp"

namespace kbvh::theory {

// Measurements of what the paper proposes in its last section (claims C1 to C4).

/// Plays a clip with queries through the kinetic AABB tree as in the paper, but for the number of children
/// per node (2, 4 or 8).
OrderRun measure_order(const Scene<float>& scene, std::uint32_t width);

/// Plays a clip with queries through the paper's kinetic BoxTree. `rebuild` says how degenerated parts are
/// rebuilt: "never", "median" or "sah".
RebuildRun measure_rebuild(const Scene<float>& scene, const std::string& rebuild);

/// Finds all contacts of a clip of triangles, keyframe by keyframe, by the paper's separation list, by swept
/// boxes of a refitted tree, and in every eighth interval by testing all pairs.
SweepRun measure_sweeps(const Scene<float>& scene);

/// Plays a clip of vertices on curves through the kinetic AABB tree, at 1 and at 10 frames per keyframe, and
/// the same clip with lines between its keyframes. Compares the pairs of every frame with the oracle's.
MotionRun measure_motion(const Scene<float>& scene);

}  // namespace kbvh::theory
