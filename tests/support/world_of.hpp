#pragma once
#include <span>
#include <vector>

#include "core/facade/world.hpp"
#include "core/scene/scene.hpp"

namespace kbvh::test {

/// Makes a world of a scene's bodies and pairs.
template <class S>
World world_of(const Scene<S>& scene) {
  World world(sizeof(S) == 4 ? Precision::float32 : Precision::float64);
  for (const Body<S>& body : scene.bodies) {
    const FlightPlans<S>& plans = body.plans;
    const std::vector<S> positions(
        plans.keyframe(0),
        plans.keyframe(0) + std::size_t(3) * plans.keyframed_count() * plans.keyframe_count());
    world.add_body(body.name, {body.primitives.vertices, body.primitives.offsets}, plans.keyframe_times(),
                   std::span<const S>(positions));
  }
  for (const BodyPair& pair : scene.pairs) world.add_pair(pair.first, pair.second);
  return world;
}

/// Returns the positions of a horizontal triangle.
inline std::vector<float> triangle_at(float z, bool padded = false) {
  std::vector<float> positions{0, 0, z, 1, 0, z, 0, 1, z};
  if (padded) positions.push_back(0);
  return positions;
}

}  // namespace kbvh::test
