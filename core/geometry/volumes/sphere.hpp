#pragma once
#include <algorithm>
#include <limits>

#include "core/geometry/volumes/bounding_volume.hpp"
#include "core/geometry/volumes/exact_sides.hpp"
#include "core/geometry/volumes/outward.hpp"

namespace kbvh {

/// A ball: the points at most `radius` from the centre; empty if the radius is negative. 4 scalars.
///
/// Rounding: the centre may be any point, so only radii are rounded. A distance is computed in double, at
/// most 32 units of double above the exact one, and then rounded up to S. `overlap` errs to true for balls
/// that are less than 32 units of double apart (relative to their distance), and where squares underflow in
/// double. A ball of balls is larger than the ball of the points below: a bottom-up refit is conservative,
/// not tight.
template <class S>
struct Sphere {
  using Scalar = S;
  S centre[3] = {0, 0, 0};
  S radius = -1;

  bool empty() const { return radius < 0; }
  bool operator==(const Sphere&) const = default;
};

/// Grows a ball until it contains all points (Ritter 1990): it starts with two distant points and moves
/// towards each point outside. The radius is then measured again around the last centre. In practice at most
/// about 20 % larger than the smallest ball. O(points).
template <class S>
void fit(Sphere<S>& sphere, PointSet<S> points) {
  sphere = Sphere<S>{};
  if (points.size() == 0) return;
  const auto furthest_from = [&](const S* from) {
    const S* furthest = from;
    double distance = 0;
    for (std::size_t i = 0; i < points.size(); ++i) {
      double way[3];
      outward::difference(points[i], from, way);
      const double length = outward::length_above(way);
      if (!(length > distance)) continue;
      distance = length;
      furthest = points[i];
    }
    return furthest;
  };
  const S *const a = furthest_from(points[0]), *const b = furthest_from(a);
  double centre[3], way[3];
  for (std::size_t d = 0; d < 3; ++d) centre[d] = 0.5 * double(a[d]) + 0.5 * double(b[d]);
  outward::difference(a, centre, way);
  double radius = outward::length_above(way);
  for (std::size_t i = 0; i < points.size(); ++i) {
    outward::difference(points[i], centre, way);
    const double distance = outward::length_above(way);
    if (!(distance > radius)) continue;
    const double grown = 0.5 * (radius + distance);
    for (std::size_t d = 0; d < 3; ++d) centre[d] += (distance - grown) / distance * way[d];
    radius = grown;
  }
  for (std::size_t d = 0; d < 3; ++d) sphere.centre[d] = S(centre[d]);
  sphere.radius = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    outward::difference(points[i], sphere.centre, way);
    sphere.radius = std::max(sphere.radius, outward::up<S>(outward::length_above(way)));
  }
}

/// Computes the smallest ball around two balls, then around the result and the next ball, and so on. The
/// radius is measured again around the last centre. The result is the smallest ball for two, up to rounding.
template <class S>
void enclose(Sphere<S>& sphere, std::span<const Sphere<S>> children) {
  double centre[3] = {0, 0, 0}, radius = -1, way[3];
  for (const Sphere<S>& child : children) {
    if (child.empty()) continue;
    outward::difference(child.centre, centre, way);
    const double distance = outward::length_above(way), child_radius = double(child.radius);
    if (radius < 0 || distance + radius <= child_radius) {
      std::copy_n(child.centre, 3, centre);
      radius = child_radius;
    } else if (distance + child_radius > radius) {
      const double grown = 0.5 * (distance + radius + child_radius);
      for (std::size_t d = 0; d < 3; ++d) centre[d] += (grown - radius) / distance * way[d];
      radius = grown;
    }
  }
  Sphere<S> all;
  if (!(radius < 0)) {
    for (std::size_t d = 0; d < 3; ++d) all.centre[d] = S(centre[d]);
    all.radius = 0;
  }
  for (const Sphere<S>& child : children) {
    if (child.empty()) continue;
    outward::difference(child.centre, all.centre, way);
    const outward::Rounded reach = outward::two_sum(outward::length_above(way), double(child.radius));
    all.radius = std::max(all.radius, outward::up<S>(reach));
  }
  sphere = all;
}

template <class S>
bool overlap(const Sphere<S>& a, const Sphere<S>& b) {
  if (a.empty() || b.empty()) return false;
  double way[3];
  outward::difference(b.centre, a.centre, way);
  const double distance = way[0] * way[0] + way[1] * way[1] + way[2] * way[2];
  const double reach = double(a.radius) + double(b.radius);
  // Squares: 5 roundings of the distance, 3 of the reach, and the squarings themselves; each loses less than
  // `least` by underflow.
  return !(distance * (1 - 16 * outward::unit_roundoff) >
           reach * reach * (1 + 16 * outward::unit_roundoff) + 16 * outward::least);
}

template <class S>
double surface_area(const Sphere<S>& sphere) {
  constexpr double pi = 3.14159265358979323846;
  return sphere.empty() ? 0 : 4 * pi * double(sphere.radius) * double(sphere.radius);
}

/// Returns the distance from the surface; infinity if the sphere is empty or a number of it is not finite.
template <class S>
double protrusion(const Sphere<S>& sphere, const double* point) {
  const double centre[3] = {double(sphere.centre[0]), double(sphere.centre[1]), double(sphere.centre[2])};
  const double radius = double(sphere.radius);
  const bool finite = std::isfinite(centre[0]) && std::isfinite(centre[1]) && std::isfinite(centre[2]) &&
                      std::isfinite(radius);
  if (sphere.empty() || !finite) return std::numeric_limits<double>::infinity();
  if (side_of_sphere(centre, radius, point) <= 0) return 0;
  double way[3];
  outward::difference(point, centre, way);
  return std::max(outward::length_above(way) - radius, outward::least);
}

template <class S>
Box<double> enclosing_box(const Sphere<S>& sphere) {
  Box<double> box;
  if (sphere.empty()) return box;
  for (std::size_t d = 0; d < 3; ++d) {
    box.lower[d] = outward::down<double>(outward::two_sum(double(sphere.centre[d]), -double(sphere.radius)));
    box.upper[d] = outward::up<double>(outward::two_sum(double(sphere.centre[d]), double(sphere.radius)));
  }
  return box;
}

static_assert(BoundingVolume<Sphere<float>> && BoundingVolume<Sphere<double>>);

}  // namespace kbvh
