#pragma once
#include <cmath>
#include <cstdint>
#include <vector>

#include "core/scene/scene.hpp"

namespace kbvh::test {

/// A grid of 2 n^2 triangles with keyframes at 0, 1, ...; position(k, i, j, axis) places vertex (i, j).
template <class S, class Position>
Body<S> placed_grid(std::uint32_t n, std::uint32_t keyframes, const Position& position) {
  Body<S> body;
  std::vector<double> times;
  std::vector<S> positions;
  for (std::uint32_t k = 0; k < keyframes; ++k) {
    times.push_back(k);
    for (std::uint32_t j = 0; j <= n; ++j)
      for (std::uint32_t i = 0; i <= n; ++i)
        for (int axis = 0; axis < 3; ++axis) positions.push_back(S(position(k, i, j, axis)));
  }
  for (std::uint32_t j = 0; j < n; ++j)
    for (std::uint32_t i = 0; i < n; ++i) {
      const std::uint32_t a = j * (n + 1) + i, b = a + n + 1;
      body.primitives.add(std::vector<std::uint32_t>{a, a + 1, b});
      body.primitives.add(std::vector<std::uint32_t>{b, a + 1, b + 1});
    }
  body.plans = FlightPlans<S>((n + 1) * (n + 1), std::move(times), std::move(positions));
  return body;
}

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
/// cannot be written as S.
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
