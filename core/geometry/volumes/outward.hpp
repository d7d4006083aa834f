#pragma once
#include <cmath>
#include <cstddef>
#include <limits>

/// Rounds outwards without changing the rounding mode: sums with exactly known errors, and values with error
/// bounds. All functions need rounding to nearest, denormals, and -ffp-contract=off.
namespace kbvh::outward {

/// Half a unit in the last place of 1 in double: the relative error of one rounding.
inline constexpr double unit_roundoff = 0x1p-53;
/// The least positive double: larger than the total underflow error of several products.
inline constexpr double least = std::numeric_limits<double>::denorm_min();

/// An exact number as its nearest double and the sign of the remainder: the number is `nearest` if `rest` is
/// 0, above `nearest` if `rest` is positive, below if negative, and closer than the next double on that side.
struct Rounded {
  double nearest = 0, rest = 0;
};

/// Computes a + b as two doubles, exactly (Knuth's TwoSum).
inline Rounded two_sum(double a, double b) {
  const double sum = a + b, part = sum - a;
  return {sum, (a - (sum - part)) + (b - part)};
}

/// Computes x + y + z for finite numbers without overflow. The error terms of both sums are added exactly,
/// too: if the second sum is inexact, it did not cancel, and the loss below its error is far below its last
/// place.
inline Rounded sum_of(double x, double y, double z) {
  const Rounded first = two_sum(x, y), second = two_sum(first.nearest, z);
  const Rounded error = two_sum(first.rest, second.rest);
  const Rounded total = two_sum(second.nearest, error.nearest);
  return {total.nearest, total.rest + error.rest};
}

/// Returns the largest S that is not above the number.
template <class S>
S down(Rounded number) {
  const S near = S(number.nearest);
  const double back = double(near);
  return back > number.nearest || (back == number.nearest && number.rest < 0)
             ? std::nextafter(near, -std::numeric_limits<S>::infinity())
             : near;
}
/// Returns the smallest S that is not below the number.
template <class S>
S up(Rounded number) {
  const S near = S(number.nearest);
  const double back = double(near);
  return back < number.nearest || (back == number.nearest && number.rest > 0)
             ? std::nextafter(near, std::numeric_limits<S>::infinity())
             : near;
}
/// Rounds a double in the same way.
template <class S>
S up(double number) {
  return up<S>(Rounded{number, 0});
}
template <class S>
S down(double number) {
  return down<S>(Rounded{number, 0});
}

/// A value and a bound on its distance from the exact value.
struct Bounded {
  double value = 0, error = 0;
};

/// Computes x . y for vectors whose components each have a relative error of at most 2 units. The bound has 4
/// units for the factors, 1 for the product, 2 for the sums of the value, and some for the sums of the error
/// and of the caller's additions; 16 covers all. Products that underflow lose less than 4 `least` together.
/// The result is exactly 0, with no error, if each product has a factor of 0.
inline Bounded dot(const double* x, const double* y) {
  const double terms[3] = {x[0] * y[0], x[1] * y[1], x[2] * y[2]};
  const double size = std::fabs(terms[0]) + std::fabs(terms[1]) + std::fabs(terms[2]);
  const bool zero = (x[0] == 0 || y[0] == 0) && (x[1] == 0 || y[1] == 0) && (x[2] == 0 || y[2] == 0);
  return {terms[0] + terms[1] + terms[2], zero ? 0 : 16 * unit_roundoff * size + 4 * least};
}

/// Computes to - from; each component has a relative error of at most one unit.
template <class A, class B>
void difference(const A* to, const B* from, double* result) {
  for (std::size_t d = 0; d < 3; ++d) result[d] = double(to[d]) - double(from[d]);
}

/// Returns an upper bound of the length of a vector whose components have a relative error of at most one
/// unit; the bound exceeds the length by at most 32 units and is 0 only for the zero vector. Scaled, so that
/// squares neither overflow nor underflow.
inline double length_above(const double* v) {
  const double largest = std::fmax(std::fabs(v[0]), std::fmax(std::fabs(v[1]), std::fabs(v[2])));
  if (largest == 0) return 0;
  const double x = v[0] / largest, y = v[1] / largest, z = v[2] / largest;
  return largest * std::sqrt(x * x + y * y + z * z) * (1 + 16 * unit_roundoff) + 2 * least;
}

}  // namespace kbvh::outward
