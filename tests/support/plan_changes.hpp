#pragma once
#include "core/motion/flight_plans.hpp"

namespace kbvh::test {

/// Makes a vertex fly on with a velocity from the time of the change.
template <class S>
PlanChange<S> flies(std::uint32_t body, std::uint32_t vertex, S x, S y, S z) {
  PlanChange<S> change;
  change.body = body;
  change.vertex = vertex;
  change.velocity[0] = x;
  change.velocity[1] = y;
  change.velocity[2] = z;
  return change;
}

}  // namespace kbvh::test
