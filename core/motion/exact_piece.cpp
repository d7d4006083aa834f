#include "core/motion/exact_piece.hpp"

#include <cmath>
#include <cstdio>
#include <limits>
#include <stdexcept>

#include "core/motion/exact_arithmetic.hpp"
#include "core/motion/exact_line.hpp"

namespace kbvh {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

template <class S>
bool same_frame(const Piece<S>& a, const Piece<S>& b) {
  return a.kind == b.kind && a.t0 == b.t0 && (a.kind == PieceKind::ray || a.t1 == b.t1);
}

/// a - b for two pieces in one frame, exact: g(t) = first + (second - first) s for chords, s = (t - t0) / (t1
/// - t0); g(t) = first + second s for rays, s = t - t0.
struct Difference {
  DoubleDouble first, second;
};

template <class S>
Difference difference(const Piece<S>& a, const Piece<S>& b) {
  return {two_diff(static_cast<double>(a.x0), static_cast<double>(b.x0)),
          two_diff(static_cast<double>(a.x1), static_cast<double>(b.x1))};
}

DoubleDouble negated(DoubleDouble x) {
  return {-x.hi, -x.lo};
}

/// Returns the sign of a - b; rounding is monotone, so unequal hi parts decide.
int compare(DoubleDouble a, DoubleDouble b) {
  return a.hi != b.hi ? (a.hi > b.hi ? 1 : -1) : (a.lo > b.lo) - (a.lo < b.lo);
}

int slope_sign(const Difference& g, PieceKind kind) {
  return kind == PieceKind::chord ? compare(g.second, g.first) : sign_of(g.second.hi);
}

template <class S>
[[noreturn]] void refuse_parallel(const Crossing<S>& c) {
  char text[200];
  std::snprintf(text, sizeof text,
                "a crossing needs two slopes, but pieces from %.17g and %.17g (t0 = %.17g) are parallel",
                static_cast<double>(c.winner.x0), static_cast<double>(c.loser.x0), c.winner.t0);
  throw std::invalid_argument(text);
}

// ---- estimates in double, each with a bound on its error

struct Estimate {
  double value = 0;
  double error = 0;
};

/// Covers underflow in products and quotients of a few terms.
constexpr double kUnderflow = 0x1p-1000;

template <class S>
Estimate slope_estimate(const Piece<S>& p) {
  if (p.kind == PieceKind::ray) return {static_cast<double>(p.x1), 0};
  const double slope = (static_cast<double>(p.x1) - static_cast<double>(p.x0)) / (p.t1 - p.t0);
  return {slope, std::fabs(slope) * 0x1p-51 + kUnderflow};
}

template <class S>
Estimate value_estimate(const Piece<S>& p, double t) {
  const double start = static_cast<double>(p.x0);
  const double elapsed = t - p.t0;
  double way = 0, underflow = kUnderflow;
  if (p.kind == PieceKind::ray) {
    way = elapsed * static_cast<double>(p.x1);
  } else {
    const double dx = static_cast<double>(p.x1) - start;
    way = elapsed / (p.t1 - p.t0) * dx;
    underflow += std::fabs(dx) * 0x1p-1070;
  }
  return {start + way, (std::fabs(start) + std::fabs(way)) * 0x1p-50 + underflow};
}

/// Estimates the root from pieces in different frames by a Newton step from the later start. An infinite
/// error marks `time` as invalid.
template <class S>
TimeEstimate general_root(const Crossing<S>& c) {
  const double from = c.winner.t0 > c.loser.t0 ? c.winner.t0 : c.loser.t0;
  const Estimate w = value_estimate(c.winner, from), l = value_estimate(c.loser, from);
  const Estimate ws = slope_estimate(c.winner), ls = slope_estimate(c.loser);
  const double gap = l.value - w.value,
               gap_error = (l.error + w.error + std::fabs(gap) * 0x1p-53) * (1 + 0x1p-40);
  const double slope = ls.value - ws.value;
  const double slope_error = (ls.error + ws.error + std::fabs(slope) * 0x1p-53) * (1 + 0x1p-40);
  const double step = gap / slope, root = from - step;
  const double least_slope = std::fabs(slope) - slope_error;
  if (!(least_slope > std::fabs(slope) * 0.5)) return {root, kInfinity};
  const double error = (gap_error + std::fabs(step) * slope_error) / least_slope;
  const double bound = (error + (std::fabs(step) + std::fabs(root)) * 0x1p-52 + kUnderflow) * 1.001;
  return {root, bound <= std::numeric_limits<double>::max() ? bound : kInfinity};
}

template <class S>
TimeEstimate root_estimate(const Crossing<S>& c) {
  if (!same_frame(c.winner, c.loser)) return general_root(c);
  const Difference g = difference(c.loser, c.winner);
  const bool chord = c.winner.kind == PieceKind::chord;
  // The hi parts carry a relative error of 2^-53; where the difference of ends cancels, the lo parts keep the
  // error small.
  double slope = g.second.hi, slope_error = 0;
  if (chord) {
    slope = (g.second.hi - g.first.hi) + (g.second.lo - g.first.lo);
    slope_error = (std::fabs(g.second.hi) + std::fabs(g.first.hi)) * 0x1p-104;
  }
  const double unit = chord ? c.winner.t1 - c.winner.t0 : 1.0;
  const double part = -g.first.hi / slope;
  const double step = part * unit, root = c.winner.t0 + step;
  // Relative: first 1, slope 3 (with slope_error), quotient, unit, product 1 each, of 2^-53.
  if (!(slope_error < std::fabs(slope) * 0x1p-53)) {
    return {root, kInfinity};
  }
  // A quotient that underflows is off by kUnderflow, then multiplied by unit.
  const double bound =
      (std::fabs(step) * 0x1p-50 + std::fabs(root) * 0x1p-53 + kUnderflow * (1 + unit)) * 1.001;
  return {root, bound <= std::numeric_limits<double>::max() ? bound : kInfinity};
}

// ---- exact forms, on big integers

/// The root as top / bottom, bottom > 0.
struct ExactRoot {
  Dyadic top, bottom;
};

template <class S>
ExactRoot exact_root(const Crossing<S>& c) {
  const ExactLine g = exact_difference(c.loser, c.winner);
  if (g.slope.sign() == 0) refuse_parallel(c);
  if (g.slope.sign() > 0) return {-g.constant, g.slope};
  return {g.constant, -g.slope};
}

}  // namespace

template <class S>
int compare_at(const Piece<S>& a, const Piece<S>& b, double t) {
  if (same_frame(a, b)) {
    const Difference g = difference(a, b);
    const DoubleDouble elapsed = two_diff(t, a.t0);
    if (a.kind == PieceKind::ray) return sign_of_cross(g.first, {1, 0}, negated(g.second), elapsed);
    return sign_of_cross(g.first, two_diff(a.t1, t), negated(g.second), elapsed);
  }
  const Estimate va = value_estimate(a, t), vb = value_estimate(b, t);
  const double apart = va.value - vb.value;
  if (std::fabs(apart) > (va.error + vb.error) * (1 + 0x1p-40)) return sign_of(apart);
  const ExactLine g = exact_difference(a, b);
  return (g.constant + g.slope * Dyadic(t)).sign();
}

template <class S>
int compare_slopes(const Piece<S>& a, const Piece<S>& b) {
  if (same_frame(a, b)) return slope_sign(difference(a, b), a.kind);
  if (a.kind == PieceKind::ray && b.kind == PieceKind::ray) return (a.x1 > b.x1) - (a.x1 < b.x1);
  const Estimate sa = slope_estimate(a), sb = slope_estimate(b);
  const double apart = sa.value - sb.value;
  if (std::fabs(apart) > (sa.error + sb.error) * (1 + 0x1p-40)) return sign_of(apart);
  return exact_difference(a, b).slope.sign();
}

template <class S>
TimeEstimate crossing_estimate(const Crossing<S>& crossing) {
  const TimeEstimate quick = root_estimate(crossing);
  if (quick.error < kInfinity) return quick;
  // The slopes nearly agree, so the double arithmetic above has no correct digits.
  const ExactRoot root = exact_root(crossing);
  const double time = round_quotient<double>(root.top, root.bottom);
  return {time, std::isinf(time) ? kInfinity : std::fabs(time) * 0x1p-53 + 0x1p-1074};
}

template <class S>
int compare_crossing_to(const Crossing<S>& c, double t) {
  // At t the difference loser - winner has the sign of its slope times the sign of t - root.
  const int slope = compare_slopes(c.loser, c.winner);
  if (slope == 0) refuse_parallel(c);
  return -slope * compare_at(c.loser, c.winner, t);
}

template <class S>
int compare_crossings(const Crossing<S>& x, const Crossing<S>& y) {
  if (same_frame(x.winner, x.loser) && same_frame(y.winner, y.loser) && same_frame(x.winner, y.winner)) {
    // In the frame's own time a root is -first / (second - first) (chord) or -first / second (ray). In both
    // cases the difference of two roots has the numerator second_x first_y - first_x second_y.
    const Difference f = difference(x.loser, x.winner), g = difference(y.loser, y.winner);
    const int slopes = slope_sign(f, x.winner.kind) * slope_sign(g, x.winner.kind);
    if (slopes == 0) refuse_parallel(slope_sign(f, x.winner.kind) == 0 ? x : y);
    return slopes * sign_of_cross(f.second, g.first, f.first, g.second);
  }
  const TimeEstimate rx = root_estimate(x), ry = root_estimate(y);
  const double apart = rx.time - ry.time;
  if (std::fabs(apart) > (rx.error + ry.error) * (1 + 0x1p-40)) return sign_of(apart);
  const ExactRoot ex = exact_root(x), ey = exact_root(y);
  return (ex.top * ey.bottom - ey.top * ex.bottom).sign();
}

template <class S>
int compare_at_crossing(const Piece<S>& a, const Piece<S>& b, const Crossing<S>& c) {
  const bool shared = same_frame(a, b);
  if (shared && same_frame(c.winner, c.loser) && same_frame(a, c.winner)) {
    // At the root a - b equals (first_ab second_c - second_ab first_c) over the slope of c, for chords and
    // rays.
    const Difference ab = difference(a, b), lw = difference(c.loser, c.winner);
    const int slope = slope_sign(lw, a.kind);
    if (slope == 0) refuse_parallel(c);
    return slope * sign_of_cross(ab.first, lw.second, ab.second, lw.first);
  }
  const TimeEstimate root = root_estimate(c);
  if (root.error < kInfinity) {
    const Estimate va = value_estimate(a, root.time), vb = value_estimate(b, root.time);
    const Estimate sa = slope_estimate(a), sb = slope_estimate(b);
    const double drift = std::fabs(sa.value - sb.value) + sa.error + sb.error;
    const double apart = va.value - vb.value;
    if (std::fabs(apart) > (va.error + vb.error + drift * root.error + kUnderflow) * (1 + 0x1p-40)) {
      return sign_of(apart);
    }
  }
  const ExactRoot r = exact_root(c);
  const ExactLine g = exact_difference(a, b);
  return (g.constant * r.bottom + g.slope * r.top).sign();
}

#define KBVH_INSTANTIATE(S)                                               \
  template int compare_at(const Piece<S>&, const Piece<S>&, double);      \
  template int compare_slopes(const Piece<S>&, const Piece<S>&);          \
  template TimeEstimate crossing_estimate(const Crossing<S>&);            \
  template int compare_crossing_to(const Crossing<S>&, double);           \
  template int compare_crossings(const Crossing<S>&, const Crossing<S>&); \
  template int compare_at_crossing(const Piece<S>&, const Piece<S>&, const Crossing<S>&);
KBVH_INSTANTIATE(float)
KBVH_INSTANTIATE(double)
#undef KBVH_INSTANTIATE

}  // namespace kbvh
