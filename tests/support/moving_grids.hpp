#pragma once
#include "tests/support/grids.hpp"
#include "tests/support/play.hpp"

namespace kbvh::test {

/// A grid of 2 n^2 triangles with its lower left corner at (x, y, 0), and keyframes at 0, 1, ... that move
/// vertex (i, j) by step(i) along z from one to the next.
template <class S, class Step>
Body<S> grid(std::uint32_t n, double x, double y, std::uint32_t keyframes, Step&& step) {
  return placed_grid<S>(n, keyframes,
                        [&](std::uint32_t k, std::uint32_t i, std::uint32_t j, int axis) -> double {
                          return axis == 0 ? x + i / double(n) : axis == 1 ? y + j / double(n) : k * step(i);
                        });
}

/// A grid that moves and one at rest, `apart` from it along x.
template <class S, class Step>
Scene<S> grids(std::uint32_t n, double apart, Step&& step) {
  Scene<S> scene;
  scene.bodies.push_back(grid<S>(n, 0, 0, 3, step));
  scene.bodies.push_back(grid<S>(n, apart, 0.01, 1, [](std::uint32_t) { return 0.0; }));
  scene.pairs = all_pairs(scene.bodies);
  return scene;
}

/// Steps: all vertices move, or those on the left side only.
inline constexpr auto lifted = [](std::uint32_t) { return 1.0; };
inline constexpr auto left_side = [](std::uint32_t i) { return i == 0 ? 0.01 : 0.0; };

}  // namespace kbvh::test
