#pragma once
#include "core/motion/exact_arithmetic.hpp"
#include "core/motion/piece.hpp"

namespace kbvh {

// Exact forms of linear pieces, on big integers: the last stage of comparisons.

/// x(t) = (constant + slope t) / scale, scale > 0.
struct ExactLine {
  Dyadic constant, slope, scale;
};

template <class S>
ExactLine exact_line(const Piece<S>& p) {
  const Dyadic x0(static_cast<double>(p.x0)), x1(static_cast<double>(p.x1)), t0(p.t0);
  if (p.kind == PieceKind::ray) return {x0 - x1 * t0, x1, Dyadic(1.0)};
  const Dyadic duration = Dyadic(p.t1) - t0, dx = x1 - x0;
  return {x0 * duration - dx * t0, dx, duration};
}

/// Computes a - b, up to a positive factor.
template <class S>
ExactLine exact_difference(const Piece<S>& a, const Piece<S>& b) {
  const ExactLine p = exact_line(a), q = exact_line(b);
  return {p.constant * q.scale - q.constant * p.scale, p.slope * q.scale - q.slope * p.scale, Dyadic(1.0)};
}

}  // namespace kbvh
