#pragma once
#include "core/motion/error_free.hpp"

namespace kbvh {

/// Returns a / b of two sums, with about twice the bits of a double: a rounded quotient and its correction.
/// Needs numbers within the range of `two_product`, and b != 0.
inline DoubleDouble precise_quotient(DoubleDouble a, DoubleDouble b) {
  const double quotient = a.hi / b.hi;
  const DoubleDouble back = two_product(quotient, b.hi);
  const double rest = ((a.hi - back.hi) - back.lo) + (a.lo - quotient * b.lo);
  return two_sum(quotient, rest / b.hi);
}

}  // namespace kbvh
