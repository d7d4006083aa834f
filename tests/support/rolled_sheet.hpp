#pragma once
#include <cmath>

#include "tests/support/grids.hpp"

namespace kbvh::test {

/// A scene of one body that asks for the pairs within it: a sheet of 2 n^2 triangles, rolled up almost twice,
/// whose layers cut each other along lines. From keyframe to keyframe it moves by `step` along x, and each
/// vertex by up to `bend` along z.
template <class S>
Scene<S> rolled_sheet(std::uint32_t n, std::uint32_t keyframes, double step, double bend) {
  Scene<S> scene;
  scene.name = "rolled sheet";
  scene.bodies.push_back(placed_grid<S>(
      n, keyframes, [&](std::uint32_t k, std::uint32_t i, std::uint32_t j, int axis) -> double {
        const double turn = 12.0 * i / n, radius = 0.5 + 0.06 * std::cos(2.5 * turn);
        if (axis == 0) return radius * std::cos(turn) + step * k;
        if (axis == 1) return 6.0 * j / n;
        return radius * std::sin(turn) + bend * k * std::sin(3.0 * i + j);
      }));
  scene.pairs = {{0, 0}};
  return scene;
}

}  // namespace kbvh::test
