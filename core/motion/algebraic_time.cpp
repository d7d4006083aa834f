#include "core/motion/algebraic_time.hpp"

#include <algorithm>
#include <limits>
#include <optional>

#include "core/base/assert.hpp"

namespace kbvh {

using Integer = Dyadic::Integer;

namespace {

/// Returns the middle of two times with one exponent.
DyadicTime middle(const DyadicTime& begin, const DyadicTime& end) {
  return {begin.numerator + end.numerator, begin.exponent + 1};
}
/// Returns the middle of [k, k + 1] / 2^exponent.
DyadicTime middle(const DyadicTime& begin) {
  return {begin.numerator * 2 + 1, begin.exponent + 1};
}
DyadicTime doubled(const DyadicTime& t) {
  return {t.numerator * 2, t.exponent + 1};
}

/// Returns value / 2^lowest, which must be an integer.
Integer scaled(const Dyadic& value, int lowest) {
  if (value.sign() == 0) return 0;
  const int shift = value.exponent() - lowest;
  if (shift >= 0) return value.mantissa() << unsigned(shift);
  return value.mantissa() / (Integer(1) << unsigned(-shift));
}
/// Returns the exponent of the lowest bit that is set.
int lowest_bit(const Dyadic& value) {
  return value.exponent() + int(lsb(abs(value.mantissa())));
}

}  // namespace

template <int most>
BasicPolynomial<most> BasicPolynomial<most>::from(std::span<const Dyadic> coefficients) {
  KBVH_ASSERT(coefficients.size() <= std::size_t(most) + 1);
  BasicPolynomial result;
  std::optional<int> lowest;
  for (const Dyadic& value : coefficients)
    if (value.sign() != 0) lowest = std::min(lowest.value_or(lowest_bit(value)), lowest_bit(value));
  if (!lowest) return result;
  for (std::size_t i = 0; i < coefficients.size(); ++i)
    result.coefficient_[i] = scaled(coefficients[i], *lowest);
  result.set_degree(int(coefficients.size()) - 1);
  return result;
}

template <int most>
BasicPolynomial<most> BasicPolynomial<most>::plus(const BasicPolynomial& other) const {
  BasicPolynomial result;
  const int degree = std::max(degree_, other.degree_);
  for (int i = 0; i <= degree; ++i) result.coefficient_[i] = coefficient_[i] + other.coefficient_[i];
  result.set_degree(degree);
  return result;
}

template <int most>
BasicPolynomial<most> BasicPolynomial<most>::negative() const {
  BasicPolynomial result = *this;
  for (int i = 0; i <= degree_; ++i) result.coefficient_[i] = -coefficient_[i];
  return result;
}

template <int most>
BasicPolynomial<most> BasicPolynomial<most>::times(const BasicPolynomial& other) const {
  BasicPolynomial result;
  if (is_zero() || other.is_zero()) return result;
  KBVH_ASSERT(degree_ + other.degree_ <= most);
  for (int i = 0; i <= degree_; ++i)
    for (int j = 0; j <= other.degree_; ++j)
      result.coefficient_[i + j] += coefficient_[i] * other.coefficient_[j];
  result.set_degree(degree_ + other.degree_);
  return result;
}

template <int most>
BasicPolynomial<most> BasicPolynomial<most>::derivative() const {
  BasicPolynomial result;
  for (int i = 1; i <= degree_; ++i) result.coefficient_[i - 1] = coefficient_[i] * i;
  result.set_degree(degree_ - 1);
  return result;
}

template <int most>
void BasicPolynomial<most>::drop_powers_of_two() {
  if (is_zero()) return;
  unsigned shift = ~0U;
  for (int i = 0; i <= degree_; ++i)
    if (!coefficient_[i].is_zero()) shift = std::min(shift, unsigned(lsb(abs(coefficient_[i]))));
  if (shift == 0) return;
  for (int i = 0; i <= degree_; ++i) coefficient_[i] >>= shift;  // exact: the shifted-out bits are zero
}

template <int most>
void BasicPolynomial<most>::drop_common_factor() {
  // Remainders of degree 6 grow to many times the length that they need, and a gcd of short numbers costs
  // more than it saves.
  constexpr unsigned long_bits = 2048;
  if (is_zero() || msb(abs(coefficient_[degree_])) < long_bits) return;
  Integer factor = abs(coefficient_[degree_]);
  for (int i = 0; i < degree_ && msb(factor) != 0; ++i) factor = gcd(factor, coefficient_[i]);
  if (msb(factor) == 0) return;
  for (int i = 0; i <= degree_; ++i) coefficient_[i] /= factor;
}

template <int most>
BasicPolynomial<most> BasicPolynomial<most>::remainder(const BasicPolynomial& divisor) const {
  BasicPolynomial rest = *this;
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
  if constexpr (most > 5) rest.drop_common_factor();
  return rest;
}

template <int most>
void BasicPolynomial<most>::divide_out(const Integer& numerator, const Integer& denominator) {
  while (degree_ >= 1) {
    // Horner's scheme on denominator^degree p(t), so that every quotient is an integer.
    BasicPolynomial quotient;
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

template <int most>
int BasicPolynomial<most>::sign_at(const Integer& numerator, unsigned exponent) const {
  if (is_zero()) return 0;
  Integer value = coefficient_[degree_];
  for (int i = degree_ - 1; i >= 0; --i)
    value = value * numerator + (coefficient_[i] << (exponent * unsigned(degree_ - i)));
  return value.sign();
}

template <int most>
int BasicPolynomial<most>::sign_throughout(const Integer& begin, const Integer& end,
                                           unsigned exponent) const {
  constexpr int largest = 6;
  KBVH_ASSERT(degree_ <= largest);
  if (is_zero()) return 0;
  // With t = (begin + (end - begin) s) / 2^exponent, times 2^(degree exponent): the coefficients of s^i, then
  // 60, which all binomials divide, times the Bernstein coefficients over 0 <= s <= 1.
  constexpr int binomial[largest + 1][largest + 1] = {
      {1, 0, 0, 0, 0, 0, 0}, {1, 1, 0, 0, 0, 0, 0},   {1, 2, 1, 0, 0, 0, 0},   {1, 3, 3, 1, 0, 0, 0},
      {1, 4, 6, 4, 1, 0, 0}, {1, 5, 10, 10, 5, 1, 0}, {1, 6, 15, 20, 15, 6, 1}};
  const Integer length = end - begin;
  Integer power[largest + 1], length_power = 1;
  for (int i = 0; i <= degree_; ++i) {
    Integer sum = 0, begin_power = 1;
    for (int j = i; j <= degree_; ++j) {
      sum += ((coefficient_[j] * binomial[j][i]) << (exponent * unsigned(degree_ - j))) * begin_power;
      begin_power *= begin;
    }
    power[i] = sum * length_power;
    length_power *= length;
  }
  int throughout = 0;
  for (int k = 0; k <= degree_; ++k) {
    Integer sum = 0;
    for (int i = 0; i <= k; ++i) sum += power[i] * (60 * binomial[k][i] / binomial[degree_][i]);
    const int sign = sum.sign();
    if (k == 0) throughout = sign;
    const bool outer = k == 0 || k == degree_;
    if (sign != throughout && (outer || sign != 0)) return 0;
  }
  return throughout;
}

DyadicTime::DyadicTime(const Dyadic& value) {
  if (value.sign() == 0) return;
  const int lowest = std::min(lowest_bit(value), 0);
  numerator = scaled(value, lowest);
  exponent = unsigned(-lowest);
}

int compare(const DyadicTime& a, const DyadicTime& b) {
  const unsigned exponent = std::max(a.exponent, b.exponent);
  const Integer x = a.numerator << (exponent - a.exponent), y = b.numerator << (exponent - b.exponent);
  return x.compare(y);
}

template <class P>
BasicSturmSequence<P>::BasicSturmSequence(const P& p, const P& h) {
  sequence_.push_back(p);
  if (h.is_zero()) return;
  sequence_.push_back(h);
  for (;;) {
    const std::size_t n = sequence_.size();
    P next = -sequence_[n - 2].remainder(sequence_[n - 1]);
    if (next.is_zero()) return;
    sequence_.push_back(std::move(next));
  }
}

template <class P>
int BasicSturmSequence<P>::variations(const DyadicTime& t) const {
  int changes = 0, last = 0;
  for (const P& p : sequence_) {
    const int sign = p.sign_at(t.numerator, t.exponent);
    if (sign == 0) continue;
    if (last != 0 && sign != last) ++changes;
    last = sign;
  }
  return changes;
}

template <class P>
double BasicAlgebraicTime<P>::rounded(const DyadicTime& t, unsigned up) {
  constexpr unsigned bits = 50;
  if (t.exponent <= bits) return std::ldexp(t.numerator.convert_to<double>(), -int(t.exponent));
  const Integer below = t.numerator >> (t.exponent - bits);
  return std::ldexp(Integer(below + up).convert_to<double>(), -int(bits));
}

template <class P>
BasicAlgebraicTime<P>::BasicAlgebraicTime(const P& p, DyadicTime begin, DyadicTime end)
    : p_(p), begin_(std::move(begin)), end_(std::move(end)) {
  const unsigned exponent = std::max(begin_.exponent, end_.exponent);
  for (DyadicTime* t : {&begin_, &end_}) {
    t->numerator <<= exponent - t->exponent;
    t->exponent = exponent;
  }
}

template <class P>
int BasicAlgebraicTime<P>::sign(const P& q) const {
  if (q.is_zero()) return 0;
  if (dyadic_) return q.sign_at(begin_.numerator, begin_.exponent);
  if (const int sign = q.sign_throughout(begin_.numerator, end_.numerator, begin_.exponent)) return sign;
  // A Tarski query; p' q may be reduced modulo p, which preserves the Cauchy index.
  const P h = (p_.derivative() * q).remainder(p_);
  return BasicSturmSequence<P>(p_, h).index(begin_, end_);
}

template <class P>
int BasicAlgebraicTime<P>::compare_to(const DyadicTime& t) const {
  if (dyadic_) return compare(begin_, t);
  if (compare(t, begin_) <= 0) return 1;
  if (compare(t, end_) >= 0) return -1;
  const P line = P::line(-t.numerator, (Integer(1) << t.exponent) - t.numerator);
  return sign(line);
}

template <class P>
int BasicAlgebraicTime<P>::compare_to(BasicAlgebraicTime other) const {
  if (other.dyadic_) return compare_to(other.begin_);
  if (dyadic_) return -other.compare_to(begin_);
  if (compare(end_, other.begin_) <= 0) return -1;
  if (compare(other.end_, begin_) <= 0) return 1;
  // The only root of the other's polynomial in its interval is the other number.
  if (sign(other.p_) == 0 && compare_to(other.begin_) > 0 && compare_to(other.end_) < 0) return 0;
  BasicAlgebraicTime mine = *this;
  for (int bits = std::max(mine.width_bits(), other.width_bits());;) {
    bits = std::max(bits, 0) + 32;
    mine.refine(unsigned(bits));
    other.refine(unsigned(bits));
    if (mine.dyadic_ || other.dyadic_) return mine.compare_to(other);
    if (compare(mine.end_, other.begin_) <= 0) return -1;
    if (compare(other.end_, mine.begin_) <= 0) return 1;
  }
}

template <class P>
int BasicAlgebraicTime<P>::width_bits() const {
  const Integer length = end_.numerator - begin_.numerator;
  if (length.is_zero()) return std::numeric_limits<int>::max();
  const int above = int(msb(length)) + (msb(length) == lsb(length) ? 0 : 1);
  return int(begin_.exponent) - above;
}

template <class P>
void BasicAlgebraicTime<P>::refine(unsigned bits) {
  if (dyadic_ || width_bits() >= int(bits)) return;
  // At a root of odd multiplicity the sign changes; only the number of roots reveals the others.
  const int before = p_.sign_at(begin_.numerator, begin_.exponent);
  const bool crossing = before != p_.sign_at(end_.numerator, end_.exponent);
  std::optional<BasicSturmSequence<P>> roots;
  if (!crossing) roots.emplace(p_, p_.derivative());
  for (int rest = int(bits) - width_bits(); rest > 0; --rest) {
    const DyadicTime centre = middle(begin_, end_);
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

template <class P>
void append_inner_roots(P p, std::vector<BasicAlgebraicTime<P>>& roots) {
  p.divide_out(0, 1);
  p.divide_out(1, 1);
  // A root in the middle of an interval is divided out of the polynomial, and the search restarts.
  for (bool again = true; again && p.degree() >= 1;) {
    again = false;
    const BasicSturmSequence<P> count(p, p.derivative());
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

template class BasicPolynomial<5>;
template class BasicPolynomial<11>;
template class BasicSturmSequence<Polynomial>;
template class BasicSturmSequence<LongPolynomial>;
template class BasicAlgebraicTime<Polynomial>;
template class BasicAlgebraicTime<LongPolynomial>;
template void append_inner_roots(Polynomial, std::vector<BasicAlgebraicTime<Polynomial>>&);
template void append_inner_roots(LongPolynomial, std::vector<BasicAlgebraicTime<LongPolynomial>>&);

}  // namespace kbvh
