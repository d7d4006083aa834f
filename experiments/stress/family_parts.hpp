#pragma once
#include <algorithm>
#include <cmath>
#include <functional>
#include <initializer_list>

#include "experiments/scenes/shapes.hpp"
#include "experiments/stress/families.hpp"

/// The building blocks of the families (families.cpp).
namespace kbvh::experiments::stress {

/// A seeded stream that is the same on every platform.
class Random {
 public:
  explicit Random(std::uint64_t seed) : noise_(seed) {}
  std::uint32_t below(std::uint32_t n) { return std::uint32_t((noise_.bits(next_++) >> 11) % n); }
  double unit() { return noise_.signed_unit(next_++); }
  bool one_in(std::uint32_t n) { return below(n) == 0; }
  template <class T>
  T among(std::initializer_list<T> values) {
    return values.begin()[below(std::uint32_t(values.size()))];
  }

 private:
  scenes::SeededNoise noise_;
  std::uint64_t next_ = 0;
};

/// Returns fewer keyframes where each segment has many frames: all l cost about the same.
inline std::uint32_t keyframes_for(const FamilySetting& setting) {
  return setting.l >= 50 ? 2 : setting.l >= 5 ? 4 : 8;
}

inline StressBody unmoved(std::uint32_t vertices) {
  StressBody body;
  body.vertex_count = vertices;
  body.positions.assign(std::size_t(3) * vertices, 0.0);
  return body;
}

/// Makes a body of `triangles` triangles without common vertices, with the points given by `at`.
using Point = std::function<double(std::uint32_t keyframe, std::uint32_t vertex, int axis)>;
inline StressBody soup_of(std::uint32_t triangles, std::uint32_t keyframes, const Point& at) {
  StressBody body;
  body.vertex_count = 3 * triangles;
  for (std::uint32_t p = 0; p < triangles; ++p) body.primitives.push_back({3 * p, 3 * p + 1, 3 * p + 2});
  body.times.clear();
  for (std::uint32_t k = 0; k < keyframes; ++k) {
    body.times.push_back(0.25 * k);
    for (std::uint32_t v = 0; v < body.vertex_count; ++v)
      for (int axis = 0; axis < 3; ++axis) body.positions.push_back(at(k, v, axis));
  }
  return body;
}

/// Makes triangles of one size scattered in [-1, 1]^3, every vertex on a random walk.
inline StressBody soup(Random& random, std::uint32_t triangles, std::uint32_t keyframes, double size = 0.4,
                       double travel = 0.3) {
  std::vector<double> last(std::size_t(9) * triangles);
  double centre[3] = {0, 0, 0};
  for (std::size_t i = 0; i < last.size(); ++i) {
    if (i % 9 == 0)
      for (double& c : centre) c = 0.6 * random.unit();
    last[i] = centre[i % 3] + size * random.unit();
  }
  return soup_of(triangles, keyframes, [&](std::uint32_t k, std::uint32_t v, int axis) {
    double& x = last[std::size_t(3) * v + std::size_t(axis)];
    if (k > 0) x += travel * random.unit();
    return x;
  });
}

/// Makes a connected sheet of 2 (n - 1)^2 triangles.
using SheetPoint = std::function<double(std::uint32_t x, std::uint32_t y, std::uint32_t k, int axis)>;
inline StressBody sheet(std::uint32_t n, std::uint32_t keyframes, const SheetPoint& at) {
  StressBody body;
  body.vertex_count = n * n;
  for (std::uint32_t y = 0; y + 1 < n; ++y)
    for (std::uint32_t x = 0; x + 1 < n; ++x) {
      const std::uint32_t v = y * n + x;
      body.primitives.push_back({v, v + 1, v + n});
      body.primitives.push_back({v + 1, v + n + 1, v + n});
    }
  body.times.clear();
  for (std::uint32_t k = 0; k < keyframes; ++k) {
    body.times.push_back(k);
    for (std::uint32_t y = 0; y < n; ++y)
      for (std::uint32_t x = 0; x < n; ++x)
        for (int axis = 0; axis < 3; ++axis) body.positions.push_back(at(x, y, k, axis));
  }
  return body;
}

inline StressScene two_soups(Random& random, std::uint32_t triangles, std::uint32_t keyframes) {
  StressScene scene;
  for (int b = 0; b < 2; ++b)
    scene.bodies.push_back(soup(random, triangles / 2 + random.below(triangles), keyframes));
  return scene;
}

inline void for_coordinates(StressScene& scene, const std::function<void(double&)>& change) {
  for (StressBody& body : scene.bodies)
    for (double& x : body.positions) change(x);
}

/// The families of far_families.cpp.
StressScene far_sheets(const FamilySetting& setting);
StressScene far_vertices(const FamilySetting& setting);

/// Scales the scene so that its largest coordinate is `largest`.
inline void scale_to(StressScene& scene, double largest) {
  double most = 0;
  for_coordinates(scene, [&](double& x) { most = std::max(most, std::abs(x)); });
  if (most > 0) for_coordinates(scene, [&](double& x) { x = x / most * largest; });
}

}  // namespace kbvh::experiments::stress
