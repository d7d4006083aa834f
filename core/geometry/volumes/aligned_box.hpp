#pragma once
#include <algorithm>
#include <cmath>
#include <limits>

#include "core/geometry/volumes/bounding_volume.hpp"

// Box<S> as a bounding volume. Only areas and distances are rounded: the box of points has their least and
// largest coordinates, so a box of boxes is the box of all points below, and a bottom-up refit is tight.

namespace kbvh {

template <class S>
void fit(Box<S>& box, PointSet<S> points) {
  box = Box<S>{};
  for (std::size_t i = 0; i < points.size(); ++i) box.extend(points[i]);
}

template <class S>
void enclose(Box<S>& box, std::span<const Box<S>> children) {
  Box<S> all;
  for (const Box<S>& child : children) all.extend(child);
  box = all;
}

/// Returns the largest protrusion along one axis; a difference of doubles is 0 only if they are equal.
template <class S>
double protrusion(const Box<S>& box, const double* point) {
  if (box.empty()) return std::numeric_limits<double>::infinity();
  double furthest = 0;
  for (int axis = 0; axis < 3; ++axis)
    furthest =
        std::max({furthest, double(box.lower[axis]) - point[axis], point[axis] - double(box.upper[axis])});
  return furthest;
}

template <class S>
Box<double> enclosing_box(const Box<S>& box) {
  return to_double(box);
}

static_assert(BoundingVolume<Box<float>> && BoundingVolume<Box<double>>);

}  // namespace kbvh
