#pragma once
#include <cstdint>
#include <utility>
#include <vector>

#include "core/scene/scene.hpp"
#include "tests/support/synthetic_scenes.hpp"

// Scenes whose trees age, or stay young, as fast as a test requires.

namespace kbvh::test {

enum class Flight {
  anywhere,      ///< each triangle to its own place
  side_by_side,  ///< all the same way
  outwards,      ///< the body grows
};

/// Two bodies of triangles of all directions in a cube.
inline Scene<float> flying_triangles(std::uint32_t count, std::uint32_t keyframes, Flight flight,
                                     double size = 0.03) {
  Scene<float> scene;
  Random random(7);
  for (int body = 0; body < 2; ++body) {
    Body<float> made;
    std::vector<double> times, ways(6 * count), shapes(9 * count);
    for (double& x : ways) x = random.unit();
    for (double& x : shapes) x = size * random.unit();
    // Neighbours in space begin as neighbours in the list, in a row: a tree built at the start is good.
    for (std::uint32_t i = 0; i < count; ++i) {
      ways[6 * i] = 2.0 * i / count - 1;
      for (int axis = 0; axis < 3; ++axis) {
        const double begin = ways[6 * i + axis];
        if (flight == Flight::side_by_side) ways[6 * i + 3 + axis] = begin + 0.1 * (body + 1);
        if (flight == Flight::outwards) ways[6 * i + 3 + axis] = 1.2 * begin;
      }
      made.primitives.add(std::vector<std::uint32_t>{3 * i, 3 * i + 1, 3 * i + 2});
    }
    std::vector<float> positions;
    for (std::uint32_t k = 0; k < keyframes; ++k) {
      times.push_back(k);
      const double share = double(k) / (keyframes - 1);
      for (std::uint32_t i = 0; i < count; ++i)
        for (int corner = 0; corner < 3; ++corner)
          for (int axis = 0; axis < 3; ++axis)
            positions.push_back(float(ways[6 * i + axis] * (1 - share) + ways[6 * i + 3 + axis] * share +
                                      shapes[9 * i + 3 * corner + axis]));
    }
    made.plans = FlightPlans<float>(3 * count, std::move(times), std::move(positions));
    scene.bodies.push_back(std::move(made));
  }
  scene.pairs = all_pairs(scene.bodies);
  return scene;
}

}  // namespace kbvh::test
