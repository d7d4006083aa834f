#pragma once
#include <span>
#include <utility>
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
    std::vector<double> bends, twists;
    for (std::size_t k = 0; plans.curved() && k + 1 < plans.keyframe_count(); ++k)
      for (const auto& [from, to] : {std::pair(plans.bends(k), &bends), std::pair(plans.twists(k), &twists)})
        for (std::size_t i = 0; i < std::size_t(3) * plans.keyframed_count(); ++i)
          to->push_back(from == nullptr ? 0 : double(from[i]));
    world.add_body(body.name, {body.primitives.vertices, body.primitives.offsets}, plans.keyframe_times(),
                   std::span<const S>(positions), {bends, twists});
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
