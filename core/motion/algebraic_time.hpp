#pragma once
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "core/motion/exact_arithmetic.hpp"

namespace kbvh {

/// A polynomial in t with integer coefficients, of degree at most 5: coefficient[i] of t^i. Degree -1: zero.
class Polynomial {
 public:
  using Integer = Dyadic::Integer;
  static constexpr int max_degree = 5;

  Polynomial() = default;
  /// Makes a polynomial of degree 1 from its values at t = 0 and t = 1.
  static Polynomial line(const Integer& begin, const Integer& end) {
    Polynomial result;
    result.coefficient_[0] = begin;
    result.coefficient_[1] = end - begin;
    result.set_degree(1);
    return result;
  }
  /// Makes a positive multiple of the polynomial with these coefficients, [0] of t^0, at most four.
  static Polynomial from(std::span<const Dyadic> coefficients);

  int degree() const { return degree_; }
  bool is_zero() const { return degree_ < 0; }
  const Integer& operator[](int i) const { return coefficient_[i]; }

  friend Polynomial operator+(const Polynomial& a, const Polynomial& b);
  friend Polynomial operator-(const Polynomial& a, const Polynomial& b);
  friend Polynomial operator-(const Polynomial& a);
  /// The sum of the degrees must not exceed `max_degree`.
  friend Polynomial operator*(const Polynomial& a, const Polynomial& b);
  Polynomial derivative() const;
  /// Returns a positive multiple of the remainder of the division by `divisor`, which must not be zero.
  Polynomial remainder(const Polynomial& divisor) const;
  /// Divides by (denominator t - numerator), which must be a factor, as often as possible.
  void divide_out(const Integer& numerator, const Integer& denominator);

  /// Returns the sign at t = numerator / 2^exponent.
  int sign_at(const Integer& numerator, unsigned exponent) const;
  /// Returns the signs of the Bernstein coefficients over [begin, end] / 2^exponent if they agree and none of
  /// the outer two is zero: the polynomial has this sign throughout. Otherwise returns 0. The degree is at
  /// most 3, and begin < end.
  int sign_throughout(const Integer& begin, const Integer& end, unsigned exponent) const;

 private:
  void set_degree(int at_most) {
    degree_ = at_most;
    while (degree_ >= 0 && coefficient_[degree_].is_zero()) --degree_;
  }
  void drop_powers_of_two();
  Integer coefficient_[max_degree + 1];
  int degree_ = -1;
};

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
class SturmSequence {
 public:
  SturmSequence(const Polynomial& p, const Polynomial& h);
  int index(const DyadicTime& begin, const DyadicTime& end) const {
    return variations(begin) - variations(end);
  }

 private:
  int variations(const DyadicTime& t) const;
  std::vector<Polynomial> sequence_;
};

/// An algebraic number: a dyadic number, or the only root of a polynomial strictly between two dyadic numbers
/// with one exponent, which are no roots.
class AlgebraicTime {
 public:
  explicit AlgebraicTime(DyadicTime t) : begin_(t), end_(t), dyadic_(true) {}
  /// Takes a polynomial of degree 1 to 3.
  AlgebraicTime(const Polynomial& p, DyadicTime begin, DyadicTime end);

  /// Returns the exact sign of a polynomial of degree at most 3.
  int sign(const Polynomial& q) const;
  /// Returns the sign of this number - t.
  int compare_to(const DyadicTime& t) const;
  /// Returns the sign of this number - other.
  int compare_to(AlgebraicTime other) const;
  /// Halves the interval until it is no wider than 2^-bits.
  void refine(unsigned bits);
  /// Return the refined interval of a number in [0, 1]; exact down to a width of 2^-50, beyond that rounded
  /// outwards.
  double begin() const { return rounded(begin_, 0); }
  double end() const { return rounded(end_, dyadic_ && begin_.exponent <= 50 ? 0 : 1); }
  /// Returns whether the number is known to be dyadic, and then equal to `exact_begin`.
  bool is_dyadic() const { return dyadic_; }
  /// Return the interval, which contains the number in its interior unless it is dyadic.
  const DyadicTime& exact_begin() const { return begin_; }
  const DyadicTime& exact_end() const { return end_; }

 private:
  static double rounded(const DyadicTime& t, unsigned up);
  /// Returns the smallest b for which the interval is no wider than 2^-b; negative for wide ones.
  int width_bits() const;
  Polynomial p_;
  DyadicTime begin_, end_;
  bool dyadic_ = false;
};

/// Appends the distinct roots of p strictly between 0 and 1; p has degree at most 3 and is not zero.
void append_inner_roots(Polynomial p, std::vector<AlgebraicTime>& roots);

}  // namespace kbvh
