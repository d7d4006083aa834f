#pragma once

namespace kbvh {

/// An unevaluated sum hi + lo. V is double or a SIMD vector of doubles.
template <class V>
struct TwoPart {
  V hi{}, lo{};
};

/// A number of about 106 bits, |lo| <= ulp(hi)/2.
using DoubleDouble = TwoPart<double>;

// Error-free transforms (Dekker 1971, Knuth, Shewchuk 1997). Portable on purpose: without hardware FMA
// std::fma is a slow library call. They need -ffp-contract=off and round-to-nearest; they are forced inline
// because kernels are compiled several times under different flags and must not share an out-of-line copy.

/// Computes hi + lo == a + b exactly, for any a and b whose sum does not overflow.
template <class V>
[[gnu::always_inline]] inline TwoPart<V> two_sum(V a, V b) {
  const V sum = a + b;
  const V rest = sum - a;
  return {sum, (a - (sum - rest)) + (b - rest)};
}

/// Computes hi + lo == a - b exactly, for any a and b whose difference does not overflow.
template <class V>
[[gnu::always_inline]] inline TwoPart<V> two_diff(V a, V b) {
  const V difference = a - b;
  const V rest = difference - a;
  return {difference, (a - (difference - rest)) - (b + rest)};
}

/// Splits a into two halves of at most 26 bits each, a == hi + lo; |a| < 2^996.
template <class V>
[[gnu::always_inline]] inline TwoPart<V> split_halves(V a) {
  const V scaled = 134217729.0 * a;  // 2^27 + 1
  const V hi = scaled - (scaled - a);
  return {hi, a - hi};
}

/// Computes hi + lo == a * b exactly, unless the product is so small that lo underflows (safe: 2^-960 <= |a
/// b|, or a b == 0, and |a|, |b|, |a b| <= 2^960). `halves` are those of b, so that a common factor is split
/// only once.
template <class V>
[[gnu::always_inline]] inline TwoPart<V> two_product(V a, double b, DoubleDouble halves) {
  const V product = a * b;
  const TwoPart<V> mine = split_halves(a);
  const V lo =
      ((mine.hi * halves.hi - product) + mine.hi * halves.lo + mine.lo * halves.hi) + mine.lo * halves.lo;
  return {product, lo};
}

/// Computes hi + lo == a * b exactly; see above for the range.
[[gnu::always_inline]] inline DoubleDouble two_product(double a, double b) {
  return two_product(a, b, split_halves(b));
}

/// Returns -1, 0 or 1.
[[gnu::always_inline]] inline int sign_of(double value) {
  return (value > 0) - (value < 0);
}

}  // namespace kbvh
