#pragma once
#include <cmath>

#include "core/geometry/predicates.hpp"
#include "core/motion/exact_arithmetic.hpp"

namespace kbvh {

/// A double with a bound on its distance from the real number that it stands for. Sums and products take a
/// few operations; the bound covers its own rounding, too.
class BoundedDouble {
 public:
  BoundedDouble() = default;
  BoundedDouble(double value) : value_(value) {}  // NOLINT(google-explicit-constructor): formulas read better

  friend BoundedDouble operator+(const BoundedDouble& a, const BoundedDouble& b) {
    const double sum = a.value_ + b.value_;
    return {sum, (a.error_ + b.error_ + std::fabs(sum) * unit) * slack + tiny};
  }
  friend BoundedDouble operator-(const BoundedDouble& a, const BoundedDouble& b) {
    return a + BoundedDouble(-b.value_, b.error_);
  }
  friend BoundedDouble operator*(const BoundedDouble& a, const BoundedDouble& b) {
    const double product = a.value_ * b.value_;
    const double error = std::fabs(a.value_) * b.error_ + std::fabs(b.value_) * a.error_ +
                         a.error_ * b.error_ + std::fabs(product) * unit;
    return {product, error * slack + tiny};
  }
  /// Returns -1 or 1; undecided_sign where the bound does not exclude another sign, or is no number:
  /// a zero is never proved.
  int sign() const {
    if (value_ > error_) return 1;
    if (value_ < -error_) return -1;
    return undecided_sign;
  }

 private:
  BoundedDouble(double value, double error) : value_(value), error_(error) {}
  // Half an ulp of the result; the few roundings within a bound; products that underflow, in the value or in
  // the bound.
  static constexpr double unit = 0x1p-53, slack = 1 + 0x1p-49, tiny = 0x1p-1060;
  double value_ = 0, error_ = 0;
};

/// Distances of elements against one distance, in numbers of type T. A sign that T leaves undecided is noted,
/// and the verdict means nothing then.
template <class T>
class DistanceComparison {
 public:
  explicit DistanceComparison(double distance) : squared_(T(distance) * T(distance)) {}
  bool undecided() const { return undecided_; }

  struct Point {
    T v[3];
  };
  static Point point(const double* p) { return {{T(p[0]), T(p[1]), T(p[2])}}; }

  bool points(const Point& p, const Point& q) { return not_beyond(dot(minus(p, q), minus(p, q)), T(1.0)); }

  /// The nearest point of a segment is an end, or the foot of the perpendicular if that lies between them.
  bool point_segment(const Point& p, const Point& a, const Point& b) {
    const Point along = minus(b, a), from = minus(p, a);
    const T at = dot(from, along);
    if (sign(at) <= 0) return points(p, a);
    const T length = dot(along, along);
    if (sign(at - length) >= 0) return points(p, b);
    return not_beyond(dot(from, from) * length - at * at, length);
  }

  /// The nearest point of a triangle is the foot of the perpendicular if it lies inside, else on a side.
  bool point_triangle(const Point& p, const Point& a, const Point& b, const Point& c) {
    const Point normal = cross(minus(b, a), minus(c, a)), from = minus(p, a);
    const T size = dot(normal, normal);
    if (sign(size) > 0 && sign(dot(cross(minus(b, a), from), normal)) >= 0 &&
        sign(dot(cross(minus(c, b), minus(p, b)), normal)) >= 0 &&
        sign(dot(cross(minus(a, c), minus(p, c)), normal)) >= 0) {
      const T height = dot(from, normal);
      return not_beyond(height * height, size);
    }
    return point_segment(p, a, b) || point_segment(p, b, c) || point_segment(p, c, a);
  }

  /// The nearest points of two segments are those of their lines if these lie on both, else one is an end.
  bool segments(const Point& a, const Point& b, const Point& c, const Point& d) {
    const Point u = minus(b, a), v = minus(d, c), w = minus(c, a), normal = cross(u, v);
    const T size = dot(normal, normal);
    if (sign(size) > 0) {
      const T on_first = dot(cross(w, v), normal), on_second = dot(cross(w, u), normal);
      if (sign(on_first) >= 0 && sign(on_first - size) <= 0 && sign(on_second) >= 0 &&
          sign(on_second - size) <= 0) {
        const T height = dot(w, normal);
        return not_beyond(height * height, size);
      }
    }
    return point_segment(a, c, d) || point_segment(b, c, d) || point_segment(c, a, b) ||
           point_segment(d, a, b);
  }

 private:
  static Point minus(const Point& a, const Point& b) {
    return {{a.v[0] - b.v[0], a.v[1] - b.v[1], a.v[2] - b.v[2]}};
  }
  static T dot(const Point& a, const Point& b) { return a.v[0] * b.v[0] + a.v[1] * b.v[1] + a.v[2] * b.v[2]; }
  static Point cross(const Point& a, const Point& b) {
    return {{a.v[1] * b.v[2] - a.v[2] * b.v[1], a.v[2] * b.v[0] - a.v[0] * b.v[2],
             a.v[0] * b.v[1] - a.v[1] * b.v[0]}};
  }
  int sign(const T& x) {
    const int s = x.sign();
    if (s != undecided_sign) return s;
    undecided_ = true;
    return 0;
  }
  /// Returns whether numerator / denominator, a squared distance, is at most the given one squared.
  bool not_beyond(const T& numerator, const T& denominator) {
    return sign(squared_ * denominator - numerator) >= 0;
  }

  T squared_;
  bool undecided_ = false;
};

}  // namespace kbvh
