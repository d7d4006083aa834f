#pragma once
#include <cstdint>
#include <utility>
#include <vector>

#include "core/scene/scene.hpp"

namespace kbvh::test {

/// Adds the 2 n^2 triangles of a grid of (n + 1)^2 vertices, row by row.
inline void add_grid_triangles(Primitives& primitives, std::uint32_t n) {
  for (std::uint32_t j = 0; j < n; ++j)
    for (std::uint32_t i = 0; i < n; ++i) {
      const std::uint32_t a = j * (n + 1) + i, b = a + n + 1;
      primitives.add(std::vector<std::uint32_t>{a, a + 1, b});
      primitives.add(std::vector<std::uint32_t>{b, a + 1, b + 1});
    }
}

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
  add_grid_triangles(body.primitives, n);
  body.plans = FlightPlans<S>((n + 1) * (n + 1), std::move(times), std::move(positions));
  return body;
}

}  // namespace kbvh::test
