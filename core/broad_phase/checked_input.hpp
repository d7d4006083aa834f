#pragma once
// Checks of what a caller of the broad phase passes, and sums that are rounded up.
#include <cmath>
#include <cstddef>
#include <limits>
#include <stdexcept>
#include <string>

#include "core/broad_phase/elements.hpp"
#include "core/motion/admissible.hpp"

namespace kbvh {

template <class S>
bool is_admissible(S x) {
  return std::fabs(x) <= admissible_magnitude<S>;
}

template <class S>
[[noreturn]] void refuse_coordinate(const MatrixView<S>& v, std::size_t row, const char* what) {
  for (std::size_t axis = 0; axis < 3; ++axis)
    if (!is_admissible(v(row, axis)))
      throw std::invalid_argument(std::string(what) + ": coordinate " + "xyz"[axis] + " of vertex " +
                                  std::to_string(row) + " is " + number_text(double(v(row, axis))) +
                                  ", beyond the limit of " + admissible_text<S>());
  throw std::logic_error("no coordinate is inadmissible");
}

template <class S>
void check_shape(const MatrixView<S>& v, std::size_t vertices, const char* what) {
  if (v.rows != vertices)
    throw std::invalid_argument(std::string(what) + " has " + std::to_string(v.rows) + " rows for " +
                                std::to_string(vertices) + " vertices");
  if (v.rows != 0 && v.columns != 3)
    throw std::invalid_argument(std::string(what) + " has " + std::to_string(v.columns) +
                                " columns instead of 3");
}

/// Checks all coordinates; where they lie without gaps, in one loop over the memory.
template <class S>
void check_positions(const MatrixView<S>& v, std::size_t vertices, const char* what) {
  check_shape(v, vertices, what);
  const auto rows = std::ptrdiff_t(v.rows);
  unsigned wrong = 0;
  if ((v.row_step == 3 && v.column_step == 1) || (v.row_step == 1 && v.column_step == rows)) {
    for (std::size_t i = 0; i < 3 * v.rows; ++i) wrong |= is_admissible(v.data[i]) ? 0U : 1U;
  } else {
    for (std::size_t row = 0; row < v.rows; ++row)
      for (std::size_t axis = 0; axis < 3; ++axis) wrong |= is_admissible(v(row, axis)) ? 0U : 1U;
  }
  if (wrong == 0) return;
  for (std::size_t row = 0; row < v.rows; ++row)
    if (!is_admissible(v(row, 0)) || !is_admissible(v(row, 1)) || !is_admissible(v(row, 2)))
      refuse_coordinate(v, row, what);
}

/// Returns a + b of two numbers that are not negative, rounded up.
template <class S>
S sum_up(S a, S b) {
  const S sum = a + b;
  // The rounding error of the sum, exactly; positive if the sum was rounded down.
  const S rest = sum - a;
  const S error = (a - (sum - rest)) + (b - rest);
  return error > 0 ? std::nextafter(sum, std::numeric_limits<S>::infinity()) : sum;
}

/// Returns a / 2, rounded up: exact but for the smallest numbers.
template <class S>
S half_up(S a) {
  const S half = a / 2;
  return half + half < a ? std::nextafter(half, std::numeric_limits<S>::infinity()) : half;
}

/// Returns the smallest S that is not less than a length. Throws std::invalid_argument unless it is one.
template <class S>
S length_up(double length, const char* what) {
  if (!(length >= 0 && length <= double(admissible_magnitude<S>)))
    throw std::invalid_argument(std::string(what) + " is " + number_text(length) +
                                ", not a number from 0 to " + admissible_text<S>());
  const S rounded = S(length);
  return double(rounded) < length ? std::nextafter(rounded, std::numeric_limits<S>::infinity()) : rounded;
}

}  // namespace kbvh
