#pragma once
#include <cmath>
#include <vector>

#include "tests/support/synthetic_scenes.hpp"

namespace kbvh::test {

/// Many small bodies of `triangles` triangles each, in a cube that grows with their number: every body
/// touches a few others, whatever the total. Two of three fly a distance of about their own size, and deform;
/// the third rests.
template <class S>
Scene<S> many_bodies(std::uint32_t count, std::uint32_t triangles, std::uint32_t keyframes = 3) {
  Scene<S> scene;
  scene.name = "many bodies";
  Random random(count);
  const double side = std::cbrt(double(count));
  for (std::uint32_t b = 0; b < count; ++b) {
    Body<S> body;
    body.name = "body" + std::to_string(b);
    const std::uint32_t vertices = triangles + 2, own_keyframes = b % 3 == 2 ? 1 : keyframes;
    double centre[3], step[3];
    for (int axis = 0; axis < 3; ++axis) {
      centre[axis] = 0.5 * side * (1 + random.unit());
      step[axis] = 0.5 * random.unit();
    }
    std::vector<double> corners(std::size_t(3) * vertices), times;
    for (double& x : corners) x = 0.4 * random.unit();
    std::vector<S> positions;
    for (std::uint32_t k = 0; k < own_keyframes; ++k) {
      times.push_back(k);
      for (std::uint32_t v = 0; v < vertices; ++v)
        for (int axis = 0; axis < 3; ++axis)
          positions.push_back(
              S(centre[axis] + k * step[axis] +
                (1 + 0.1 * double(k * (v % 4))) * corners[std::size_t(3) * v + std::size_t(axis)]));
    }
    for (std::uint32_t t = 0; t < triangles; ++t)
      body.primitives.add(std::vector<std::uint32_t>{t, t + 1, t + 2});
    body.plans = FlightPlans<S>(vertices, std::move(times), std::move(positions));
    scene.bodies.push_back(std::move(body));
  }
  scene.pairs = all_pairs(scene.bodies);
  return scene;
}

}  // namespace kbvh::test
