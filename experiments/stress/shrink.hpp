#pragma once
#include <functional>

#include "experiments/stress/scene.hpp"

namespace kbvh::experiments::stress {

/// The limits of shrinking.
struct ShrinkBudget {
  std::size_t tries = 3000;
  double seconds = 60;  ///< checked between attempts
};

/// Shrinks a scene while `fails` still returns true: fewer bodies, steps, changes, keyframes, frames,
/// primitives and vertices (halves first, then quarters, down to single ones), then zeros and rounder
/// numbers. `fails(scene)` must hold at the start and holds for the result. Ends when no reduction is left,
/// or the budget is used up.
StressScene shrink(StressScene scene, const std::function<bool(const StressScene&)>& fails,
                   const ShrinkBudget& budget = {});

}  // namespace kbvh::experiments::stress
