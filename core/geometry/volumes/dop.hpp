#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "core/geometry/volumes/bounding_volume.hpp"
#include "core/geometry/volumes/outward.hpp"
#include "core/geometry/volumes/slab_area.hpp"

namespace kbvh {

/// A direction of slabs; each component is -1, 0 or 1.
using SlabDirection = std::array<int, 3>;

/// The K / 2 directions of a k-DOP with K sides, after Klosowski et al. 1998. With 6 sides, those of a box:
/// the axes. With more sides, the axes come first. With 14 sides, the diagonals of the unit cube follow (they
/// cut off its corners); with 18 sides, the diagonals of its faces (they cut off its edges); with 26 sides,
/// both.
template <int K>
constexpr std::array<SlabDirection, std::size_t(K / 2)> slab_directions() {
  static_assert(K == 6 || K == 14 || K == 18 || K == 26, "k-DOPs have 6, 14, 18 or 26 sides");
  constexpr SlabDirection all[] = {{1, 0, 0},  {0, 1, 0},  {0, 0, 1},  {1, 1, 0},  {1, 0, 1},
                                   {0, 1, 1},  {1, -1, 0}, {1, 0, -1}, {0, 1, -1}, {1, 1, 1},
                                   {1, 1, -1}, {1, -1, 1}, {1, -1, -1}};
  std::array<SlabDirection, std::size_t(K / 2)> result{};
  std::size_t count = 0;
  for (std::size_t i = 0; i < 13; ++i)
    if (i < 3 || (K != 6 && (i < 9 ? K != 14 : K != 18))) result[count++] = all[i];
  return result;
}

/// A discrete oriented polytope with K sides (Klosowski, Held, Mitchell, Sowizral and Zikan 1998): the points
/// p with lower[i] <= n_i . p <= upper[i] for fixed directions n_i that are not normalised. K scalars.
///
/// Rounding: n . p is summed exactly and rounded outwards to the nearest S that does not cut the point off;
/// sides along the axes are exact. All other operations are minima and maxima: a k-DOP of k-DOPs is the k-DOP
/// of all points below, so a bottom-up refit is tight. `overlap` compares slab by slab (K / 2 of the
/// directions that could separate two polytopes), so it errs to true for some disjoint polytopes.
template <class S, int K>
struct Dop {
  using Scalar = S;
  static constexpr std::size_t slabs = std::size_t(K / 2);
  static constexpr std::array<SlabDirection, slabs> directions = slab_directions<K>();

  std::array<S, slabs> lower, upper;

  Dop() {
    lower.fill(std::numeric_limits<S>::infinity());
    upper.fill(-std::numeric_limits<S>::infinity());
  }
  bool empty() const { return !(lower[0] <= upper[0]); }
  bool operator==(const Dop&) const = default;

  /// Computes n . p exactly.
  template <class T>
  static outward::Rounded along(std::size_t slab, const T* p) {
    const SlabDirection& n = directions[slab];
    return outward::sum_of(n[0] * double(p[0]), n[1] * double(p[1]), n[2] * double(p[2]));
  }
};

template <class S, int K>
void fit(Dop<S, K>& dop, PointSet<S> points) {
  Dop<S, K> fitted;
  for (std::size_t i = 0; i < points.size(); ++i)
    for (std::size_t slab = 0; slab < fitted.slabs; ++slab) {
      const outward::Rounded at = Dop<S, K>::along(slab, points[i]);
      // Rounding is monotone: a point that is inside by the nearest double stays inside.
      if (at.nearest <= double(fitted.lower[slab]))
        fitted.lower[slab] = std::min(fitted.lower[slab], outward::down<S>(at));
      if (at.nearest >= double(fitted.upper[slab]))
        fitted.upper[slab] = std::max(fitted.upper[slab], outward::up<S>(at));
    }
  dop = fitted;
}

template <class S, int K>
void enclose(Dop<S, K>& dop, std::span<const Dop<S, K>> children) {
  Dop<S, K> all;
  for (const Dop<S, K>& child : children)
    for (std::size_t slab = 0; slab < all.slabs; ++slab) {
      all.lower[slab] = std::min(all.lower[slab], child.lower[slab]);
      all.upper[slab] = std::max(all.upper[slab], child.upper[slab]);
    }
  dop = all;
}

template <class S, int K>
bool overlap(const Dop<S, K>& a, const Dop<S, K>& b) {
  bool apart = false;
  for (std::size_t slab = 0; slab < a.slabs; ++slab)
    apart = apart | !(a.lower[slab] <= b.upper[slab]) | !(b.lower[slab] <= a.upper[slab]);
  return !apart;
}

/// Computes the surface area of the polytope itself: each side's polygon is clipped by all other slabs.
/// O(K^2).
template <class S, int K>
double surface_area(const Dop<S, K>& dop) {
  if (dop.empty()) return 0;
  std::array<Slab, Dop<S, K>::slabs> slabs{};
  for (std::size_t i = 0; i < dop.slabs; ++i) {
    for (std::size_t d = 0; d < 3; ++d) slabs[i].normal[d] = dop.directions[i][d];
    slabs[i].lower = double(dop.lower[i]);
    slabs[i].upper = double(dop.upper[i]);
  }
  return slab_area(slabs);
}

/// Returns the largest distance to a slab's planes.
template <class S, int K>
double protrusion(const Dop<S, K>& dop, const double* point) {
  if (dop.empty()) return std::numeric_limits<double>::infinity();
  double furthest = 0;
  for (std::size_t slab = 0; slab < dop.slabs; ++slab) {
    const outward::Rounded at = Dop<S, K>::along(slab, point);
    const double beyond = std::max(double(dop.lower[slab]) - outward::down<double>(at),
                                   outward::up<double>(at) - double(dop.upper[slab]));
    if (!(beyond > 0)) continue;
    const SlabDirection& n = dop.directions[slab];
    const double length = std::sqrt(double(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]));
    furthest = std::max({furthest, beyond / length, outward::least});
  }
  return furthest;
}

/// Returns the box given by the slabs along the axes.
template <class S, int K>
Box<double> enclosing_box(const Dop<S, K>& dop) {
  Box<double> box;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    box.lower[axis] = dop.lower[axis];
    box.upper[axis] = dop.upper[axis];
  }
  return box;
}

static_assert(BoundingVolume<Dop<float, 14>> && BoundingVolume<Dop<double, 26>>);
static_assert(sizeof(Dop<float, 18>) == 18 * sizeof(float));

}  // namespace kbvh
