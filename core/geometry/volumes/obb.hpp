#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "core/geometry/volumes/bounding_volume.hpp"
#include "core/geometry/volumes/exact_sides.hpp"
#include "core/geometry/volumes/obb_frames.hpp"
#include "core/geometry/volumes/outward.hpp"

namespace kbvh {

/// An oriented box (Gottschalk, Lin and Manocha 1996): the points p with |axis_i . (p - centre)| <= half_i.
/// Empty if half[0] is negative. 15 scalars.
///
/// The axes are orthonormal vectors rounded to S, and the rounded axes define the set. A point can therefore
/// be decided exactly, and the box is a parallelepiped whose angles are off by some units in the last place.
///
/// Rounding: half_i is measured around the rounded centre along the rounded axes, in double with a bound on
/// its error (16 units of double of the sum of absolute products), and then rounded up to S. Operations that
/// need an extent of the box (`enclose`, `overlap`, `enclosing_box`) first enlarge the halves by the axes'
/// deviation from right angles (`obb_reach`). `overlap` tests 15 axes in double with bounds on all errors and
/// errs to true within these bounds. A box of boxes is larger than the box of the points below: a bottom-up
/// refit is conservative, not tight.
template <class S>
struct Obb {
  using Scalar = S;
  S centre[3] = {0, 0, 0};
  S axis[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  S half[3] = {-1, -1, -1};

  bool empty() const { return half[0] < 0; }
  bool operator==(const Obb&) const = default;
};

/// The same box in double, exactly, with halves that cover its extent: the box lies within centre + sum of
/// u_i axis_i, |u_i| <= reach_i.
struct ObbReach {
  double centre[3], axis[3][3], reach[3];
};
/// Computes the reach. O(1). If the axes deviate from right angles by E = A A^T - I, then u = s - E u for s_i
/// = axis_i . (p - centre), so |u_i| <= half_i + 1.1 sum_j |E_ij| half_j for the small E of rounded axes.
template <class S>
ObbReach obb_reach(const Obb<S>& box) {
  ObbReach result;
  for (std::size_t i = 0; i < 3; ++i) {
    result.centre[i] = double(box.centre[i]);
    for (std::size_t d = 0; d < 3; ++d) result.axis[i][d] = double(box.axis[i][d]);
  }
  for (std::size_t i = 0; i < 3; ++i) {
    double more = 0;
    for (std::size_t j = 0; j < 3; ++j) {
      const outward::Bounded at = outward::dot(result.axis[i], result.axis[j]);
      more += (std::fabs(at.value - (i == j ? 1 : 0)) + at.error) * double(box.half[j]);
    }
    const double grown = double(box.half[i]) + 1.1 * more;
    result.reach[i] = more > 0 ? grown * (1 + 8 * outward::unit_roundoff) + outward::least : grown;
  }
  return result;
}

namespace detail {
/// Returns an upper bound of |axis . (p - from)| over the points p of a box.
inline double furthest_along(const double* axis, const double* from, const ObbReach& box) {
  double way[3];
  outward::difference(box.centre, from, way);
  const outward::Bounded middle = outward::dot(axis, way);
  double sum = std::fabs(middle.value) + middle.error;
  for (std::size_t j = 0; j < 3; ++j) {
    if (box.reach[j] == 0) continue;
    const outward::Bounded along = outward::dot(axis, box.axis[j]);
    sum += (std::fabs(along.value) + along.error) * box.reach[j];
  }
  return sum == 0 ? 0 : sum * (1 + 16 * outward::unit_roundoff) + 8 * outward::least;
}

template <class S>
void set_frame(Obb<S>& box, const ObbFrame& frame) {
  for (std::size_t i = 0; i < 3; ++i) {
    box.centre[i] = S(frame.centre[i]);
    for (std::size_t d = 0; d < 3; ++d) box.axis[i][d] = S(frame.axis[i][d]);
    box.half[i] = 0;
  }
}
}  // namespace detail

/// Fits the best of a few frames by surface area: those of Larsson and Källberg 2011 (DiTO-14: triangles and
/// tetrahedra of points that are extreme along seven directions), and the coordinate axes. O(points).
template <class S>
void fit(Obb<S>& box, PointSet<S> points) {
  box = Obb<S>{};
  if (points.size() == 0) return;
  ObbFrames frames;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double point[3] = {double(points[i][0]), double(points[i][1]), double(points[i][2])};
    frames.add_extreme(point);
  }
  frames.choose();
  const auto measure = [&](const double* axis, const double* from) {
    ObbFrames::Interval interval;
    for (std::size_t i = 0; i < points.size(); ++i) {
      double way[3];
      outward::difference(points[i], from, way);
      interval.add(outward::dot(axis, way).value);
    }
    return interval;
  };
  detail::set_frame(box, frames.best(measure));
  double centre[3], axis[3][3];
  std::copy_n(box.centre, 3, centre);
  for (std::size_t i = 0; i < 3; ++i) std::copy_n(box.axis[i], 3, axis[i]);
  for (std::size_t p = 0; p < points.size(); ++p) {
    double way[3];
    outward::difference(points[p], centre, way);
    for (std::size_t i = 0; i < 3; ++i) {
      const outward::Bounded along = outward::dot(axis[i], way);
      // The sum itself rounds, too: by less than the slack of the error's bound.
      box.half[i] = std::max(box.half[i], outward::up<S>(std::fabs(along.value) + along.error));
    }
  }
}

/// Takes the best frame by surface area among the children's frames, the frame of their corners as for
/// points, and the coordinate axes. The extent is measured on the boxes, not on their corners. O(children^2).
template <class S>
void enclose(Obb<S>& box, std::span<const Obb<S>> children) {
  ObbFrames frames;
  for (const Obb<S>& child : children) {
    if (child.empty()) continue;
    const ObbReach extent = obb_reach(child);
    for (int corner = 0; corner < 8; ++corner) {
      double point[3];
      for (std::size_t d = 0; d < 3; ++d) {
        point[d] = extent.centre[d];
        for (std::size_t i = 0; i < 3; ++i)
          point[d] += ((corner >> i) & 1 ? extent.reach[i] : -extent.reach[i]) * extent.axis[i][d];
      }
      frames.add_extreme(point);
    }
  }
  Obb<S> all;
  if (!frames.empty()) {
    frames.choose();
    const auto measure = [&](const double* axis, const double* from) {
      ObbFrames::Interval interval;
      for (const Obb<S>& child : children) {
        if (child.empty()) continue;
        const ObbReach extent = obb_reach(child);
        double way[3];
        outward::difference(extent.centre, from, way);
        const double middle = outward::dot(axis, way).value;
        double around = 0;
        for (std::size_t j = 0; j < 3; ++j)
          around += std::fabs(outward::dot(axis, extent.axis[j]).value) * extent.reach[j];
        interval.add(middle - around);
        interval.add(middle + around);
      }
      return interval;
    };
    ObbFrame best = frames.best(measure);
    for (const Obb<S>& child : children) {
      if (child.empty()) continue;
      double axis[3][3];
      for (std::size_t i = 0; i < 3; ++i) std::copy_n(child.axis[i], 3, axis[i]);
      frames.improve(best, axis, measure);
    }
    detail::set_frame(all, best);
    double centre[3], axis[3][3];
    std::copy_n(all.centre, 3, centre);
    for (std::size_t i = 0; i < 3; ++i) std::copy_n(all.axis[i], 3, axis[i]);
    for (const Obb<S>& child : children) {
      if (child.empty()) continue;
      const ObbReach extent = obb_reach(child);
      for (std::size_t i = 0; i < 3; ++i)
        all.half[i] = std::max(all.half[i], outward::up<S>(detail::furthest_along(axis[i], centre, extent)));
    }
  }
  box = all;
}

namespace detail {
/// Tests whether a direction certainly separates two boxes. Any direction of any length is allowed; it is
/// taken as exact.
inline bool apart_along(const double* direction, const double* way, const ObbReach& a, const ObbReach& b) {
  const outward::Bounded gap = outward::dot(direction, way);
  double reach = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    const outward::Bounded along_a = outward::dot(direction, a.axis[i]),
                           along_b = outward::dot(direction, b.axis[i]);
    reach += (std::fabs(along_a.value) + along_a.error) * a.reach[i] +
             (std::fabs(along_b.value) + along_b.error) * b.reach[i];
  }
  return std::fabs(gap.value) - gap.error - 4 * outward::unit_roundoff * std::fabs(gap.value) >
         reach * (1 + 32 * outward::unit_roundoff) + 64 * outward::least;
}
}  // namespace detail

template <class S>
bool overlap(const Obb<S>& a, const Obb<S>& b) {
  if (a.empty() || b.empty()) return false;
  const ObbReach own_a = obb_reach(a), own_b = obb_reach(b);
  double way[3];
  outward::difference(own_b.centre, own_a.centre, way);
  for (std::size_t i = 0; i < 3; ++i)
    if (detail::apart_along(own_a.axis[i], way, own_a, own_b) ||
        detail::apart_along(own_b.axis[i], way, own_a, own_b))
      return false;
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j) {
      const double *const u = own_a.axis[i], *const v = own_b.axis[j];
      const double direction[3] = {u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2],
                                   u[0] * v[1] - u[1] * v[0]};
      if (detail::apart_along(direction, way, own_a, own_b)) return false;
    }
  return true;
}

/// Computes the surface area as if the axes were at right angles.
template <class S>
double surface_area(const Obb<S>& box) {
  if (box.empty()) return 0;
  const double x = double(box.half[0]), y = double(box.half[1]), z = double(box.half[2]);
  return 8 * (x * y + y * z + z * x);
}

/// Returns the largest protrusion along one axis of the box.
template <class S>
double protrusion(const Obb<S>& box, const double* point) {
  if (box.empty()) return std::numeric_limits<double>::infinity();
  const double centre[3] = {double(box.centre[0]), double(box.centre[1]), double(box.centre[2])};
  double furthest = 0, way[3];
  outward::difference(point, centre, way);
  for (std::size_t i = 0; i < 3; ++i) {
    const double axis[3] = {double(box.axis[i][0]), double(box.axis[i][1]), double(box.axis[i][2])};
    const double half = double(box.half[i]);
    if (side_of_slab(axis, centre, half, point) <= 0) continue;
    furthest = std::max({furthest, std::fabs(outward::dot(axis, way).value) - half, outward::least});
  }
  return furthest;
}

template <class S>
Box<double> enclosing_box(const Obb<S>& box) {
  Box<double> result;
  if (box.empty()) return result;
  const ObbReach extent = obb_reach(box);
  for (std::size_t d = 0; d < 3; ++d) {
    double around = 0;
    for (std::size_t i = 0; i < 3; ++i) around += std::fabs(extent.axis[i][d]) * extent.reach[i];
    if (around > 0) around = around * (1 + 8 * outward::unit_roundoff) + 4 * outward::least;
    result.lower[d] = outward::down<double>(outward::two_sum(extent.centre[d], -around));
    result.upper[d] = outward::up<double>(outward::two_sum(extent.centre[d], around));
  }
  return result;
}

static_assert(BoundingVolume<Obb<float>> && BoundingVolume<Obb<double>>);

}  // namespace kbvh
