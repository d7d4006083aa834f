#pragma once
#include <cstdint>
#include <utility>
#include <vector>

#include "core/scene/cut_polygons.hpp"
#include "core/scene/pairs.hpp"
#include "core/scene/scene.hpp"
#include "tests/support/synthetic_scenes.hpp"

namespace kbvh::test {

/// Makes a scene of two soups of polygons with 1 to 5 vertices, some of them shared. They do not move.
/// Coordinates lie on a grid, so that some are equal.
template <class S>
Scene<S> polygon_soups(std::uint32_t primitives, Random& random) {
  const auto unit = [&] { return S(random.below(4096)) / S(2048) - S(1); };
  Scene<S> scene;
  scene.name = "soups";
  for (int body = 0; body < 2; ++body) {
    Body<S> made;
    made.name = "soup";
    std::vector<S> positions;
    std::uint32_t count = 0;
    for (std::uint32_t p = 0; p < primitives; ++p) {
      std::vector<std::uint32_t> corners;
      const S centre[3] = {unit(), unit(), unit()};
      for (std::uint32_t k = 1 + random.below(5); k-- > 0;) {
        if (count > 0 && random.below(4) == 0) {
          corners.push_back(random.below(count));
          continue;
        }
        for (const S c : centre) positions.push_back(c + unit() / S(8) + S(0));
        corners.push_back(count++);
      }
      made.primitives.add(corners);
    }
    made.plans = FlightPlans<S>(count, {0}, std::move(positions));
    scene.bodies.push_back(std::move(made));
  }
  scene.pairs = all_pairs(scene.bodies);
  cut_polygons(scene);
  return scene;
}

}  // namespace kbvh::test
