#pragma once
#include <cmath>
#include <cstdint>

#include "tests/support/grids.hpp"

namespace kbvh::test {

/// Two sheets with waves that run through each other, along x and along y: slabs turn from keyframe to
/// keyframe.
template <class S>
Scene<S> crossing_waves() {
  constexpr std::uint32_t n = 24, keyframes = 4;
  Scene<S> scene;
  for (const int along : {0, 1})
    scene.bodies.push_back(
        placed_grid<S>(n, keyframes, [&](std::uint32_t k, std::uint32_t i, std::uint32_t j, int axis) {
          const double x = i / double(n), y = j / double(n);
          return axis == 0 ? x : axis == 1 ? y : 0.2 * std::sin(9 * (along == 0 ? x : y) + 1.3 * k);
        }));
  scene.pairs = all_pairs(scene.bodies);
  return scene;
}

/// Two sheets in the plane 3 x + 5 y = 7 z, `far` from the origin: a third of the vertices of the second one
/// lie exactly in that plane, inside triangles of the first one, and the others below. The plane's normal
/// cannot be represented in S.
template <class S>
Scene<S> touching_sheets(double far) {
  constexpr std::uint32_t n = 24;
  Scene<S> scene;
  for (const int body : {0, 1})
    scene.bodies.push_back(
        placed_grid<S>(n, 1, [&](std::uint32_t, std::uint32_t i, std::uint32_t j, int axis) {
          const double a = far + (i + 0.25 * body) / 16, b = far + (j + 0.25 * body) / 16;
          const double below = body == 1 && (i + j) % 3 != 0 ? 0.125 : 0;
          return axis == 0 ? 7 * a : axis == 1 ? 7 * b : 3 * a + 5 * b - below;
        }));
  scene.pairs = all_pairs(scene.bodies);
  return scene;
}

}  // namespace kbvh::test
