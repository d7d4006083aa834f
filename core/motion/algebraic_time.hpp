#pragma once
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "core/motion/exact_arithmetic.hpp"

namespace kbvh {

/// A polynomial in t with integer coefficients, of degree at most `most`: coefficient[i] of t^i. Degree -1:
/// zero.
template <int most>
class BasicPolynomial {
 public:
  using Integer = Dyadic::Integer;
  static constexpr int max_degree = most;

  BasicPolynomial() = default;
  /// Makes a polynomial of degree 1 from its values at t = 0 and t = 1.
  static BasicPolynomial line(const Integer& begin, const Integer& end) {
    BasicPolynomial result;
    result.coefficient_[0] = begin;
    result.coefficient_[1] = end - begin;
    result.set_degree(1);
    return result;
  }
  /// Makes a positive multiple of the polynomial with these coefficients, [0] of t^0, at most `most` + 1.
  static BasicPolynomial from(std::span<const Dyadic> coefficients);

  int degree() const { return degree_; }
  bool is_zero() const { return degree_ < 0; }
  const Integer& operator[](int i) const { return coefficient_[i]; }

  friend BasicPolynomial operator+(const BasicPolynomial& a, const BasicPolynomial& b) { return a.plus(b); }
  friend BasicPolynomial operator-(const BasicPolynomial& a, const BasicPolynomial& b) { return a.plus(-b); }
  friend BasicPolynomial operator-(const BasicPolynomial& a) { return a.negative(); }
  /// The sum of the degrees must not exceed `max_degree`.
  friend BasicPolynomial operator*(const BasicPolynomial& a, const BasicPolynomial& b) { return a.times(b); }
  BasicPolynomial derivative() const;
  /// Returns a positive multiple of the remainder of the division by `divisor`, which must not be zero.
  BasicPolynomial remainder(const BasicPolynomial& divisor) const;
  /// Divides by (denominator t - numerator), which must be a factor, as often as possible.
  void divide_out(const Integer& numerator, const Integer& denominator);

  /// Returns the sign at t = numerator / 2^exponent.
  int sign_at(const Integer& numerator, unsigned exponent) const;
  /// Returns the signs of the Bernstein coefficients over [begin, end] / 2^exponent if they agree and none of
  /// the outer two is zero: the polynomial has this sign throughout. Otherwise returns 0. The degree is at
  /// most 6, and begin < end.
  int sign_throughout(const Integer& begin, const Integer& end, unsigned exponent) const;

 private:
  BasicPolynomial plus(const BasicPolynomial& other) const;
  BasicPolynomial negative() const;
  BasicPolynomial times(const BasicPolynomial& other) const;
  void set_degree(int at_most) {
    degree_ = at_most;
    while (degree_ >= 0 && coefficient_[degree_].is_zero()) --degree_;
  }
  void drop_powers_of_two();
  /// Divides by the common factor of coefficients that have become long.
  void drop_common_factor();
  Integer coefficient_[most + 1];
  int degree_ = -1;
};

/// Of times at which linear motions meet, and of pieces of degree up to 3.
using Polynomial = BasicPolynomial<5>;
/// Of degree up to 6 at algebraic times of degree up to 6: squared distances of linear motions.
using LongPolynomial = BasicPolynomial<11>;
extern template class BasicPolynomial<5>;
extern template class BasicPolynomial<11>;

/// A dyadic number numerator / 2^exponent.
struct DyadicTime {
  Polynomial::Integer numerator = 0;
  unsigned exponent = 0;

  DyadicTime() = default;
  DyadicTime(Polynomial::Integer n, unsigned e) : numerator(std::move(n)), exponent(e) {}
  explicit DyadicTime(const Dyadic& value);
};

/// Returns the sign of a - b.
int compare(const DyadicTime& a, const DyadicTime& b);

/// The signed remainder sequence of p and h. It computes the Cauchy index of h / p between two times that are
/// not roots of p (Basu, Pollack & Roy 2006, theorem 2.58): with h = p' this is the number of distinct roots
/// of p, with h = p' q the sum over these roots of the signs of q.
template <class P>
class BasicSturmSequence {
 public:
  BasicSturmSequence(const P& p, const P& h);
  int index(const DyadicTime& begin, const DyadicTime& end) const {
    return variations(begin) - variations(end);
  }

 private:
  int variations(const DyadicTime& t) const;
  std::vector<P> sequence_;
};

/// An algebraic number: a dyadic number, or the only root of a polynomial strictly between two dyadic numbers
/// with one exponent, which are no roots.
template <class P>
class BasicAlgebraicTime {
 public:
  explicit BasicAlgebraicTime(DyadicTime t) : begin_(t), end_(t), dyadic_(true) {}
  /// Takes a polynomial of degree 1 to (P::max_degree + 1) / 2.
  BasicAlgebraicTime(const P& p, DyadicTime begin, DyadicTime end);

  /// Returns the exact sign of a polynomial of degree at most (P::max_degree + 1) / 2.
  int sign(const P& q) const;
  /// Returns the sign of this number - t.
  int compare_to(const DyadicTime& t) const;
  /// Returns the sign of this number - other.
  int compare_to(BasicAlgebraicTime other) const;
  /// Halves the interval until it is no wider than 2^-bits.
  void refine(unsigned bits);
  /// Return the refined interval of a number in [0, 1]; exact down to a width of 2^-50, beyond that rounded
  /// outwards.
  double begin() const { return rounded(begin_, 0); }
  double end() const { return rounded(end_, dyadic_ && begin_.exponent <= 50 ? 0 : 1); }
  /// Return the interval, which contains the number in its interior; of one that is known to be dyadic, both
  /// ends are the number.
  const DyadicTime& exact_begin() const { return begin_; }
  const DyadicTime& exact_end() const { return end_; }

 private:
  static double rounded(const DyadicTime& t, unsigned up);
  /// Returns the smallest b for which the interval is no wider than 2^-b; negative for wide ones.
  int width_bits() const;
  P p_;
  DyadicTime begin_, end_;
  bool dyadic_ = false;
};
using AlgebraicTime = BasicAlgebraicTime<Polynomial>;

/// Appends the distinct roots of p strictly between 0 and 1; p has degree at most (P::max_degree + 1) / 2 and
/// is not zero.
template <class P>
void append_inner_roots(P p, std::vector<BasicAlgebraicTime<P>>& roots);

extern template class BasicSturmSequence<Polynomial>;
extern template class BasicSturmSequence<LongPolynomial>;
extern template class BasicAlgebraicTime<Polynomial>;
extern template class BasicAlgebraicTime<LongPolynomial>;
extern template void append_inner_roots(Polynomial, std::vector<BasicAlgebraicTime<Polynomial>>&);
extern template void append_inner_roots(LongPolynomial, std::vector<BasicAlgebraicTime<LongPolynomial>>&);

}  // namespace kbvh
