#pragma once
#include <filesystem>

#include "core/judge/plan_script.hpp"
#include "core/scene/scene.hpp"
#include "experiments/scenes/builtin_scenes.hpp"

namespace kbvh::experiments {

/// Times of the frames that a rule is recorded at.
std::vector<double> frames_of(const ReversalRule& rule);

/// Runs the scene frame by frame with the oracle (`sweep_pairs`) and writes down what the rule does after
/// each frame. Of each vertex the plan at the start is its velocity, to be negated and restored: its first
/// keyframe to its second, rounded to the scalar once. The last frame changes nothing. Deterministic.
template <class S>
PlanScript<S> record_reversals(const Scene<S>& scene, const ReversalRule& rule,
                               const MakeProgress& progress = {});

/// The same from `folder`, if it was recorded before, or recorded now and kept there; an empty folder keeps
/// nothing. Damaged files and those of other versions are made anew.
template <class S>
PlanScript<S> recorded_reversals(const Scene<S>& scene, const ReversalRule& rule,
                                 const std::filesystem::path& folder, const MakeProgress& progress = {});

}  // namespace kbvh::experiments
