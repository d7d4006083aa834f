#pragma once
#include "core/judge/plan_script.hpp"
#include "core/judge/session.hpp"

namespace kbvh {

/// Makes a script's changes at the session's current time; nullptr: there are none.
template <class S>
void follow(Session<S>& session, const typename PlanScript<S>::Step* step, PhaseTimes& times) {
  if (step == nullptr) return;
  if (!step->changes.empty()) session.change_plans(step->changes, times);
  if (!step->geometry.empty()) session.change_geometry(step->geometry, times);
}

}  // namespace kbvh
