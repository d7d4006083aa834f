#pragma once
#include "core/judge/plan_script.hpp"
#include "core/scene/scene.hpp"
#include "experiments/scenes/builtin_scenes.hpp"

namespace kbvh::experiments {

/// Returns the times of the frames at which a rule applies.
std::vector<double> frames_of(const DragRule& rule);

/// Makes the plan changes of a rule: after every frame but the last, each held vertex starts on a new line
/// that adds the hand's motion until the next frame, times the vertex's weight, to the motion that its
/// keyframes give it. Deterministic. O(frames x held vertices).
template <class S>
PlanScript<S> drag_script(const Scene<S>& scene, const DragRule& rule);

}  // namespace kbvh::experiments
