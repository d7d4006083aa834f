#pragma once
#include <boost/multiprecision/cpp_int.hpp>
#include <cstddef>
#include <span>
#include <vector>

// Internal to polygon_cut.cpp.

namespace kbvh {

/// A polygon in the projection along its area vector N, with exact signs. With w the largest axis of N, a
/// point p is seen at (p_s - p_w N_s / N_w, p_t - p_w N_t / N_w): a linear map whose kernel is N. Doubles
/// with one common error bound decide most signs; integers, made when the first sign is left open, decide the
/// others.
class ProjectedPolygon {
 public:
  /// Takes the corners [corner][3], which must not change. O(corners).
  void take(std::span<const double> points);

  /// Returns whether the area vector is not zero. Without it there is no projection, and only `is_straight`
  /// may be called.
  bool has_area() const { return has_area_; }
  /// Returns whether all corners lie on one line.
  bool is_straight();
  /// Returns PolygonCut::bent.
  double bent() const { return bent_; }

  /// Returns the turn of three corners relative to the polygon's own: left (+1), right (-1), or none (0).
  int turn(std::size_t a, std::size_t b, std::size_t c);

  /// Returns a coordinate of a corner, off by at most `slack`.
  double along(std::size_t corner) const { return seen_[0][corner]; }
  double slack() const { return slack_; }
  /// Returns whether the edges ab and cd are certainly apart, by their boxes.
  bool boxes_apart(std::size_t a, std::size_t b, std::size_t c, std::size_t d) const;
  /// Stores the box of a triangle; `beyond_bound` returns whether an edge is certainly apart from it. In
  /// terms of `along`, it extends from `bound_begin` to `bound_end`.
  void bound(const std::size_t (&triangle)[3]);
  bool beyond_bound(std::size_t a, std::size_t b) const;
  double bound_begin() const { return bound_[0].lower; }
  double bound_end() const { return bound_[0].upper; }
  /// Returns whether a corner coincides with a corner of a triangle.
  bool coincides(std::size_t corner, const std::size_t (&triangle)[3]) const;

  /// Creates a further point, inside a triangle on the line through its second corner and the middle of the
  /// other two; returns its number for `turn`.
  std::size_t place_inside(const std::size_t (&triangle)[3]);

 private:
  using Integer = boost::multiprecision::cpp_int;
  struct Interval {
    double lower, upper;
  };

  std::size_t size() const { return points_.size() / 3; }
  bool same_place(std::size_t a, std::size_t b) const;
  void make_exact();
  int exact_turn(std::size_t a, std::size_t b, std::size_t c);

  std::span<const double> points_;
  bool has_area_ = false;
  double bent_ = 0;
  std::size_t axis_ = 2;         ///< w
  std::vector<double> seen_[2];  ///< [corner, and one further point]
  double slack_ = 0;             ///< error bound of the numbers in `seen_`; infinite: unknown
  Interval bound_[2] = {};
  bool is_exact_ = false;
  std::vector<Integer> offsets_;  ///< [corner][3] from the first corner, in units of a power of two
  Integer area_[3];
  std::vector<Integer> exact_seen_[2];  ///< as `seen_`, in units of their own
  std::size_t inner_[3] = {};           ///< the triangle of the further point
  bool inner_is_exact_ = false;
};

}  // namespace kbvh
