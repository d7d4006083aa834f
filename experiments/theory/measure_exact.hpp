#pragma once
#include "core/judge/session.hpp"
#include "core/scene/scene.hpp"
#include "experiments/theory/measurements.hpp"

namespace kbvh::theory {

/// Records the clip and checks it against exact envelopes; stops at keyframes and at `instants` times in
/// between for full audits, and checks the touched path at every event. All in exact arithmetic. O(vertices
/// below all nodes x keyframes + changes x vertices below).
ExactRun measure_exact(const Scene<float>& scene, std::uint32_t instants);

/// Plays a clip with changes of plans; audits before and after each, and the envelopes in between.
PlanRun measure_plan_changes(const Scene<float>& scene, const PlanScript<float>& script,
                             std::uint32_t frames_per_keyframe);

}  // namespace kbvh::theory
