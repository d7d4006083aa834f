#include "core/continuous/algebraic_time.hpp"

#include <algorithm>
#include <optional>

#include "core/base/assert.hpp"

namespace kbvh {

using Integer = Polynomial::Integer;

namespace {

/// Returns the middle of [k, k + 1] / 2^exponent or of any two neighbouring times with one exponent.
DyadicTime middle(const DyadicTime& begin) {
  return {begin.numerator * 2 + 1, begin.exponent + 1};
}
DyadicTime doubled(const DyadicTime& t) {
  return {t.numerator * 2, t.exponent + 1};
}

}  // namespace

Polynomial operator+(const Polynomial& a, const Polynomial& b) {
  Polynomial result;
  const int degree = std::max(a.degree_, b.degree_);
  for (int i = 0; i <= degree; ++i) result.coefficient_[i] = a.coefficient_[i] + b.coefficient_[i];
  result.set_degree(degree);
  return result;
}

Polynomial operator-(const Polynomial& a) {
  Polynomial result = a;
  for (int i = 0; i <= a.degree_; ++i) result.coefficient_[i] = -a.coefficient_[i];
  return result;
}

Polynomial operator-(const Polynomial& a, const Polynomial& b) {
  return a + -b;
}

Polynomial operator*(const Polynomial& a, const Polynomial& b) {
  Polynomial result;
  if (a.is_zero() || b.is_zero()) return result;
  KBVH_ASSERT(a.degree_ + b.degree_ <= Polynomial::max_degree);
  for (int i = 0; i <= a.degree_; ++i)
    for (int j = 0; j <= b.degree_; ++j) result.coefficient_[i + j] += a.coefficient_[i] * b.coefficient_[j];
  result.set_degree(a.degree_ + b.degree_);
  return result;
}

Polynomial Polynomial::derivative() const {
  Polynomial result;
  for (int i = 1; i <= degree_; ++i) result.coefficient_[i - 1] = coefficient_[i] * i;
  result.set_degree(degree_ - 1);
  return result;
}

void Polynomial::drop_powers_of_two() {
  if (is_zero()) return;
  unsigned shift = ~0U;
  for (int i = 0; i <= degree_; ++i)
    if (!coefficient_[i].is_zero()) shift = std::min(shift, unsigned(lsb(abs(coefficient_[i]))));
  if (shift == 0) return;
  for (int i = 0; i <= degree_; ++i) coefficient_[i] >>= shift;  // exact: the shifted-out bits are zero
}

Polynomial Polynomial::remainder(const Polynomial& divisor) const {
  Polynomial rest = *this;
  const Integer& leading = divisor.coefficient_[divisor.degree_];
  const Integer size = abs(leading);
  while (rest.degree_ >= divisor.degree_) {
    const int shift = rest.degree_ - divisor.degree_;
    Integer factor = rest.coefficient_[rest.degree_];
    if (leading.sign() < 0) factor = -factor;
    for (int i = 0; i <= rest.degree_; ++i) rest.coefficient_[i] *= size;
    for (int i = 0; i <= divisor.degree_; ++i)
      rest.coefficient_[i + shift] -= factor * divisor.coefficient_[i];
    KBVH_ASSERT(rest.coefficient_[rest.degree_].is_zero());
    rest.set_degree(rest.degree_ - 1);
  }
  rest.drop_powers_of_two();
  return rest;
}

void Polynomial::divide_out(const Integer& numerator, const Integer& denominator) {
  while (degree_ >= 1) {
    // Horner's scheme on denominator^degree p(t), so that every quotient is an integer.
    Polynomial quotient;
    Integer carry = 0, power = 1;
    for (int i = degree_; i >= 1; --i) {
      carry = carry * numerator + coefficient_[i] * power;
      quotient.coefficient_[i - 1] = carry;  // times denominator^-(degree - i)
      power *= denominator;
    }
    if (!(carry * numerator + coefficient_[0] * power).is_zero()) return;
    // Brings the coefficients to one power: all times denominator^(degree - 1).
    Integer scale = 1;
    for (int i = 0; i < degree_; ++i) {
      quotient.coefficient_[i] *= scale;
      scale *= denominator;
    }
    quotient.set_degree(degree_ - 1);
    quotient.drop_powers_of_two();
    *this = quotient;
  }
}

int Polynomial::sign_at(const Integer& numerator, unsigned exponent) const {
  if (is_zero()) return 0;
  Integer value = coefficient_[degree_];
  for (int i = degree_ - 1; i >= 0; --i)
    value = value * numerator + (coefficient_[i] << (exponent * unsigned(degree_ - i)));
  return value.sign();
}

SturmSequence::SturmSequence(const Polynomial& p, const Polynomial& h) {
  sequence_.push_back(p);
  if (h.is_zero()) return;
  sequence_.push_back(h);
  for (;;) {
    const std::size_t n = sequence_.size();
    Polynomial next = -sequence_[n - 2].remainder(sequence_[n - 1]);
    if (next.is_zero()) return;
    sequence_.push_back(std::move(next));
  }
}

int SturmSequence::variations(const DyadicTime& t) const {
  int changes = 0, last = 0;
  for (const Polynomial& p : sequence_) {
    const int sign = p.sign_at(t.numerator, t.exponent);
    if (sign == 0) continue;
    if (last != 0 && sign != last) ++changes;
    last = sign;
  }
  return changes;
}

double AlgebraicTime::rounded(const DyadicTime& t, unsigned up) {
  constexpr unsigned bits = 50;
  if (t.exponent <= bits) return std::ldexp(t.numerator.convert_to<double>(), -int(t.exponent));
  const Integer below = t.numerator >> (t.exponent - bits);
  return std::ldexp(Integer(below + up).convert_to<double>(), -int(bits));
}

int AlgebraicTime::sign_throughout(const Polynomial& q) const {
  KBVH_ASSERT(q.degree() <= 2);
  const Integer& n = begin_.numerator;
  const unsigned e = begin_.exponent;
  const int first = q.sign_at(n, e), last = q.sign_at(end_.numerator, e);
  if (first == 0 || first != last) return 0;
  if (q.degree() < 2) return first;
  // Twice the middle coefficient, times 2^(2 e).
  const Integer middle = (q[0] << (2 * e + 1)) + ((q[1] * (2 * n + 1)) << e) + 2 * q[2] * n * (n + 1);
  return middle.sign() == first ? first : 0;
}

int AlgebraicTime::sign(const Polynomial& q) const {
  if (q.is_zero()) return 0;
  if (dyadic_) return q.sign_at(begin_.numerator, begin_.exponent);
  if (const int sign = sign_throughout(q)) return sign;
  // A Tarski query; p' q may be reduced modulo p, which preserves the Cauchy index.
  const Polynomial h = (p_.derivative() * q).remainder(p_);
  return SturmSequence(p_, h).index(begin_, end_);
}

void AlgebraicTime::refine(unsigned bits) {
  if (dyadic_ || begin_.exponent >= bits) return;
  // At a root of odd multiplicity the sign changes; only the number of roots reveals the others.
  const int before = p_.sign_at(begin_.numerator, begin_.exponent);
  const bool crossing = before != p_.sign_at(end_.numerator, end_.exponent);
  std::optional<SturmSequence> roots;
  if (!crossing) roots.emplace(p_, p_.derivative());
  while (begin_.exponent < bits) {
    const DyadicTime centre = middle(begin_);
    const int sign = p_.sign_at(centre.numerator, centre.exponent);
    if (sign == 0) {
      begin_ = end_ = centre;
      dyadic_ = true;
      return;
    }
    if (crossing ? sign != before : roots->index(doubled(begin_), centre) != 0) {
      begin_ = doubled(begin_);
      end_ = centre;
    } else {
      begin_ = centre;
      end_ = doubled(end_);
    }
  }
}

void append_inner_roots(Polynomial p, std::vector<AlgebraicTime>& roots) {
  p.divide_out(0, 1);
  p.divide_out(1, 1);
  // A root in the middle of an interval is divided out of the polynomial, and the search restarts.
  for (bool again = true; again && p.degree() >= 1;) {
    again = false;
    const SturmSequence count(p, p.derivative());
    std::vector<DyadicTime> begins{{0, 0}}, found;  // intervals of length 2^-exponent
    while (!begins.empty() && !again) {
      const DyadicTime begin = begins.back();
      begins.pop_back();
      const int inside = count.index(begin, {begin.numerator + 1, begin.exponent});
      if (inside == 0) continue;
      if (inside == 1) {
        found.push_back(begin);
        continue;
      }
      const DyadicTime centre = middle(begin);
      if (p.sign_at(centre.numerator, centre.exponent) == 0) {
        roots.emplace_back(centre);
        p.divide_out(centre.numerator, Integer(1) << centre.exponent);
        again = true;
      } else {
        begins.push_back(centre);
        begins.push_back(doubled(begin));
      }
    }
    if (again) continue;
    for (const DyadicTime& begin : found)
      roots.emplace_back(p, begin, DyadicTime{begin.numerator + 1, begin.exponent});
  }
}

}  // namespace kbvh
