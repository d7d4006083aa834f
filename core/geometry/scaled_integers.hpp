#pragma once
#include <algorithm>
#include <bit>
#include <boost/multiprecision/cpp_int.hpp>
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

__extension__ typedef __int128 Int128;
using Int512 = boost::multiprecision::number<boost::multiprecision::cpp_int_backend<
    512, 512, boost::multiprecision::signed_magnitude, boost::multiprecision::unchecked, void>>;

template <class Integer>
void shift_left(Integer& x, int bits) {
  x <<= bits;
}
/// Kept out of line: when it is inlined into the determinants at -O3, GCC 12 warns of overflows that do not
/// exist.
[[gnu::noinline]] inline void shift_left(boost::multiprecision::cpp_int& x, int bits) {
  x <<= bits;
}

/// Returns value i as an integer that is wide enough.
template <class Integer, int N>
Integer integer(const Scaled<N>& s, int i) {
  if (s.values[i].mantissa == 0) return Integer(0);
  // A left shift of a negative number multiplies it, by C++20 and for signed_magnitude integers.
  Integer result(s.values[i].mantissa);
  shift_left(result, s.values[i].exponent - s.lowest);
  return result;
}

template <class Integer>
int sign_of(const Integer& x) {
  return x > 0 ? 1 : x < 0 ? -1 : 0;
}

/// Returns the sign of the determinant a (b x c).
template <class Integer>
int determinant_sign(const Integer* a, const Integer* b, const Integer* c) {
  const Integer x = b[1] * c[2] - b[2] * c[1];
  const Integer y = b[2] * c[0] - b[0] * c[2];
  const Integer z = b[0] * c[1] - b[1] * c[0];
  const Integer determinant = x * a[0] + y * a[1] + z * a[2];
  return sign_of(determinant);
}

/// Does the same for integers below 2^61: minors are below 2^123 and the sums of the half products below 3 *
/// 2^125. Everything fits into 128 bits except the determinant, which is kept as high * 2^64 + low.
template <>
inline int determinant_sign(const std::int64_t* a, const std::int64_t* b, const std::int64_t* c) {
  const Int128 minors[3] = {Int128(b[1]) * c[2] - Int128(b[2]) * c[1],
                            Int128(b[2]) * c[0] - Int128(b[0]) * c[2],
                            Int128(b[0]) * c[1] - Int128(b[1]) * c[0]};
  Int128 high = 0, low = 0;
  for (int i = 0; i < 3; ++i) {
    high += Int128(static_cast<std::int64_t>(minors[i] >> 64)) * a[i];
    low += Int128(static_cast<std::uint64_t>(minors[i])) * a[i];
  }
  high += low >> 64;  // floor: the remaining low is in [0, 2^64)
  if (high != 0) return sign_of(high);
  return static_cast<std::uint64_t>(low) != 0 ? 1 : 0;
}

}  // namespace kbvh::scaled
