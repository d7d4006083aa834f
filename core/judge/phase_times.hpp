#pragma once
#include <chrono>

namespace kbvh {

/// Seconds of one frame by phase. `motion` is the driver's work, the same for every contestant that needs all
/// positions: evaluating them, and following changes of plans and geometry. The strategy's responses to these
/// changes are separate phases.
struct PhaseTimes {
  double motion = 0, update = 0, traversal = 0, triangle_tests = 0, plan_changes = 0, geometry_changes = 0;
  double query() const { return traversal + triangle_tests; }
  double total() const { return update + traversal + triangle_tests + plan_changes + geometry_changes; }
  PhaseTimes& operator+=(const PhaseTimes& other) {
    motion += other.motion;
    update += other.update;
    traversal += other.traversal;
    triangle_tests += other.triangle_tests;
    plan_changes += other.plan_changes;
    geometry_changes += other.geometry_changes;
    return *this;
  }
};

/// Adds the time that `work` takes to `seconds`.
template <class Work>
void timed(double& seconds, Work&& work) {
  const auto begin = std::chrono::steady_clock::now();
  work();
  seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

}  // namespace kbvh
