#include "core/motion/round_positions.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <limits>
#include <stdexcept>
#include <string>
#include <type_traits>

#include "core/base/library_gaps.hpp"
#include "core/kernels/kernel_set.hpp"
#include "core/motion/exact_arithmetic.hpp"
#include "core/motion/kernels/round.hpp"

namespace kbvh {
namespace {

/// Covers the double-double evaluation of round_one: each of about 12 errors is below 2^-104 of |x0| + |dx
/// ratio|, and underflow of error terms.
constexpr double kRelativeError = 0x1p-97, kUnderflowError = 0x1p-1040;
/// Calls for fewer values skip choose_tie_rule, which costs more than the second stage of a few ties.
constexpr std::size_t kChoiceWorthwhile = 48;

template <class S>
const RoundKernels<S>& round_kernels() {
  const KernelSet set = active_kernel_set();
  if constexpr (std::is_same_v<S, float>) {
    return KBVH_SELECT_KERNELS(set, round_float);
  } else {
    return KBVH_SELECT_KERNELS(set, round_double);
  }
}

[[noreturn]] void refuse_times(const char* rule, double t0, double t1, double t) {
  char text[160];
  std::snprintf(text, sizeof text, "position of a flight plan: %s, but t0 = %.17g, t1 = %.17g, t = %.17g",
                rule, t0, t1, t);
  throw std::invalid_argument(text);
}

bool usable(double x) {
  return x == 0 || (std::fabs(x) >= 0x1p-250 && std::fabs(x) <= 0x1p250);
}

void complete(TimeFraction& f, PieceKind kind) {
  const auto [wh, wl] = f.elapsed;
  const auto [dh, dl] = f.duration;
  f.in_range = usable(wh) && usable(wl) && usable(dl);
  f.single = wl == 0 && dl == 0;
  // Double-double division: one correction of the rounded quotient.
  const double first = wh / dh;
  const DoubleDouble back = two_product(first, dh);
  const double rest = ((wh - back.hi) - back.lo) + (wl - first * dl);
  const double second = rest / dh;
  f.ratio = two_sum(first, second);
  f.ratio_exact = f.single && wh == back.hi && back.lo == 0;
  // Short: 24 bits, so products with floats are exact in double; in a chord 1 - ratio is then either exact or
  // not short.
  f.rest = kind == PieceKind::chord ? 1 - f.ratio.hi : 1.0;
  const bool rest_exact = kind == PieceKind::ray || 1 - f.rest == f.ratio.hi;
  const auto is_short = [](double x) { return x == static_cast<double>(static_cast<float>(x)); };
  f.short_ratio = f.ratio_exact && rest_exact && is_short(f.ratio.hi) && is_short(f.rest);
  f.elapsed_halves = split_halves(wh);
  f.duration_halves = split_halves(dh);
  f.ratio_halves = split_halves(f.ratio.hi);
}

/// Returns the largest power of two that `spread` may have where the fraction is p / q + delta, or 0.
/// core/motion/kernels/round.cpp derives the conditions.
double largest_spread(double q, double delta) {
  for (double spread = 0x1p12; spread >= 4; spread /= 2) {
    const double reach = 0x1.04p-47 * spread;  // 2.03 * 2^-48
    if (q * spread * (reach + 2 * delta) < 0x1p-24 && q * (reach + 4.01 * spread * delta) < 0x1.f8p-27)
      return spread;
  }
  return 0;
}

/// Chooses the treatment of ties in the first stage of a chord of floats: searches for a fraction p / q so
/// close that only its ties come near ties. Frames of a clip have such a fraction: with l frames per keyframe
/// q is a divisor of l, up to the rounding of t.
void choose_tie_rule(TimeFraction& f, std::size_t count) {
  constexpr double largest_q = 1024;
  f.ties = TieRule::undecided;
  f.spread = 0x1p7F;
  f.bias = 0x1p-49 * 0x1p7;
  if (count < kChoiceWorthwhile) return;
  // Convergents of the continued fraction p / q of the ratio.
  double p = 1, q = 0, p_before = 0, q_before = 1;
  for (double rest = f.ratio.hi;;) {
    const double whole = std::floor(rest);
    const double p_next = whole * p + p_before, q_next = whole * q + q_before;
    if (!(q_next <= largest_q)) return;
    p_before = p, q_before = q, p = p_next, q = q_next;
    if (std::fabs(f.ratio.hi * q - p) < 0x1p-30 * q)
      break;  // no other fraction with so small a q is this close
    rest = 1 / (rest - whole);
  }
  // delta = (elapsed * q - p * duration) / (q * duration)
  ExpansionSum<8> side;
  side.add_product(f.elapsed, {q, 0}, 1);
  side.add_product(f.duration, {p, 0}, -1);
  if (!side.in_range()) return;
  const DoubleDouble minuend = two_product(f.elapsed.hi, q), subtrahend = two_product(f.duration.hi, p);
  const double difference =
      (minuend.hi - subtrahend.hi) + ((minuend.lo - subtrahend.lo) + (f.elapsed.lo * q - f.duration.lo * p));
  const double delta = side.sign() == 0 ? 0 : std::fabs(difference) / (q * f.duration.hi) * 1.01 + 0x1p-90;
  const double spread = largest_spread(q, delta);
  if (spread == 0) return;
  f.ties = side.sign() == 0 ? TieRule::even : TieRule::toward;
  f.spread = static_cast<float>(spread);
  f.bias = 0x1p-48 * spread * side.sign();
  f.grid = static_cast<std::int64_t>(32 * spread);
}

TimeFraction chord_fraction(double t0, double t1, double t) {
  TimeFraction f;
  f.elapsed = two_diff(t, t0);
  f.duration = two_diff(t1, t0);
  // The unit of time does not matter; a power of two brings all times near 1 exactly (else complete() fails).
  const int scale = -std::ilogb(f.duration.hi);
  for (double* x : {&f.elapsed.hi, &f.elapsed.lo, &f.duration.hi, &f.duration.lo}) *x = std::ldexp(*x, scale);
  complete(f, PieceKind::chord);
  return f;
}

/// Computes the fraction for `count` values at once.
template <class S>
TimeFraction chord_fraction(double t0, double t1, double t, std::size_t count) {
  TimeFraction f = chord_fraction(t0, t1, t);
  if (std::is_same_v<S, float> && f.in_range) choose_tie_rule(f, count);
  return f;
}

TimeFraction ray_fraction(double t0, double t) {
  TimeFraction f;
  f.elapsed = two_diff(t, t0);
  f.duration = {1, 0};
  complete(f, PieceKind::ray);
  return f;
}

/// The exact times of a call, for the last stage.
struct Times {
  double t0, t1, t;
};

/// Performs the last stage: rounds the exact quotient.
template <PieceKind kind, class S>
S round_exactly(S x0, S x1, const Times& times) {
  const Dyadic start(static_cast<double>(x0)), end(static_cast<double>(x1));
  const Dyadic elapsed = Dyadic(times.t) - Dyadic(times.t0);
  if constexpr (kind == PieceKind::ray) return round_quotient<S>(start + end * elapsed, Dyadic(1.0));
  const Dyadic duration = Dyadic(times.t1) - Dyadic(times.t0);
  return round_quotient<S>(start * duration + (end - start) * elapsed, duration);
}

/// Rounds one value that the vectorised stages left. Double-double evaluation gives two neighbours, an exact
/// expansion the side of their midpoint; big integers decide the remaining cases.
template <PieceKind kind, class S>
S round_one(S x0, S x1, const TimeFraction& f, const Times& times, RoundingStats& stats) {
  if (x1 == (kind == PieceKind::chord ? x0 : S(0))) return x0 + S(0);
  if (f.in_range) {
    const double start = static_cast<double>(x0), end = static_cast<double>(x1);
    const DoubleDouble dx = kind == PieceKind::chord ? two_diff(end, start) : DoubleDouble{end, 0};
    const DoubleDouble way = two_product(dx.hi, f.ratio.hi, f.ratio_halves);
    const DoubleDouble sum = two_sum(start, way.hi);
    const double tail = (sum.lo + way.lo) + (dx.hi * f.ratio.lo + dx.lo * f.ratio.hi);
    const DoubleDouble value = two_sum(sum.hi, tail);
    const double error = (std::fabs(start) + std::fabs(way.hi)) * kRelativeError + kUnderflowError;
    S lower, upper;
    if constexpr (std::is_same_v<S, float>) {
      // Rounding hi to float is correct unless hi is a midpoint; then, and near cancellation, lo and error
      // matter. An interval of one ulp of hi around hi contains hi + lo + error.
      const double reach = std::fabs(value.hi) * 0x1p-52 + std::fabs(value.lo) + error;
      lower = static_cast<float>(value.hi - reach);
      upper = static_cast<float>(value.hi + reach);
    } else {
      lower = value.hi + (value.lo - error);
      upper = value.hi + (value.lo + error);
    }
    if (lower == upper) return lower + S(0);
    if (std::nextafter(lower, upper) == upper && std::fabs(upper) < std::numeric_limits<S>::max() &&
        std::fabs(lower) < std::numeric_limits<S>::max()) {
      // The sign of (x0 - midpoint) * duration + dx * elapsed; midpoint = lower + half_gap.
      const double low = static_cast<double>(lower);
      const double half_gap = 0.5 * (static_cast<double>(upper) - low);
      if (half_gap >= 0x1p-900) {
        ExpansionSum<20> side;
        side.add_product(two_diff(start, low), f.duration, 1);
        side.add_product({half_gap, 0}, f.duration, -1);
        side.add_product(dx, f.elapsed, 1);
        if (side.in_range()) {
          const int sign = side.sign();
          if (sign != 0) return (sign < 0 ? lower : upper) + S(0);
          using Bits = std::conditional_t<std::is_same_v<S, float>, std::uint32_t, std::uint64_t>;
          return ((bit_cast<Bits>(lower) & 1) == 0 ? lower : upper) + S(0);
        }
      }
    }
  }
  ++stats.exact;
  return round_exactly<kind>(x0, x1, times);
}

/// Fills with zeros from `count` to the end of its group.
template <class S>
void fill_group(S* values, std::size_t count) {
  std::fill(values + count, values + (count + kRoundGroup - 1) / kRoundGroup * kRoundGroup, S(0));
}

/// Rounds the blocks of one call. Undecided values of the first stage are gathered over blocks, so that the
/// second stage works on whole groups.
template <PieceKind kind, class S>
class BlockRounder {
 public:
  BlockRounder(const TimeFraction& fraction, const Times& times, RoundingStats& stats)
      : fraction_(fraction), times_(times), stats_(stats) {}

  /// Rounds `count` values into `result`, which overlaps neither input; all three have room for whole groups.
  /// Values left undecided are written to place(i) later, by `finish` at the latest.
  template <class Place>
  void round(const S* x0, const S* second, std::size_t count, S* result, const Place& place) {
    while (pending_ >= kRoundGroup) decide();  // of earlier calls: the caller may copy `result` first
    std::uint16_t list[kRoundList];
    const std::size_t size = (count + kRoundGroup - 1) / kRoundGroup * kRoundGroup;
    const auto first_stage = kind == PieceKind::chord ? kernels_.first_chord : kernels_.first_ray;
    const std::size_t left = first_stage(x0, second, fraction_, result, list, size);
    for (std::size_t k = 0; k < left; ++k) {
      const std::size_t i = list[k];
      if (i >= count) continue;
      x0_[pending_] = x0[i];
      second_[pending_] = second[i];
      places_[pending_++] = place(i);
    }
  }

  void finish() {
    while (pending_ > 0) decide();
  }

 private:
  /// Decides the last pending group.
  void decide() {
    const std::size_t first = (pending_ - 1) / kRoundGroup * kRoundGroup;
    stats_.second_stage += pending_ - first;
    const bool second_helps = std::is_same_v<S, float> ? fraction_.single : fraction_.ratio_exact;
    alignas(64) S chosen[kRoundGroup];
    std::uint8_t hard[kRoundGroup];
    if (second_helps) {
      std::fill(x0_ + pending_, x0_ + first + kRoundGroup, S(0));
      std::fill(second_ + pending_, second_ + first + kRoundGroup, S(0));
      const auto second_stage = kind == PieceKind::chord ? kernels_.second_chord : kernels_.second_ray;
      second_stage(x0_ + first, second_ + first, fraction_, chosen, hard);
    }
    for (std::size_t i = first; i < pending_; ++i) {
      *places_[i] = second_helps && hard[i - first] == 0
                        ? chosen[i - first]
                        : round_one<kind>(x0_[i], second_[i], fraction_, times_, stats_);
    }
    pending_ = first;
  }

  const RoundKernels<S>& kernels_ = round_kernels<S>();
  const TimeFraction& fraction_;
  const Times& times_;
  RoundingStats& stats_;
  std::size_t pending_ = 0;
  alignas(64) S x0_[kRoundList + kRoundGroup];
  alignas(64) S second_[kRoundList + kRoundGroup];
  S* places_[kRoundList + kRoundGroup];
};

template <PieceKind kind, class S>
void round_all(const S* x0, const S* x1, std::size_t count, const TimeFraction& f, const Times& times, S* out,
               RoundingStats& stats) {
  stats.values += count;
  if (!f.in_range) {
    stats.second_stage += count;
    for (std::size_t i = 0; i < count; ++i) out[i] = round_one<kind>(x0[i], x1[i], f, times, stats);
    return;
  }
  BlockRounder<kind, S> rounder(f, times, stats);
  const bool in_place = out == x0 || out == x1;
  alignas(64) S result[kRoundBlock];
  std::size_t begin = 0;
  const auto place = [&](std::size_t i) { return out + begin + i; };
  for (; begin + kRoundBlock <= count; begin += kRoundBlock) {
    rounder.round(x0 + begin, x1 + begin, kRoundBlock, in_place ? result : out + begin, place);
    if (in_place) std::memcpy(out + begin, result, sizeof result);
  }
  if (begin < count) {
    alignas(64) S start[kRoundBlock], end[kRoundBlock];
    std::copy(x0 + begin, x0 + count, start);
    std::copy(x1 + begin, x1 + count, end);
    fill_group(start, count - begin);
    fill_group(end, count - begin);
    rounder.round(start, end, count - begin, result, place);
    std::copy(result, result + (count - begin), out + begin);
  }
  rounder.finish();
}

template <class S>
void copy_stored(const S* x, std::size_t count, S* out, RoundingStats& stats) {
  stats.values += count;
  for (std::size_t i = 0; i < count; ++i) out[i] = x[i] + S(0);
}

void check_chord_times(double t0, double t1, double t) {
  if (!(t0 < t1)) refuse_times("a segment needs t0 < t1", t0, t1, t);
  if (!(t0 <= t && t <= t1)) refuse_times("t must lie between t0 and t1", t0, t1, t);
  if (!(t0 >= -0x1p900 && t1 <= 0x1p900)) refuse_times("times are limited to 2^900", t0, t1, t);
}

void check_ray_times(double t0, double t) {
  const double open = std::numeric_limits<double>::infinity();
  if (!(t0 <= t)) refuse_times("t must not precede t0", t0, open, t);
  if (!(t0 >= -0x1p900 && t <= 0x1p900)) refuse_times("times are limited to 2^900", t0, open, t);
}

}  // namespace

template <class S>
void round_chord(const S* x0, const S* x1, std::size_t count, double t0, double t1, double t, S* out,
                 RoundingStats* stats) {
  check_chord_times(t0, t1, t);
  RoundingStats unused;
  RoundingStats& sums = stats != nullptr ? *stats : unused;
  if (t == t0) return copy_stored(x0, count, out, sums);
  if (t == t1) return copy_stored(x1, count, out, sums);
  const TimeFraction f = chord_fraction<S>(t0, t1, t, count);
  round_all<PieceKind::chord>(x0, x1, count, f, {t0, t1, t}, out, sums);
}

template <class S>
void round_ray(const S* x0, const S* v, std::size_t count, double t0, double t, S* out,
               RoundingStats* stats) {
  check_ray_times(t0, t);
  RoundingStats unused;
  RoundingStats& sums = stats != nullptr ? *stats : unused;
  if (t == t0) return copy_stored(x0, count, out, sums);
  round_all<PieceKind::ray>(x0, v, count, ray_fraction(t0, t), {t0, t0, t}, out, sums);
}

template <class S>
void round_chord_vertices(const S* p0, const S* p1, const std::uint32_t* vertices, std::size_t count,
                          double t0, double t1, double t, S* out, RoundingStats* stats) {
  check_chord_times(t0, t1, t);
  RoundingStats unused;
  RoundingStats& sums = stats != nullptr ? *stats : unused;
  if (t == t0 || t == t1) {
    const S* stored = t == t0 ? p0 : p1;
    sums.values += 3 * count;
    for (std::size_t i = 0; i < count; ++i) {
      const std::size_t first = std::size_t{3} * vertices[i];
      for (std::size_t axis = 0; axis < 3; ++axis) out[first + axis] = stored[first + axis] + S(0);
    }
    return;
  }
  sums.values += 3 * count;
  const Times times{t0, t1, t};
  const TimeFraction f = chord_fraction<S>(t0, t1, t, 3 * count);
  if (!f.in_range) {
    sums.second_stage += 3 * count;
    for (std::size_t i = 0; i < 3 * count; ++i) {
      const std::size_t at = std::size_t{3} * vertices[i / 3] + i % 3;
      out[at] = round_one<PieceKind::chord>(p0[at], p1[at], f, times, sums);
    }
    return;
  }
  BlockRounder<PieceKind::chord, S> rounder(f, times, sums);
  constexpr std::size_t per_block = kRoundBlock / 3;
  alignas(64) S start[kRoundBlock], end[kRoundBlock], result[kRoundBlock];
  for (std::size_t begin = 0; begin < count; begin += per_block) {
    const std::size_t many = std::min(per_block, count - begin);
    const std::uint32_t* block = vertices + begin;
    for (std::size_t i = 0; i < many; ++i) {
      const std::size_t first = std::size_t{3} * block[i];
      for (std::size_t axis = 0; axis < 3; ++axis) {
        start[3 * i + axis] = p0[first + axis];
        end[3 * i + axis] = p1[first + axis];
      }
    }
    fill_group(start, 3 * many);
    fill_group(end, 3 * many);
    rounder.round(start, end, 3 * many, result,
                  [&](std::size_t i) { return out + std::size_t{3} * block[i / 3] + i % 3; });
    for (std::size_t i = 0; i < many; ++i) {
      const std::size_t first = std::size_t{3} * block[i];
      for (std::size_t axis = 0; axis < 3; ++axis) out[first + axis] = result[3 * i + axis];
    }
  }
  rounder.finish();
}

template <class S>
S round_piece(const Piece<S>& piece, double t, RoundingStats* stats) {
  RoundingStats unused;
  RoundingStats& sums = stats != nullptr ? *stats : unused;
  ++sums.values;
  if (piece.kind == PieceKind::ray) {
    check_ray_times(piece.t0, t);
    if (t == piece.t0) return piece.x0 + S(0);
    return round_one<PieceKind::ray>(piece.x0, piece.x1, ray_fraction(piece.t0, t), {piece.t0, piece.t0, t},
                                     sums);
  }
  check_chord_times(piece.t0, piece.t1, t);
  if (t == piece.t0) return piece.x0 + S(0);
  if (t == piece.t1) return piece.x1 + S(0);
  return round_one<PieceKind::chord>(piece.x0, piece.x1, chord_fraction(piece.t0, piece.t1, t),
                                     {piece.t0, piece.t1, t}, sums);
}

#define KBVH_INSTANTIATE(S)                                                                                 \
  template void round_chord(const S*, const S*, std::size_t, double, double, double, S*, RoundingStats*);   \
  template void round_ray(const S*, const S*, std::size_t, double, double, S*, RoundingStats*);             \
  template void round_chord_vertices(const S*, const S*, const std::uint32_t*, std::size_t, double, double, \
                                     double, S*, RoundingStats*);                                           \
  template S round_piece(const Piece<S>&, double, RoundingStats*);
KBVH_INSTANTIATE(float)
KBVH_INSTANTIATE(double)
#undef KBVH_INSTANTIATE

}  // namespace kbvh
