#pragma once
#include <filesystem>

#include "core/judge/plan_script.hpp"
#include "core/scene/scene.hpp"
#include "experiments/scenes/builtin_scenes.hpp"

namespace kbvh::experiments {

/// Returns the times of the frames at which a rule is recorded.
std::vector<double> frames_of(const ReversalRule& rule);

/// Runs the scene frame by frame with the oracle (`sweep_pairs`) and records the plan changes of the rule
/// after each frame. The initial plan of a vertex is its velocity, to be negated and restored: from its first
/// keyframe to its second, rounded to the scalar once. The last frame changes nothing. Deterministic.
template <class S>
PlanScript<S> record_reversals(const Scene<S>& scene, const ReversalRule& rule,
                               const MakeProgress& progress = {});

/// Returns the same script from `folder` if it was recorded before, or records it now and stores it there;
/// with an empty folder nothing is stored. Damaged files and those of other versions are recorded again.
template <class S>
PlanScript<S> recorded_reversals(const Scene<S>& scene, const ReversalRule& rule,
                                 const std::filesystem::path& folder, const MakeProgress& progress = {});

}  // namespace kbvh::experiments
