#include "core/motion/round_curve.hpp"

#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>
#include <type_traits>

#include "core/base/library_gaps.hpp"
#include "core/motion/admissible.hpp"
#include "core/motion/exact_arithmetic.hpp"
#include "core/motion/precise_quotient.hpp"

namespace kbvh {
namespace {

// A value is x0 rest + x1 share + bend both + twist third, with share = s, rest = 1 - s, both = s (1 - s) and
// third = s^2 (1 - s). The weights are the same for all values of a call.

/// Product of two double-doubles, with a relative error below 2^-100.
DoubleDouble multiplied(DoubleDouble a, DoubleDouble b) {
  const DoubleDouble head = two_product(a.hi, b.hi);
  return two_sum(head.hi, head.lo + (a.hi * b.lo + a.lo * b.hi));
}

bool usable_part(double x) {
  return x == 0 || (std::fabs(x) >= 0x1p-250 && std::fabs(x) <= 0x1p250);
}

struct Weights {
  DoubleDouble rest, share, both, third;  ///< each with a relative error below 2^-98
  bool in_range = false;                  ///< false: the times are so extreme that only integers are safe
  bool exact = false;                     ///< the hi parts are the exact weights
  double t0 = 0, t1 = 0, t = 0;
};

Weights weights(double t0, double t1, double t) {
  Weights w;
  w.t0 = t0, w.t1 = t1, w.t = t;
  DoubleDouble elapsed = two_diff(t, t0), left = two_diff(t1, t), duration = two_diff(t1, t0);
  // The unit of time does not matter; a power of two brings the duration near 1 exactly.
  const int scale = -std::ilogb(duration.hi);
  for (DoubleDouble* x : {&elapsed, &left, &duration})
    *x = {std::ldexp(x->hi, scale), std::ldexp(x->lo, scale)};
  w.in_range = usable_part(elapsed.hi) && usable_part(elapsed.lo) && usable_part(left.hi) &&
               usable_part(left.lo) && usable_part(duration.lo) && elapsed.hi > 0 && left.hi > 0;
  if (!w.in_range) return w;
  w.share = precise_quotient(elapsed, duration);
  w.rest = precise_quotient(left, duration);
  w.both = multiplied(w.share, w.rest);
  w.third = multiplied(w.share, w.both);
  const DoubleDouble back = two_product(w.share.hi, duration.hi);
  const DoubleDouble both = two_product(w.share.hi, w.rest.hi), third = two_product(w.share.hi, both.hi);
  w.exact = elapsed.lo == 0 && duration.lo == 0 && back.hi == elapsed.hi && back.lo == 0 &&
            w.share.hi + w.rest.hi == 1 && 1 - w.rest.hi == w.share.hi && both.lo == 0 && third.lo == 0;
  if (w.exact)
    w.rest = {w.rest.hi, 0}, w.share = {w.share.hi, 0}, w.both = {both.hi, 0}, w.third = {third.hi, 0};
  return w;
}

/// The numbers of one value, in double.
struct Terms {
  double x0, x1, bend, twist;
};

/// The last stage: rounds the exact quotient.
template <class S>
S round_by_integers(const Terms& v, const Weights& w) {
  const Dyadic t0(w.t0), elapsed = Dyadic(w.t) - t0, duration = Dyadic(w.t1) - t0, left = duration - elapsed;
  const Dyadic square = duration * duration;
  const Dyadic chord = (Dyadic(v.x0) * left + Dyadic(v.x1) * elapsed) * square;
  const Dyadic curve = (Dyadic(v.bend) * duration + Dyadic(v.twist) * elapsed) * elapsed * left;
  return round_quotient<S>(chord + curve, square * duration);
}

/// Returns the value if exact expansions tell on which side of the midpoint of two neighbours it is.
template <class S>
std::optional<S> round_by_expansion(const Terms& v, const Weights& w, S lower, S upper) {
  const double low = static_cast<double>(lower);
  const double half_gap = 0.5 * (static_cast<double>(upper) - low);
  if (!(half_gap >= 0x1p-900)) return {};
  ExpansionSum<12> side;
  side.add_product(v.x0, w.rest.hi);
  side.add_product(v.x1, w.share.hi);
  side.add_product(v.bend, w.both.hi);
  side.add_product(v.twist, w.third.hi);
  if (!side.in_range()) return {};
  side.add(-low);
  side.add(-half_gap);
  const int sign = side.sign();
  if (sign != 0) return (sign < 0 ? lower : upper) + S(0);
  using Bits = std::conditional_t<std::is_same_v<S, float>, std::uint32_t, std::uint64_t>;
  return ((bit_cast<Bits>(lower) & 1) == 0 ? lower : upper) + S(0);
}

/// Rounds one value that the first stage left.
template <class S>
S round_hard(const Terms& v, const Weights& w, RoundingStats& stats) {
  ++stats.second_stage;
  if (v.bend == 0 && v.twist == 0 && v.x0 == v.x1) return static_cast<S>(v.x0) + S(0);
  if (w.in_range) {
    const DoubleDouble a = multiplied({v.x0, 0}, w.rest), b = multiplied({v.x1, 0}, w.share),
                       c = multiplied({v.bend, 0}, w.both), d = multiplied({v.twist, 0}, w.third);
    DoubleDouble sum = two_sum(a.hi, b.hi);
    double tail = sum.lo + (a.lo + b.lo);
    for (const DoubleDouble& term : {c, d}) {
      const DoubleDouble next = two_sum(sum.hi, term.hi);
      tail += next.lo + term.lo;
      sum.hi = next.hi;
    }
    const DoubleDouble value = two_sum(sum.hi, tail);
    // Some twenty errors of at most 2^-98 of the sum of magnitudes.
    const double error =
        (std::fabs(a.hi) + std::fabs(b.hi) + std::fabs(c.hi) + std::fabs(d.hi)) * 0x1p-92 + 0x1p-1040;
    S lower, upper;
    if constexpr (std::is_same_v<S, float>) {
      // Rounding hi to float is correct unless hi is a midpoint; then, and near cancellation, lo and error
      // matter.
      const double reach = std::fabs(value.hi) * 0x1p-52 + std::fabs(value.lo) + error;
      lower = static_cast<float>(value.hi - reach);
      upper = static_cast<float>(value.hi + reach);
      if (lower != upper && std::nextafter(lower, upper) == upper) {
        // The midpoint of two floats is a double near hi, so that the difference is exact.
        const double middle = 0.5 * (static_cast<double>(lower) + static_cast<double>(upper));
        const double side = (value.hi - middle) + value.lo;
        if (std::fabs(side) > 2 * error) return (side < 0 ? lower : upper) + S(0);
      }
    } else {
      lower = value.hi + (value.lo - error);
      upper = value.hi + (value.lo + error);
    }
    if (lower == upper) return lower + S(0);
    if (w.exact && std::nextafter(lower, upper) == upper &&
        std::fabs(upper) < std::numeric_limits<S>::max() && std::fabs(lower) < std::numeric_limits<S>::max())
      if (const std::optional<S> rounded = round_by_expansion<S>(v, w, lower, upper)) return *rounded;
  }
  ++stats.exact;
  return round_by_integers<S>(v, w);
}

/// Rounds one value: the first stage, for floats, and what it leaves.
template <class S>
[[gnu::always_inline]] inline S round_value(const Terms& v, const Weights& w, RoundingStats& stats) {
  if constexpr (std::is_same_v<S, float>) {
    const double a = v.x0 * w.rest.hi, b = v.x1 * w.share.hi, c = v.bend * w.both.hi,
                 d = v.twist * w.third.hi;
    const double value = (a + b) + (c + d);
    // Each term and each sum has one rounding error, each weight one more.
    const double error = (std::fabs(a) + std::fabs(b) + std::fabs(c) + std::fabs(d)) * 0x1p-50 + 0x1p-1040;
    const auto lower = static_cast<float>(value - error), upper = static_cast<float>(value + error);
    if (w.in_range && lower == upper) return lower + 0.0F;
  }
  return round_hard<S>(v, w, stats);
}

void check_times(double t0, double t1, double t) {
  const auto refuse = [&](const char* rule) {
    throw std::invalid_argument(std::string("position on a curve: ") + rule + ", but t0 = " +
                                number_text(t0) + ", t1 = " + number_text(t1) + ", t = " + number_text(t));
  };
  if (!(t0 < t1)) refuse("a segment needs t0 < t1");
  if (!(t0 <= t && t <= t1)) refuse("t must lie between t0 and t1");
  if (!(t0 >= -0x1p900 && t1 <= 0x1p900)) refuse("times are limited to 2^900");
}

template <class S>
Terms terms(const S* x0, const S* x1, const S* bend, const S* twist, std::size_t i) {
  return {static_cast<double>(x0[i]), static_cast<double>(x1[i]), static_cast<double>(bend[i]),
          twist == nullptr ? 0.0 : static_cast<double>(twist[i])};
}

}  // namespace

template <class S>
void round_curve(const S* x0, const S* x1, const S* bend, const S* twist, std::size_t count, double t0,
                 double t1, double t, S* out, RoundingStats* stats) {
  check_times(t0, t1, t);
  RoundingStats unused;
  RoundingStats& sums = stats != nullptr ? *stats : unused;
  sums.values += count;
  if (t == t0 || t == t1) {
    const S* const stored = t == t0 ? x0 : x1;
    for (std::size_t i = 0; i < count; ++i) out[i] = stored[i] + S(0);
    return;
  }
  const Weights w = weights(t0, t1, t);
  for (std::size_t i = 0; i < count; ++i) out[i] = round_value<S>(terms(x0, x1, bend, twist, i), w, sums);
}

template <class S>
void round_curve_vertices(const S* x0, const S* x1, const S* bend, const S* twist,
                          const std::uint32_t* vertices, std::size_t count, double t0, double t1, double t,
                          S* out, RoundingStats* stats) {
  check_times(t0, t1, t);
  RoundingStats unused;
  RoundingStats& sums = stats != nullptr ? *stats : unused;
  sums.values += 3 * count;
  const S* const stored = t == t0 ? x0 : t == t1 ? x1 : nullptr;
  const Weights w = stored == nullptr ? weights(t0, t1, t) : Weights{};
  for (std::size_t k = 0; k < count; ++k)
    for (std::size_t i = std::size_t(3) * vertices[k]; i < std::size_t(3) * vertices[k] + 3; ++i)
      out[i] = stored != nullptr ? stored[i] + S(0) : round_value<S>(terms(x0, x1, bend, twist, i), w, sums);
}

template <class S>
S round_piece(const CurvedPiece<S>& piece, double t, RoundingStats* stats) {
  S out;
  round_curve(&piece.x0, &piece.x1, &piece.bend, &piece.twist, 1, piece.t0, piece.t1, t, &out, stats);
  return out;
}

#define KBVH_INSTANTIATE(S)                                                                                  \
  template void round_curve(const S*, const S*, const S*, const S*, std::size_t, double, double, double, S*, \
                            RoundingStats*);                                                                 \
  template void round_curve_vertices(const S*, const S*, const S*, const S*, const std::uint32_t*,           \
                                     std::size_t, double, double, double, S*, RoundingStats*);               \
  template S round_piece(const CurvedPiece<S>&, double, RoundingStats*);
KBVH_INSTANTIATE(float)
KBVH_INSTANTIATE(double)
#undef KBVH_INSTANTIATE

}  // namespace kbvh
