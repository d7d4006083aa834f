#pragma once
#include <functional>

#include "experiments/stress/scene.hpp"

namespace kbvh::experiments::stress {

/// How much may be tried.
struct ShrinkBudget {
  std::size_t tries = 3000;
  double seconds = 60;  ///< of time; looked at between tries
};

/// Makes a scene smaller as long as `fails` says that it still fails: fewer bodies, steps, changes,
/// keyframes, frames, primitives and vertices (halves first, then quarters, down to single ones), then zeros
/// and rounder numbers. `fails(scene)` holds at the beginning, and of what is returned. Ends when nothing
/// more goes, or the budget is used up.
StressScene shrink(StressScene scene, const std::function<bool(const StressScene&)>& fails,
                   const ShrinkBudget& budget = {});

}  // namespace kbvh::experiments::stress
