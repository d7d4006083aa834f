#pragma once
#include <algorithm>
#include <cstddef>
#include <limits>

namespace kbvh {

/// Axes at right angles, up to rounding in double, and the middle of the extents along them.
struct ObbFrame {
  double axis[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  double centre[3] = {0, 0, 0};
  double area = 0, length = 0;  ///< of the box: a quarter of its surface, and the sum of its three sides
};

/// Chooses the frame of an oriented box by the points that are extreme along seven directions (Larsson and
/// Källberg 2011, "Fast computation of tight-fitting oriented bounding boxes", DiTO-14): a large triangle of
/// these points and the two tetrahedra on it. The edges and normals of these seven triangles give 21 frames,
/// compared on the extreme points alone. Exactness is not needed here: users of a frame measure the extents
/// again.
class ObbFrames {
 public:
  /// The extent of a set of points along an axis.
  struct Interval {
    double lower = std::numeric_limits<double>::infinity(), upper = -std::numeric_limits<double>::infinity();
    void add(double x) {
      lower = std::min(lower, x);
      upper = std::max(upper, x);
    }
  };

  /// Updates the extreme points with a point of 3 numbers.
  void add_extreme(const double* point);
  bool empty() const { return count_ == 0; }
  /// Chooses among the 21 frames; call it once, after the last point. O(1).
  void choose();

  /// Returns the better of the chosen frame and the coordinate axes by surface area. measure(axis, from)
  /// returns the Interval of axis . (p - from) over the whole set.
  template <class Measure>
  ObbFrame best(const Measure& measure) const {
    ObbFrame frame;
    place(frame, measure);
    improve(frame, chosen_, measure);
    return frame;
  }
  /// Takes other axes if their surface is smaller, or equal with shorter sides.
  template <class Measure>
  void improve(ObbFrame& best, const double (&axis)[3][3], const Measure& measure) const {
    ObbFrame other;
    std::copy_n(&axis[0][0], 9, &other.axis[0][0]);
    place(other, measure);
    if (other.area < best.area || (other.area == best.area && other.length < best.length)) best = other;
  }

 private:
  static constexpr std::size_t directions = 7;
  struct Extreme {
    double at = 0;
    double point[3] = {0, 0, 0};
  };

  template <class Measure>
  void place(ObbFrame& frame, const Measure& measure) const {
    const double* const from = least_[0].point;
    double side[3];
    std::copy_n(from, 3, frame.centre);
    for (std::size_t i = 0; i < 3; ++i) {
      const Interval interval = measure(frame.axis[i], from);
      side[i] = interval.upper - interval.lower;
      const double middle = 0.5 * interval.lower + 0.5 * interval.upper;
      for (std::size_t d = 0; d < 3; ++d) frame.centre[d] += middle * frame.axis[i][d];
    }
    frame.area = side[0] * side[1] + side[1] * side[2] + side[2] * side[0];
    frame.length = side[0] + side[1] + side[2];
  }
  void consider_triangle(const double* a, const double* b, const double* c, double& least_area);
  void consider(const double* edge, const double* normal, double& least_area);
  const double* furthest(const double* from, const double* normal, int sign) const;

  Extreme least_[directions], most_[directions];
  std::size_t count_ = 0;
  double chosen_[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
};

}  // namespace kbvh
