#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <vector>

#include "core/motion/admissible.hpp"
#include "core/scene/playback.hpp"
#include "core/scene/probes.hpp"

// Balls for tests: through the space of a scene, and such that vertices lie on their surfaces or nearby.

namespace kbvh::test {

/// Returns `count` balls of each kind at the playback's current positions.
template <class S>
std::vector<Ball<S>> balls_at(const Scene<S>& scene, const Playback<S>& playback, std::uint32_t count,
                              std::uint32_t seed) {
  std::mt19937 random(seed);
  Box<S> whole;
  std::vector<const S*> points;
  for (std::uint32_t body = 0; body < scene.bodies.size(); ++body)
    for (std::uint32_t v = 0; v < scene.bodies[body].plans.vertex_count(); ++v) {
      points.push_back(playback.positions(body) + std::size_t(3) * v);
      whole.extend(points.back());
    }
  if (points.empty()) return {};
  double size = 0;
  for (int axis = 0; axis < 3; ++axis)
    size = std::max(size, double(whole.upper[axis]) - double(whole.lower[axis]));
  const auto share = [&] { return double(random() >> 8) / double(1 << 24); };
  std::vector<Ball<S>> balls;
  for (std::uint32_t i = 0; i < count; ++i) {
    Ball<S> ball{};
    for (int axis = 0; axis < 3; ++axis)
      ball.centre[axis] = S(double(whole.lower[axis]) + (share() * 1.5 - 0.25) * size);
    ball.radius = S(size * std::pow(10, -3 * share()));
    balls.push_back(ball);
    // At a vertex, without a radius, and with the least one.
    const S* const vertex = points[random() % points.size()];
    std::copy_n(vertex, 3, ball.centre);
    ball.radius = 0;
    balls.push_back(ball);
    ball.radius = std::numeric_limits<S>::min();
    balls.push_back(ball);
    // With a vertex on its surface, as far as 3, 4 and 5 times a power of two can be added; and a unit in the
    // last place closer and farther.
    const S unit = S(std::ldexp(1.0, std::ilogb(size) - 3 - int(random() % 6)));
    ball.centre[random() % 2] += 3 * unit;
    ball.centre[2] -= 4 * unit;
    ball.radius = 5 * unit;
    balls.push_back(ball);
    const S radius = ball.radius;
    ball.radius = std::nextafter(radius, S(0));
    balls.push_back(ball);
    ball.radius = std::nextafter(radius, 2 * radius);
    balls.push_back(ball);
  }
  for (Ball<S>& ball : balls) {
    const S most = admissible_magnitude<S>;
    for (S& coordinate : ball.centre) coordinate = std::clamp(coordinate, -most, most);
    ball.radius = std::min(ball.radius, most);
  }
  return balls;
}

}  // namespace kbvh::test
