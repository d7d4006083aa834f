#pragma once
#include <algorithm>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/base/hasher.hpp"
#include "core/motion/admissible.hpp"
#include "core/scene/geometry_change.hpp"

namespace kbvh {

/// Changes of plans and of geometry at frames, at run time. The same script is replayed to every contestant.
template <class S>
struct PlanScript {
  struct Step {
    double time;  ///< time of a frame; the changes are made after its query
    std::vector<PlanChange<S>> changes{};
    GeometryChange<S> geometry{};  ///< after the plans
  };
  std::vector<Step> steps;  ///< ascending times

  bool empty() const { return steps.empty(); }
  bool changes_plans() const {
    return std::any_of(steps.begin(), steps.end(), [](const Step& step) { return !step.changes.empty(); });
  }
  bool changes_geometry() const {
    return std::any_of(steps.begin(), steps.end(), [](const Step& step) { return !step.geometry.empty(); });
  }
  /// Returns the number of changes of single vertices up to and including t.
  std::size_t changes_until(double t) const {
    std::size_t count = 0;
    for (const Step& step : steps)
      if (step.time <= t) count += step.changes.size();
    return count;
  }
};

/// Computes a 64-bit hash of everything in a script; 0 for an empty one.
template <class S>
std::uint64_t hash(const PlanScript<S>& script) {
  if (script.empty()) return 0;
  Hasher hasher;
  hasher.mix(sizeof(S));
  const auto ids = [&hasher](std::uint32_t body, std::uint32_t id) {
    hasher.mix((std::uint64_t(body) << 32) | id);
  };
  const auto plan = [&hasher](const PlanChange<S>& change) {
    hasher.list(change.times);
    hasher.list(change.positions);
    hasher.bytes(change.velocity, sizeof change.velocity);
  };
  for (const auto& step : script.steps) {
    hasher.bytes(&step.time, sizeof step.time);
    hasher.mix(step.changes.size());
    for (const PlanChange<S>& change : step.changes) {
      ids(change.body, change.vertex);
      plan(change);
    }
    if (step.geometry.empty()) continue;
    for (const auto& vertex : step.geometry.vertices) {
      hasher.mix(vertex.body);
      hasher.bytes(vertex.position, sizeof vertex.position);
      plan(vertex.plan);
    }
    for (const auto& primitive : step.geometry.primitives) {
      hasher.mix(primitive.body);
      hasher.list(primitive.vertices);
    }
    for (const auto& removed : step.geometry.removed_primitives) ids(removed.body, removed.id);
    hasher.mix(step.geometry.removed_primitives.size());
    for (const auto& removed : step.geometry.removed_vertices) ids(removed.body, removed.id);
  }
  return hasher.value();
}

/// Steps through a script frame by frame.
template <class S>
class ScriptCursor {
 public:
  /// Starts at the script's beginning; nullptr stands for a script without steps.
  explicit ScriptCursor(const PlanScript<S>* script) : script_(script) {}

  /// Returns the step to perform after the query of the frame at t, or nullptr. Call it for all frames in
  /// order. Throws std::invalid_argument if a step was skipped because its time is not that of a frame.
  const typename PlanScript<S>::Step* at(double t) {
    if (script_ == nullptr || next_ == script_->steps.size()) return nullptr;
    const auto& step = script_->steps[next_];
    if (t < step.time) return nullptr;
    if (!(t == step.time))
      throw std::invalid_argument("the script makes changes at t = " + number_text(step.time) +
                                  ", which is not the time of a frame (the next one is at " + number_text(t) +
                                  ")");
    ++next_;
    return &step;
  }

 private:
  const PlanScript<S>* script_;
  std::size_t next_ = 0;
};

}  // namespace kbvh
