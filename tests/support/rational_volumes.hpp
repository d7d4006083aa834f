#pragma once
#include <array>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include "core/geometry/volumes/aligned_box.hpp"
#include "core/geometry/volumes/dop.hpp"
#include "core/geometry/volumes/obb.hpp"
#include "core/geometry/volumes/sphere.hpp"
#include "tests/support/rational_geometry.hpp"
#include "tests/support/synthetic_scenes.hpp"

// Bounding volumes in rational arithmetic, from their definitions, and clouds of points to fit them to.

namespace kbvh::test {

// Membership from the definitions, in rationals.

template <class T>
RationalPoint rational(const T* p) {
  return {exact(double(p[0])), exact(double(p[1])), exact(double(p[2]))};
}
inline Rational magnitude(const Rational& x) {
  return x < 0 ? Rational(-x) : x;
}

template <class S>
bool contains(const Box<S>& box, const RationalPoint& p) {
  for (std::size_t d = 0; d < 3; ++d)
    if (p[d] < exact(double(box.lower[d])) || p[d] > exact(double(box.upper[d]))) return false;
  return true;
}
template <class S, int K>
bool contains(const Dop<S, K>& dop, const RationalPoint& p) {
  for (std::size_t i = 0; i < dop.slabs; ++i) {
    const auto& n = dop.directions[i];
    const Rational along = n[0] * p[0] + n[1] * p[1] + n[2] * p[2];
    if (along < exact(double(dop.lower[i])) || along > exact(double(dop.upper[i]))) return false;
  }
  return true;
}
template <class S>
bool contains(const Sphere<S>& sphere, const RationalPoint& p) {
  const RationalPoint way = minus(p, rational(sphere.centre));
  const Rational radius = exact(double(sphere.radius));
  return dot(way, way) <= radius * radius;
}
template <class S>
bool contains(const Obb<S>& box, const RationalPoint& p) {
  const RationalPoint way = minus(p, rational(box.centre));
  for (std::size_t i = 0; i < 3; ++i)
    if (magnitude(dot(rational(box.axis[i]), way)) > exact(double(box.half[i]))) return false;
  return true;
}

inline RationalPoint times(const Rational& factor, const RationalPoint& p) {
  return {factor * p[0], factor * p[1], factor * p[2]};
}
inline RationalPoint plus(const RationalPoint& a, const RationalPoint& b) {
  return {a[0] + b[0], a[1] + b[1], a[2] + b[2]};
}

/// The edges of an oriented box as it is defined, from its centre to the middle of each side: a
/// parallelepiped.
template <class S>
std::array<RationalPoint, 3> half_edges(const Obb<S>& box) {
  const RationalPoint a = rational(box.axis[0]), b = rational(box.axis[1]), c = rational(box.axis[2]);
  const Rational determinant = dot(a, cross(b, c));
  return {times(exact(double(box.half[0])) / determinant, cross(b, c)),
          times(exact(double(box.half[1])) / determinant, cross(c, a)),
          times(exact(double(box.half[2])) / determinant, cross(a, b))};
}

// Returns whether a volume contains another one of its kind.
template <class S>
bool contains(const Box<S>& box, const Box<S>& inner) {
  return box.contains(inner);
}
template <class S, int K>
bool contains(const Dop<S, K>& dop, const Dop<S, K>& inner) {
  for (std::size_t i = 0; i < dop.slabs; ++i)
    if (inner.lower[i] < dop.lower[i] || inner.upper[i] > dop.upper[i]) return false;
  return true;
}
template <class S>
bool contains(const Sphere<S>& sphere, const Sphere<S>& inner) {
  const RationalPoint way = minus(rational(inner.centre), rational(sphere.centre));
  const Rational room = exact(double(sphere.radius)) - exact(double(inner.radius));
  return room >= 0 && dot(way, way) <= room * room;
}
template <class S>
bool contains(const Obb<S>& box, const Obb<S>& inner) {
  const auto edges = half_edges(inner);
  for (int corner = 0; corner < 8; ++corner) {
    RationalPoint p = rational(inner.centre);
    for (std::size_t i = 0; i < 3; ++i) p = plus(p, times(((corner >> i) & 1) ? 1 : -1, edges[i]));
    if (!contains(box, p)) return false;
  }
  return true;
}

/// Clouds of points: of a shape, at a place and a scale.
enum class Shape { cloud, point, axis_line, line, axis_plane, plane, two_points };
inline constexpr Shape shapes[] = {Shape::cloud,      Shape::point, Shape::axis_line, Shape::line,
                                   Shape::axis_plane, Shape::plane, Shape::two_points};

struct Place {
  double offset, scale;
};
template <class S>
std::vector<Place> places() {
  std::vector<Place> places{{0, 1}, {1e6, 1}, {1e6, 1e-2}, {0, 1e-30}, {0, 1e20}, {3, 1e-6}};
  if (sizeof(S) == 8) places.insert(places.end(), {{0, 1e-200}, {0, 1e-310}, {1e90, 1e80}});
  if (sizeof(S) == 4) places.insert(places.end(), {{0, 1e-40}, {0, 1e29}});
  return places;
}

template <class S>
std::vector<S> points_of(Shape shape, const Place& place, std::size_t count, Random& random) {
  std::vector<S> points;
  const double u[3] = {random.unit(), random.unit(), random.unit()};
  const double v[3] = {random.unit(), random.unit(), random.unit()};
  for (std::size_t i = 0; i < count; ++i) {
    const double a = random.unit(), b = random.unit();
    for (std::size_t d = 0; d < 3; ++d) {
      double x = 0;
      switch (shape) {
        case Shape::cloud:
          x = random.unit();
          break;
        case Shape::point:
          x = u[d];
          break;
        case Shape::axis_line:
          x = d == 1 ? a : u[d];
          break;
        case Shape::line:
          x = a * u[d];
          break;
        case Shape::axis_plane:
          x = d == 2 ? u[d] : (d == 0 ? a : b);
          break;
        case Shape::plane:
          x = a * u[d] + b * v[d];
          break;
        case Shape::two_points:
          x = i % 2 == 0 ? u[d] : v[d];
          break;
      }
      points.push_back(S(place.offset * (1 + 0.1 * double(d)) + place.scale * x));
    }
  }
  return points;
}
template <class S>
PointSet<S> all(const std::vector<S>& points) {
  return PointSet<S>(points.data(), points.size() / 3);
}
template <class S>
const S* at(const std::vector<S>& points, std::size_t i) {
  return points.data() + 3 * i;
}

/// Calls work(points, where) for clouds of all shapes at all places.
template <class S, class Work>
void for_clouds(std::uint64_t seed, const Work& work) {
  Random random(seed);
  for (const Shape shape : shapes)
    for (const Place& place : places<S>())
      for (const std::size_t count : {1u, 2u, 3u, 4u, 20u})
        work(points_of<S>(shape, place, count, random),
             "shape " + std::to_string(int(shape)) + " at " + std::to_string(place.offset) + ", scale 1e" +
                 std::to_string(std::log10(place.scale)) + ", " + std::to_string(count) + " points",
             random);
}

}  // namespace kbvh::test
