#pragma once
#include <boost/multiprecision/cpp_int.hpp>
#include <cmath>
#include <cstdint>
#include <limits>

#include "core/motion/error_free.hpp"

namespace kbvh {

/// An exact sum of doubles that grows by one term at a time and knows its sign (Shewchuk 1997, grow-expansion
/// with zero elimination). At most `capacity` terms; each `add` costs the current number of non-zero
/// components.
template <int capacity>
class ExpansionSum {
 public:
  /// Adds one double exactly.
  void add(double term) {
    int kept = 0;
    for (int i = 0; i < size_; ++i) {
      const DoubleDouble partial = two_sum(term, components_[i]);
      if (partial.lo != 0) components_[kept++] = partial.lo;
      term = partial.hi;
    }
    if (term != 0) components_[kept++] = term;
    size_ = kept;
  }
  /// Adds a * b exactly; records whether the product left the range in which that is possible.
  void add_product(double a, double b) {
    if (a == 0 || b == 0) return;
    const DoubleDouble product = two_product(a, b);
    const double size = std::fabs(product.hi);
    if (!(size >= 0x1p-900 && size <= 0x1p900 && std::fabs(a) <= 0x1p900 && std::fabs(b) <= 0x1p900)) {
      in_range_ = false;
    }
    add(product.lo);
    add(product.hi);
  }
  /// Adds sign * a * b exactly, sign being 1 or -1.
  void add_product(DoubleDouble a, DoubleDouble b, double sign) {
    add_product(a.lo, sign * b.lo);
    add_product(a.lo, sign * b.hi);
    add_product(a.hi, sign * b.lo);
    add_product(a.hi, sign * b.hi);
  }
  /// Returns false if a product under- or overflowed; the sign is then invalid.
  bool in_range() const { return in_range_; }
  /// Returns the sign of the exact sum, which is the sign of the largest component.
  int sign() const { return size_ == 0 ? 0 : sign_of(components_[size_ - 1]); }

 private:
  double components_[capacity];
  int size_ = 0;
  bool in_range_ = true;
};

/// An exact dyadic rational mantissa * 2^exponent: closed under +, -, *, without the gcds of a rational type.
/// Any finite double converts, and the range is unlimited. It is the last stage of every exact decision.
class Dyadic {
 public:
  /// Integers of up to 1024 bits stay on the stack.
  using Integer = boost::multiprecision::number<
      boost::multiprecision::cpp_int_backend<1024, 0, boost::multiprecision::signed_magnitude,
                                             boost::multiprecision::unchecked, std::allocator<std::uint64_t>>,
      boost::multiprecision::et_off>;

  Dyadic() = default;
  /// Converts exactly; value must be finite.
  Dyadic(double value) {  // NOLINT(google-explicit-constructor): formulas read better
    if (value == 0) return;
    int exponent = 0;
    const double fraction = std::frexp(value, &exponent);
    mantissa_ = static_cast<std::int64_t>(std::ldexp(fraction, 53));
    exponent_ = exponent - 53;
  }

  friend Dyadic operator*(const Dyadic& a, const Dyadic& b) {
    return Dyadic(a.mantissa_ * b.mantissa_, a.exponent_ + b.exponent_);
  }
  friend Dyadic operator+(const Dyadic& a, const Dyadic& b) {
    if (a.mantissa_.is_zero()) return b;
    if (b.mantissa_.is_zero()) return a;
    if (a.exponent_ < b.exponent_) return b + a;
    const Integer shifted = a.mantissa_ << static_cast<unsigned>(a.exponent_ - b.exponent_);
    return Dyadic(shifted + b.mantissa_, b.exponent_);
  }
  friend Dyadic operator-(const Dyadic& a) { return Dyadic(-a.mantissa_, a.exponent_); }
  friend Dyadic operator-(const Dyadic& a, const Dyadic& b) { return a + -b; }

  int sign() const { return mantissa_.sign(); }
  const Integer& mantissa() const { return mantissa_; }
  int exponent() const { return exponent_; }

 private:
  Dyadic(Integer mantissa, int exponent) : mantissa_(std::move(mantissa)), exponent_(exponent) {}

  Integer mantissa_ = 0;
  int exponent_ = 0;
};

/// Rounds numerator / denominator (denominator > 0) to S, to nearest even, subnormals and overflow to
/// infinity included; never returns -0.
template <class S>
S round_quotient(const Dyadic& numerator, const Dyadic& denominator) {
  using Integer = Dyadic::Integer;
  using Limits = std::numeric_limits<S>;
  if (numerator.sign() == 0) return S(0);
  Integer top = abs(numerator.mantissa());
  Integer bottom = denominator.mantissa();
  const int exponent = numerator.exponent() - denominator.exponent();
  // value = top / bottom * 2^exponent lies within a factor of 2 of 2^magnitude. Quanta of 2^quantum are two
  // bits finer than the spacing of S there, but no finer than subnormals need; the remainder is the sticky
  // bit.
  const int magnitude = static_cast<int>(msb(top)) - static_cast<int>(msb(bottom)) + exponent;
  const int smallest = Limits::min_exponent - Limits::digits;  // exponent of the least subnormal
  int quantum = magnitude - Limits::digits - 2;
  if (quantum < smallest - 2) quantum = smallest - 2;
  const int shift = exponent - quantum;
  if (shift > 0) top <<= static_cast<unsigned>(shift);
  if (shift < 0) bottom <<= static_cast<unsigned>(-shift);
  Integer quotient, remainder;
  divide_qr(top, bottom, quotient, remainder);
  const bool sticky = !remainder.is_zero();
  // Rounds quotient (+ sticky) * 2^quantum to the grid of S.
  if (quotient.is_zero()) return S(0);  // below a quarter of the least subnormal
  const int top_bit = static_cast<int>(msb(quotient)) + quantum;
  int grid = top_bit - Limits::digits + 1;
  if (grid < smallest) grid = smallest;
  const int drop = grid - quantum;  // >= 1 by the choice of quantum
  Integer kept = quotient >> static_cast<unsigned>(drop);
  const Integer rest = quotient - (kept << static_cast<unsigned>(drop));
  const Integer half = Integer(1) << static_cast<unsigned>(drop - 1);
  const int against = rest.compare(half);
  if (against > 0 || (against == 0 && (sticky || bit_test(kept, 0)))) ++kept;
  const S size = std::ldexp(static_cast<S>(kept.convert_to<std::uint64_t>()), grid);
  return size == 0 ? S(0) : numerator.sign() < 0 ? -size : size;
}

/// Returns the sign of a*b - c*d, exactly: first by a filter in double, then from the products' error-free
/// halves, then by an expansion, then by Dyadic. The filter takes 6 flops and a comparison.
inline int sign_of_cross(DoubleDouble a, DoubleDouble b, DoubleDouble c, DoubleDouble d) {
  const double left = a.hi * b.hi, right = c.hi * d.hi;
  const double difference = left - right;
  const double size = std::fabs(left) + std::fabs(right);
  // Three relative errors of 2^-53 per product, one of the difference; 2^-1000 covers underflow.
  if (std::fabs(difference) > 0x1p-50 * size + 0x1p-1000) return sign_of(difference);
  if (a.lo == 0 && b.lo == 0 && c.lo == 0 && d.lo == 0) {
    const bool left_zero = a.hi == 0 || b.hi == 0, right_zero = c.hi == 0 || d.hi == 0;
    if (left_zero && right_zero) return 0;
    if (left_zero) return -sign_of(c.hi) * sign_of(d.hi);
    if (right_zero) return sign_of(a.hi) * sign_of(b.hi);
    if (size >= 0x1p-900 && size <= 0x1p900 && std::fabs(left) >= 0x1p-900 && std::fabs(right) >= 0x1p-900) {
      // The hi parts are the rounded products, so by monotonicity they order the products unless they are
      // equal.
      const DoubleDouble p = two_product(a.hi, b.hi), q = two_product(c.hi, d.hi);
      return p.hi != q.hi ? sign_of(p.hi - q.hi) : sign_of(p.lo - q.lo);
    }
  } else {
    ExpansionSum<16> sum;
    sum.add_product(a, b, 1);
    sum.add_product(c, d, -1);
    if (sum.in_range()) return sum.sign();
  }
  const auto whole = [](DoubleDouble x) { return Dyadic(x.hi) + Dyadic(x.lo); };
  return (whole(a) * whole(b) - whole(c) * whole(d)).sign();
}

}  // namespace kbvh
