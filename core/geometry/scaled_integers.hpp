#pragma once
#include <algorithm>
#include <bit>
#include <cstdint>
#include <limits>

#include "core/base/library_gaps.hpp"

// Internal to the exact stages of this room: doubles as integers.

namespace kbvh::scaled {

/// A finite double as mantissa * 2^exponent with an odd mantissa; zero has mantissa 0.
struct OddMultiple {
  std::int64_t mantissa = 0;
  int exponent = 0;
};

inline OddMultiple odd_multiple(double x) {
  const auto bits = bit_cast<std::uint64_t>(x);
  const int biased = static_cast<int>((bits >> 52) & 0x7ff);
  std::uint64_t mantissa = bits & 0xfffffffffffffULL;
  if (biased != 0) mantissa |= 0x10000000000000ULL;
  if (mantissa == 0) return {};
  const int zeros = std::countr_zero(mantissa);
  const auto magnitude = static_cast<std::int64_t>(mantissa >> zeros);
  return {(bits >> 63) != 0 ? -magnitude : magnitude, std::max(biased, 1) - 1075 + zeros};
}

/// N doubles as integers times a common power of two. A common factor does not change the sign of a
/// determinant.
template <int N>
struct Scaled {
  OddMultiple values[N];
  int lowest = std::numeric_limits<int>::max();
  int width = 0;  // bits of the largest magnitude, after scaling by 2^-lowest

  /// Computes the scaling; call it after all values are set.
  void measure() {
    int top = std::numeric_limits<int>::min();
    for (const OddMultiple& value : values) {
      if (value.mantissa == 0) continue;
      const auto magnitude =
          static_cast<std::uint64_t>(value.mantissa < 0 ? -value.mantissa : value.mantissa);
      lowest = std::min(lowest, value.exponent);
      top = std::max(top, value.exponent + static_cast<int>(std::bit_width(magnitude)));
    }
    width = top > lowest ? top - lowest : 0;
  }
};

}  // namespace kbvh::scaled
