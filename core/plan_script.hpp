#pragma once
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/hasher.hpp"
#include "core/motion/flight_plans.hpp"

namespace kbvh {

/// Plan changes to be made at run time, at frames: the same script is replayed to every contestant.
template <class S>
struct PlanScript {
  struct Step {
    double time;  ///< of a frame; the changes are made after its query
    std::vector<PlanChange<S>> changes;
  };
  std::vector<Step> steps;  ///< ascending times

  bool empty() const { return steps.empty(); }
  /// Changes of single vertices that are made up to and including t.
  std::size_t changes_until(double t) const {
    std::size_t count = 0;
    for (const Step& step : steps)
      if (step.time <= t) count += step.changes.size();
    return count;
  }
};

/// A 64-bit hash of everything in a script; 0 for an empty one.
template <class S>
std::uint64_t hash(const PlanScript<S>& script) {
  if (script.empty()) return 0;
  Hasher hasher;
  hasher.mix(sizeof(S));
  for (const auto& step : script.steps) {
    hasher.bytes(&step.time, sizeof step.time);
    hasher.mix(step.changes.size());
    for (const PlanChange<S>& change : step.changes) {
      hasher.mix((std::uint64_t(change.body) << 32) | change.vertex);
      hasher.list(change.times);
      hasher.list(change.positions);
      hasher.bytes(change.velocity, sizeof change.velocity);
    }
  }
  return hasher.value();
}

/// Walks through a script frame by frame.
template <class S>
class ScriptCursor {
 public:
  /// At the script's beginning; nullptr is a script without steps.
  explicit ScriptCursor(const PlanScript<S>* script) : script_(script) {}

  /// The changes to be made after the query of the frame at t; frames are to come in order. Throws
  /// std::invalid_argument if a step was passed over, because its time is not a frame's.
  std::span<const PlanChange<S>> at(double t) {
    if (script_ == nullptr || next_ == script_->steps.size()) return {};
    const auto& step = script_->steps[next_];
    if (t < step.time) return {};
    if (!(t == step.time))
      throw std::invalid_argument("the script changes plans at t = " + std::to_string(step.time) +
                                  ", which is not the time of a frame (the next one is at " +
                                  std::to_string(t) + ")");
    ++next_;
    return step.changes;
  }

 private:
  const PlanScript<S>* script_;
  std::size_t next_ = 0;
};

}  // namespace kbvh
