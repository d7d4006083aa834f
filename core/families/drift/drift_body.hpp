#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "core/base/median.hpp"
#include "core/families/wide/wide_hierarchy.hpp"
#include "core/geometry/predicates.hpp"

namespace kbvh {

/// One body whose boxes were made at an earlier frame, "then", and the known motion since. Per axis, an
/// interval contains the displacement of every vertex, up to a share of the vertex's own coordinate then
/// (`rounding`). All roundings err to the safe side, for positions up to `admissible_magnitude`. Sides are
/// lower x, y, z, upper x, y, z.
///
/// If displacements are read, this share is 0. A bound on steps is a bound on the plans: positions then and
/// now differ from these by half a unit each, of the coordinate then and of the displacement. Each change of
/// a plan starts from a stored position, which adds another half a unit.
template <class S>
struct DriftBody {
  /// The part of a body that a frame reads.
  enum class Watch : std::uint8_t {
    nothing,  ///< nothing: the body rests
    box,      ///< only its own box: the body is far from all others
    drift,    ///< the drift of its vertices since its boxes were made
  };
  static constexpr double eps = std::numeric_limits<S>::epsilon();

  AlignedArray<S> before;                      ///< positions then, of bodies whose drift is read
  double low[3] = {}, high[3] = {};            ///< bounds of every vertex's displacement since then
  double rate_low[3] = {}, rate_high[3] = {};  ///< the same for one frame, as last observed
  Box<double> box, box_then;                   ///< contain every vertex now, and then
  S margin[6] = {};                            ///< margin by which its boxes exceed the vertices then
  double moved = 0;      ///< by the bound on steps: displacement of any vertex since then
  bool bounded = false;  ///< displacements are bounded by steps, not read
  std::uint32_t changes = 0, most_changes = 0;  ///< of plans since then, and the number that boxes allow for
  double leaf_size = 0;                         ///< median side of a leaf's box
  Watch watch = Watch::nothing;
  bool near = false;     ///< to another body: it takes part in searches
  bool changed = false;  ///< vertices have their own plans: the body no longer counts as resting
  bool widened = false;  ///< boxes already contain the margin (bodies at rest)
  bool read = false;     ///< all its vertices were read in this frame, for their drift
  bool remade = false;   ///< its boxes were made in this frame

  static double below(double value) {
    return std::nextafter(value, -std::numeric_limits<double>::infinity());
  }
  static double above(double value) { return std::nextafter(value, std::numeric_limits<double>::infinity()); }

  /// Makes the current time "then".
  void stand() {
    std::fill_n(low, 3, 0.0);
    std::fill_n(high, 3, 0.0);
    moved = 0;
    changes = 0;
  }
  /// Returns the share of its coordinate then by which a vertex may have moved beyond the interval, after
  /// `most_changes` changes of plans.
  S rounding() const { return bounded ? S((1 + most_changes / 2.0) * eps) : S(0); }

  /// Takes the computed displacements of all vertices over `frames` frames; `interval` [8] holds lower x, y,
  /// z, unused, upper ...
  void drifted_by(const S* interval, int frames) {
    for (int axis = 0; axis < 3; ++axis) {
      const double lower = double(interval[axis]), upper = double(interval[axis + 4]);
      rate_low[axis] = lower / frames;
      rate_high[axis] = upper / frames;
      low[axis] = lower - std::abs(lower) * eps;
      high[axis] = upper + std::abs(upper) * eps;
    }
    put_box();
  }
  /// Takes a bound on every vertex's displacement in this frame, by its plan.
  void moved_by_at_most(double way) {
    moved = above(moved + way);
    const double most = above(moved + 2 * (eps * moved));
    for (int axis = 0; axis < 3; ++axis) {
      low[axis] = -most;
      high[axis] = most;
      rate_low[axis] = -way;
      rate_high[axis] = way;
    }
    put_box();
  }
  /// Registers a change of plans: the displacement so far stays bounded; rounding errors start again from the
  /// stored position.
  void plans_changed() {
    // Inflate: the stored position's rounding error grows with the distance moved.
    moved = above(moved + eps * moved);
    ++changes;
  }
  /// Takes the motion of the body's box in this frame, from `last` to `box`.
  void box_moved_from(const Box<double>& last) {
    for (int axis = 0; axis < 3; ++axis) {
      const double lower = box.lower[axis] - last.lower[axis], upper = box.upper[axis] - last.upper[axis];
      rate_low[axis] = std::min(lower, upper);
      rate_high[axis] = std::max(lower, upper);
    }
  }

  /// Returns a box of then, inflated by the displacements since then.
  Box<double> moved_on(Box<double> then) const {
    for (int axis = 0; axis < 3; ++axis) {
      then.lower[axis] = below(then.lower[axis] + low[axis] - off(then.lower[axis]));
      then.upper[axis] = above(then.upper[axis] + high[axis] + off(then.upper[axis]));
    }
    return then;
  }

  /// Sets margins that suffice for `frames` frames of the current motion; positive even without motion.
  void set_margin(double frames) {
    most_changes = changed ? 16 : 0;
    const double least = 4 * double(std::numeric_limits<S>::min());
    for (int axis = 0; axis < 3; ++axis) {
      margin[axis] = S(least + frames * std::max(0.0, -rate_low[axis]));
      margin[axis + 3] = S(least + frames * std::max(0.0, rate_high[axis]));
    }
  }
  /// Returns a box that contains the body while it stays within its margins.
  Box<double> swept() const {
    Box<double> all = box;
    for (int axis = 0; axis < 3; ++axis) {
      all.lower[axis] -= 2 * double(margin[axis]) + 2 * off(all.lower[axis]);
      all.upper[axis] += 2 * double(margin[axis + 3]) + 2 * off(all.upper[axis]);
    }
    return all;
  }

 private:
  /// Returns how far vertices may have moved beyond the interval, at a side.
  double off(double side) const {
    if (!bounded) return 0;
    return (2.0 + std::max(changes, most_changes)) * eps * std::abs(side) +
           double(std::numeric_limits<S>::min());
  }
  void put_box() { box = moved_on(box_then); }
};

/// Returns the median side of the boxes of a hierarchy's leaves; 0 without leaves. Replaces `sides`.
template <class S>
double usual_leaf_side(const WideHierarchy<S>& hierarchy, std::vector<double>& sides) {
  sides.clear();
  for (std::uint32_t node = 0; node < hierarchy.topology().size(); ++node) {
    if (!hierarchy.topology().nodes[node].is_leaf()) continue;
    const Box<S> box = hierarchy.box(node);
    double side = 0;
    for (int axis = 0; axis < 3; ++axis) side += (double(box.upper[axis]) - double(box.lower[axis])) / 3;
    sides.push_back(side);
  }
  return median(sides);
}

/// Returns an upper bound on the closing of side k of the gap between two bodies (near_pairs.hpp) since then.
template <class S>
double closing(const DriftBody<S>& a, const DriftBody<S>& b, std::size_t k) {
  return k < 3 ? a.high[k] - b.low[k] : b.high[k - 3] - a.low[k - 3];
}
/// Returns the mean closing per frame of a side of the gap between two bodies, relative to the sides of two
/// leaves; 0 if leaves have no size.
template <class S>
double step_of(const DriftBody<S>& a, const DriftBody<S>& b) {
  double sum = 0;
  for (int axis = 0; axis < 3; ++axis)
    sum += std::max(0.0, a.rate_high[axis]) + std::max(0.0, -a.rate_low[axis]) +
           std::max(0.0, b.rate_high[axis]) + std::max(0.0, -b.rate_low[axis]);
  const double size = a.leaf_size + b.leaf_size;
  return size > 0 ? sum / 6 / size : 0;
}
/// Returns the admissible closing: the sum of both margins.
template <class S>
S reach(const DriftBody<S>& a, const DriftBody<S>& b, std::size_t k) {
  return k < 3 ? a.margin[k + 3] + b.margin[k] : b.margin[k] + a.margin[k - 3];
}
/// Returns the used fraction of the reach, quotients rounded up; at most 1.
template <class S>
double used_reach(const DriftBody<S>& a, const DriftBody<S>& b) {
  double most = 0;
  for (std::size_t k = 0; k < 6; ++k)
    most = std::max(most, closing(a, b, k) / double(reach(a, b, k)) * (1 + 0x1p-16));
  return std::min(most, 1.0);
}
/// Tests whether no side has closed by more than its reach.
template <class S>
bool keeps_to_reach(const DriftBody<S>& a, const DriftBody<S>& b) {
  for (std::size_t k = 0; k < 6; ++k)
    if (!(closing(a, b, k) <= double(reach(a, b, k)) * (1 - 0x1p-16))) return false;
  return a.changes <= a.most_changes && b.changes <= b.most_changes;
}

}  // namespace kbvh
