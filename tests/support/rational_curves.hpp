#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <vector>

#include "core/motion/curved_piece.hpp"
#include "core/motion/flight_plans.hpp"
#include "tests/support/rational_geometry.hpp"

// Curves by rational arithmetic, from the definition in core/motion/curved_piece.hpp and nothing else of the
// library: the reference for roots, order and signs.

namespace kbvh::test {

/// Coefficients, [0] of s^0; without leading zeros, empty: zero.
using RationalPolynomial = std::vector<Rational>;

inline void trim(RationalPolynomial& p) {
  while (!p.empty() && p.back().is_zero()) p.pop_back();
}

inline Rational value(const RationalPolynomial& p, const Rational& s) {
  Rational sum = 0;
  for (std::size_t i = p.size(); i-- > 0;) sum = sum * s + p[i];
  return sum;
}

inline RationalPolynomial derivative(const RationalPolynomial& p) {
  RationalPolynomial result;
  for (std::size_t i = 1; i < p.size(); ++i) result.push_back(p[i] * int(i));
  return result;
}

inline RationalPolynomial remainder(RationalPolynomial a, const RationalPolynomial& b) {
  while (a.size() >= b.size()) {
    const Rational factor = a.back() / b.back();
    const std::size_t shift = a.size() - b.size();
    for (std::size_t i = 0; i < b.size(); ++i) a[i + shift] -= factor * b[i];
    a.pop_back();
    trim(a);
  }
  return a;
}

inline RationalPolynomial common_divisor(RationalPolynomial a, RationalPolynomial b) {
  while (!b.empty()) {
    RationalPolynomial rest = remainder(a, b);
    a = std::move(b);
    b = std::move(rest);
    if (!b.empty()) {  // numbers grow otherwise
      const Rational leading = b.back();
      for (Rational& c : b) c /= leading;
    }
  }
  return a;
}

/// Sturm's sequence of the polynomial without its multiple roots.
class Sturm {
 public:
  explicit Sturm(const RationalPolynomial& p) {
    const RationalPolynomial slope = derivative(p);
    RationalPolynomial simple = p;
    if (const RationalPolynomial twice = common_divisor(p, slope); twice.size() > 1) {
      // The quotient of p by its divisor.
      RationalPolynomial rest = p, quotient(p.size() - twice.size() + 1, Rational(0));
      for (std::size_t i = quotient.size(); i-- > 0;) {
        quotient[i] = rest[i + twice.size() - 1] / twice.back();
        for (std::size_t j = 0; j < twice.size(); ++j) rest[i + j] -= quotient[i] * twice[j];
      }
      simple = quotient;
    }
    sequence_ = {simple, derivative(simple)};
    while (!sequence_.back().empty()) {
      RationalPolynomial next = remainder(sequence_[sequence_.size() - 2], sequence_.back());
      for (Rational& c : next) c = -c;
      sequence_.push_back(next);
    }
    sequence_.pop_back();
  }
  /// Returns the number of distinct roots with begin < root <= end.
  int roots_in(const Rational& begin, const Rational& end) const { return changes(begin) - changes(end); }
  /// Returns the sign of the polynomial without multiple roots.
  int sign(const Rational& s) const { return value(sequence_[0], s).sign(); }

 private:
  int changes(const Rational& s) const {
    int count = 0, last = 0;
    for (const RationalPolynomial& p : sequence_) {
      const int sign = value(p, s).sign();
      if (sign == 0) continue;
      count += last != 0 && sign != last ? 1 : 0;
      last = sign;
    }
    return count;
  }
  std::vector<RationalPolynomial> sequence_;
};

/// A root: alone in (begin, end], or begin == end, which it is.
struct RationalRoot {
  Rational begin, end;
};

/// Returns the distinct roots of a polynomial that is not zero with 0 <= root < 1, ascending, each in an
/// interval no wider than 2^-bits.
inline std::vector<RationalRoot> rational_roots(const RationalPolynomial& p, int bits) {
  std::vector<RationalRoot> roots;
  if (p.size() < 2) return roots;
  const Sturm sturm(p);
  if (value(p, 0).is_zero()) roots.push_back({0, 0});
  struct Part {
    Rational begin, end;
    int depth;
  };
  std::vector<Part> parts{{0, 1, 0}};
  while (!parts.empty()) {
    const Part part = parts.back();
    parts.pop_back();
    const int inside = sturm.roots_in(part.begin, part.end);
    if (inside == 0 || (inside == 1 && value(p, part.end).is_zero() && part.end == 1)) continue;
    if (inside == 1 && value(p, part.end).is_zero()) {
      roots.push_back({part.end, part.end});
      continue;
    }
    if (inside == 1 && part.depth >= bits) {
      roots.push_back({part.begin, part.end});
      continue;
    }
    const Rational middle = (part.begin + part.end) / 2;
    parts.push_back({middle, part.end, part.depth + 1});
    parts.push_back({part.begin, middle, part.depth + 1});
  }
  return roots;
}

/// Returns the difference a - b as a polynomial of s.
template <class S>
RationalPolynomial rational_difference(const CurvedPiece<S>& a, const CurvedPiece<S>& b) {
  const auto exact = [](S x, S y) { return Rational(Rational(double(x)) - Rational(double(y))); };
  const Rational start = exact(a.x0, b.x0), end = exact(a.x1, b.x1), bend = exact(a.bend, b.bend),
                 twist = exact(a.twist, b.twist);
  RationalPolynomial p{start, end - start + bend, twist - bend, -twist};
  trim(p);
  return p;
}

/// Returns x(t).
template <class S>
Rational rational_value(const CurvedPiece<S>& p, const Rational& t) {
  const Rational s = (t - Rational(p.t0)) / (Rational(p.t1) - Rational(p.t0));
  return value(rational_difference(p, CurvedPiece<S>{p.t0, p.t1, 0, 0, 0, 0}), s);
}

/// Returns the coordinates [vertex][3] of a body at t. All vertices have the same shares of the definition's
/// terms.
template <class S>
std::vector<Rational> rational_values(const FlightPlans<S>& plans, double t) {
  const auto times = plans.keyframe_times();
  const std::size_t k = plans.segment_at(t);
  const bool between = t > times[k] && k + 1 < times.size();
  Rational s = 0, of_bend, of_twist;
  if (between) s = (Rational(t) - Rational(times[k])) / (Rational(times[k + 1]) - Rational(times[k]));
  of_bend = s * (1 - s);
  of_twist = s * of_bend;
  std::vector<Rational> values;
  values.reserve(std::size_t(3) * plans.vertex_count());
  for (std::uint32_t v = 0; v < plans.vertex_count(); ++v)
    for (int axis = 0; axis < 3; ++axis) {
      Rational& x = values.emplace_back(double(plans.keyframe(k)[3 * v + std::uint32_t(axis)]));
      if (!between) continue;
      const CurvedPiece<S> piece = plans.curved_piece(v, axis, k);
      if (piece.x1 != piece.x0) x += (Rational(double(piece.x1)) - x) * s;
      if (piece.bend != 0) x += Rational(double(piece.bend)) * of_bend;
      if (piece.twist != 0) x += Rational(double(piece.twist)) * of_twist;
    }
  return values;
}

/// Returns each value's rank, ascending from 0; equal values have the same rank.
inline std::vector<std::uint32_t> ranks(const std::vector<Rational>& values) {
  std::vector<std::uint32_t> order(values.size()), result(values.size());
  std::iota(order.begin(), order.end(), 0u);
  std::sort(order.begin(), order.end(),
            [&](std::uint32_t a, std::uint32_t b) { return values[a].compare(values[b]) < 0; });
  for (std::size_t i = 1; i < order.size(); ++i)
    result[order[i]] = result[order[i - 1]] + (values[order[i]].compare(values[order[i - 1]]) == 0 ? 0 : 1);
  return result;
}

}  // namespace kbvh::test
