#pragma once
#include <cmath>

#include "core/geometry/box.hpp"
#include "core/geometry/ray_triangle.hpp"

namespace kbvh {

/// Tests a ray against closed boxes, conservatively: never misses a box that the ray meets. The parameter at
/// which the ray crosses a plane has three roundings, which keep its sign; `grow` and `least` exceed them. An
/// axis along which the direction is too small to be inverted rejects nothing; where the direction is zero
/// and the origin lies on a plane, 0 * infinity is not a number, and the comparison ignores it.
class RaySlabs {
 public:
  explicit RaySlabs(const RayLine& ray) {
    for (int axis = 0; axis < 3; ++axis) {
      origin_[axis] = ray.origin[axis];
      inverse_[axis] = 1 / ray.direction[axis];
      if (ray.direction[axis] != 0 && std::isinf(inverse_[axis])) inverse_[axis] = std::nan("");
    }
  }

  /// Tests whether the ray may meet the box at a parameter of at most `limit`. Sets `near` to where it
  /// enters, which rounding may have made smaller or larger.
  template <class S>
  bool meet(const Box<S>& box, double limit, double& near) const {
    double first = 0, last = limit;
    for (int axis = 0; axis < 3; ++axis) {
      const bool back = std::signbit(inverse_[axis]);
      const double enter =
          (double(back ? box.upper[axis] : box.lower[axis]) - origin_[axis]) * inverse_[axis];
      const double leave =
          (double(back ? box.lower[axis] : box.upper[axis]) - origin_[axis]) * inverse_[axis];
      first = enter > first ? enter : first;
      last = leave < last ? leave : last;
    }
    near = first < largest ? first : largest;
    return within(near, last);
  }
  /// Returns whether `near` is not certainly beyond `limit`.
  static bool within(double near, double limit) { return near <= limit * grow + least; }

 private:
  static constexpr double grow = 1 + 0x1p-49, least = 0x1p-1021, largest = 0x1p1022;
  double origin_[3], inverse_[3];
};

}  // namespace kbvh
