#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "core/families/wide/wide_hierarchy.hpp"
#include "core/geometry/predicates.hpp"

namespace kbvh {

/// One body whose boxes were made at a frame, "then", and what is known of its motion since: for each axis an
/// interval that holds the displacement of every vertex. All is rounded such that it errs to the safe side,
/// for positions up to `admissible_magnitude`. Sides are lower x, y, z, upper x, y, z.
template <class S>
struct DriftBody {
  /// What is looked at at a frame.
  enum class Watch : std::uint8_t {
    nothing,  ///< it rests
    box,      ///< it is too far from all others: its own box
    drift,    ///< how far its vertices moved since its boxes were made
  };
  static constexpr double eps = std::numeric_limits<S>::epsilon();

  AlignedArray<S> before;                      ///< positions then, of those whose drift is read
  double low[3] = {}, high[3] = {};            ///< no vertex moved by less, or more, since then
  double rate_low[3] = {}, rate_high[3] = {};  ///< the same in one frame, as was seen last
  Box<double> box, box_then;                   ///< hold every vertex now, and then
  S margin[6] = {};                            ///< by which its boxes are larger than the vertices were then
  double slack = 0;                            ///< more than all roundings of a comparison of boxes
  double moved = 0, rounding = 0;              ///< the bound on steps: the way of any vertex since then
  double leaf_size = 0;                        ///< mean side of a leaf's box
  Watch watch = Watch::nothing;
  bool near = false;     ///< to another body: it takes part in searches
  bool changed = false;  ///< plans of its own: it is no body at rest any more
  bool widened = false;  ///< boxes hold the margin already (bodies at rest)
  bool read = false;     ///< all its vertices, in this frame, for their drift
  bool remade = false;   ///< its boxes, in this frame

  static double below(double value) {
    return std::nextafter(value, -std::numeric_limits<double>::infinity());
  }
  static double above(double value) { return std::nextafter(value, std::numeric_limits<double>::infinity()); }

  /// Then is now.
  void stand() {
    std::fill_n(low, 3, 0.0);
    std::fill_n(high, 3, 0.0);
    moved = 0;
    rounding = above(largest_coordinate() * eps / 2) + double(std::numeric_limits<S>::denorm_min());
  }

  /// `interval` [8] holds, as lower x, y, z, unused, upper ..., the computed displacements of all vertices in
  /// so many frames.
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
  /// In this frame no vertex went further by its plan.
  void moved_by_at_most(double way) {
    moved = above(moved + way);
    // Both positions are the plan's, rounded.
    const double most = above(moved + 2 * rounding + 2 * (eps * moved));
    for (int axis = 0; axis < 3; ++axis) {
      low[axis] = -most;
      high[axis] = most;
      rate_low[axis] = -way;
      rate_high[axis] = way;
    }
    put_box();
  }
  /// Its plans change now: the way so far stays bounded, and from the stored position on, rounding starts
  /// over.
  void plans_changed() {
    // Enlarged, for so is what a change of a body far from here has been rounded by.
    moved = above(above(moved + rounding) + eps * moved);
  }
  /// In this frame its box has moved, from what it was to `box`.
  void box_moved_from(const Box<double>& last) {
    for (int axis = 0; axis < 3; ++axis) {
      const double lower = box.lower[axis] - last.lower[axis], upper = box.upper[axis] - last.upper[axis];
      rate_low[axis] = std::min(lower, upper);
      rate_high[axis] = std::max(lower, upper);
    }
  }

  /// A box of then, larger by what the vertices have moved since.
  Box<double> moved_on(Box<double> then) const {
    for (int axis = 0; axis < 3; ++axis) {
      then.lower[axis] = below(then.lower[axis] + low[axis]);
      then.upper[axis] = above(then.upper[axis] + high[axis]);
    }
    return then;
  }

  /// Margins that hold for so many frames of the present motion; positive also for none.
  void set_margin(double frames) {
    slack = 8 * eps * largest_coordinate();
    const double least = std::max(2 * slack, 4 * double(std::numeric_limits<S>::min()));
    for (int axis = 0; axis < 3; ++axis) {
      margin[axis] = S(least + frames * std::max(0.0, -rate_low[axis]));
      margin[axis + 3] = S(least + frames * std::max(0.0, rate_high[axis]));
    }
  }
  /// Holds the body while it keeps to its margins.
  Box<double> swept() const {
    Box<double> all = box;
    for (int axis = 0; axis < 3; ++axis) {
      all.lower[axis] -= 2 * double(margin[axis]);
      all.upper[axis] += 2 * double(margin[axis + 3]);
    }
    return all;
  }

 private:
  double largest_coordinate() const {
    double largest = 0;
    for (int axis = 0; axis < 3; ++axis)
      largest = std::max({largest, std::abs(box.lower[axis]), std::abs(box.upper[axis])});
    return largest;
  }
  void put_box() { box = moved_on(box_then); }
};

/// By how much side k of the gap between two bodies (near_pairs.hpp) may have closed since then.
template <class S>
double closing(const DriftBody<S>& a, const DriftBody<S>& b, std::size_t k) {
  return k < 3 ? a.high[k] - b.low[k] : b.high[k - 3] - a.low[k - 3];
}
/// By how much it may close: what both margins add up to.
template <class S>
S reach(const DriftBody<S>& a, const DriftBody<S>& b, std::size_t k) {
  return k < 3 ? a.margin[k + 3] + b.margin[k] : b.margin[k] + a.margin[k - 3];
}
/// Which fraction of the reach has been used, quotients rounded up; at most 1.
template <class S>
double used_reach(const DriftBody<S>& a, const DriftBody<S>& b) {
  double most = 0;
  for (std::size_t k = 0; k < 6; ++k)
    most = std::max(most, closing(a, b, k) / double(reach(a, b, k)) * (1 + 0x1p-16));
  return std::min(most, 1.0);
}
/// Has no side closed by more than its reach?
template <class S>
bool keeps_to_reach(const DriftBody<S>& a, const DriftBody<S>& b) {
  for (std::size_t k = 0; k < 6; ++k)
    if (!(closing(a, b, k) + a.slack + b.slack <= double(reach(a, b, k)) * (1 - 0x1p-16))) return false;
  return true;
}

}  // namespace kbvh
