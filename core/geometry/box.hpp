#pragma once
#include <algorithm>
#include <limits>

namespace kbvh {

/// A closed axis-aligned box [lower, upper]; 6 scalars. The default box is empty: it contains nothing,
/// overlaps nothing, and is the neutral element of `extend`.
template <class S>
struct Box {
  S lower[3] = {std::numeric_limits<S>::infinity(), std::numeric_limits<S>::infinity(),
                std::numeric_limits<S>::infinity()};
  S upper[3] = {-std::numeric_limits<S>::infinity(), -std::numeric_limits<S>::infinity(),
                -std::numeric_limits<S>::infinity()};

  void extend(const S* point) {
    for (int axis = 0; axis < 3; ++axis) {
      lower[axis] = std::min(lower[axis], point[axis]);
      upper[axis] = std::max(upper[axis], point[axis]);
    }
  }
  void extend(const Box& other) {
    for (int axis = 0; axis < 3; ++axis) {
      lower[axis] = std::min(lower[axis], other.lower[axis]);
      upper[axis] = std::max(upper[axis], other.upper[axis]);
    }
  }
  bool empty() const { return !(lower[0] <= upper[0]); }
  bool contains(const Box& other) const {
    bool inside = true;
    for (int axis = 0; axis < 3; ++axis)
      inside = inside & (lower[axis] <= other.lower[axis]) & (other.upper[axis] <= upper[axis]);
    return inside;
  }
  bool operator==(const Box&) const = default;
};

/// Converts to a box in double, exactly.
template <class S>
inline Box<double> to_double(const Box<S>& box) {
  Box<double> result;
  for (int axis = 0; axis < 3; ++axis) {
    result.lower[axis] = box.lower[axis];
    result.upper[axis] = box.upper[axis];
  }
  return result;
}

/// Tests for overlap. Boxes are closed: boxes that share a single point overlap.
template <class S>
inline bool overlap(const Box<S>& a, const Box<S>& b) {
  return (a.lower[0] <= b.upper[0]) & (b.lower[0] <= a.upper[0]) & (a.lower[1] <= b.upper[1]) &
         (b.lower[1] <= a.upper[1]) & (a.lower[2] <= b.upper[2]) & (b.lower[2] <= a.upper[2]);
}

/// Returns the surface area in double; 0 for the empty box.
template <class S>
inline double surface_area(const Box<S>& box) {
  if (box.empty()) return 0.0;
  const double x = double(box.upper[0]) - double(box.lower[0]);
  const double y = double(box.upper[1]) - double(box.lower[1]);
  const double z = double(box.upper[2]) - double(box.lower[2]);
  return 2.0 * (x * y + y * z + z * x);
}

}  // namespace kbvh
