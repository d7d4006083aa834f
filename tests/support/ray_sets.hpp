#pragma once
#include <algorithm>
#include <cstdint>
#include <random>
#include <vector>

#include "core/geometry/lane_box.hpp"
#include "core/scene/playback.hpp"
#include "core/scene/rays.hpp"

// Rays for tests: through the space of a scene, and at the corners, edges and planes of its boxes and
// primitives.

namespace kbvh::test {

/// Returns `count` rays of each kind at the playback's current positions.
template <class S>
std::vector<Ray<S>> rays_at(const Scene<S>& scene, const Playback<S>& playback, std::uint32_t count,
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
  const auto share = [&] { return double(random() >> 8) / double(1 << 24); };
  const auto point = [&] { return points[random() % points.size()]; };
  const auto inside = [&](S* out, double beyond) {
    for (int axis = 0; axis < 3; ++axis) {
      const double low = double(whole.lower[axis]), high = double(whole.upper[axis]);
      out[axis] = S(low + (high - low) * (share() * (1 + 2 * beyond) - beyond));
    }
  };
  const auto towards = [](Ray<S>& ray, const S* target) {
    for (int axis = 0; axis < 3; ++axis) ray.direction[axis] = S(target[axis] - ray.origin[axis]);
  };
  std::vector<Ray<S>> rays;
  for (std::uint32_t i = 0; i < count; ++i) {
    Ray<S> ray{};
    ray.length = std::numeric_limits<S>::infinity();
    S target[3];
    // Through the scene, without and with an end.
    inside(ray.origin, 0.5);
    inside(target, 0);
    towards(ray, target);
    rays.push_back(ray);
    ray.length = S(1);
    rays.push_back(ray);
    // At a corner, as far as the direction can be represented; and no further than there.
    ray.length = std::numeric_limits<S>::infinity();
    towards(ray, point());
    rays.push_back(ray);
    ray.length = S(1);
    rays.push_back(ray);
    // From a corner to another one: often along edges and in planes.
    std::copy_n(point(), 3, ray.origin);
    ray.length = std::numeric_limits<S>::infinity();
    towards(ray, point());
    rays.push_back(ray);
    // Along an axis, through a corner and therefore along the sides of boxes, from the front and from behind.
    std::copy_n(point(), 3, ray.origin);
    const int axis = int(random() % 3);
    std::fill_n(ray.direction, 3, S(0));
    ray.direction[axis] = random() % 2 == 0 ? S(1) : S(-1);
    ray.origin[axis] = ray.direction[axis] > 0 ? whole.lower[axis] : whole.upper[axis];
    rays.push_back(ray);
    // In a plane of two axes through a corner.
    std::copy_n(point(), 3, ray.origin);
    ray.direction[(axis + 1) % 3] = S(share() - 0.5);
    rays.push_back(ray);
    // A point.
    std::copy_n(point(), 3, ray.origin);
    std::fill_n(ray.direction, 3, S(0));
    rays.push_back(ray);
  }
  // Scenes may extend to the admissible limit.
  for (Ray<S>& ray : rays)
    for (S* const values : {ray.origin, ray.direction})
      for (int axis = 0; axis < 3; ++axis)
        values[axis] = std::clamp(values[axis], -admissible_magnitude<S>, admissible_magnitude<S>);
  return rays;
}

}  // namespace kbvh::test
