#include "core/motion/round_positions.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <limits>
#include <stdexcept>
#include <string>
#include <type_traits>

#include "core/motion/exact_arithmetic.hpp"
#include "core/motion/round_kernels.hpp"

namespace kbvh {
namespace {

template <class S>
using Mask = std::conditional_t<std::is_same_v<S, float>, std::int32_t, std::int64_t>;

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
  // Short: 24 bits, so products with floats are exact in double; in a chord 1 - ratio is then exact or not
  // short.
  f.rest = kind == PieceKind::chord ? 1 - f.ratio.hi : 1.0;
  const bool rest_exact = kind == PieceKind::ray || 1 - f.rest == f.ratio.hi;
  const auto is_short = [](double x) { return x == static_cast<double>(static_cast<float>(x)); };
  f.short_ratio = f.ratio_exact && rest_exact && is_short(f.ratio.hi) && is_short(f.rest);
  f.elapsed_halves = split_halves(wh);
  f.duration_halves = split_halves(dh);
  f.ratio_halves = split_halves(f.ratio.hi);
}

TimeFraction chord_fraction(double t0, double t1, double t) {
  TimeFraction f;
  f.elapsed = two_diff(t, t0);
  f.duration = two_diff(t1, t0);
  // The unit of time does not matter; a power of two takes everything near 1 exactly (or complete() says no).
  const int scale = -std::ilogb(f.duration.hi);
  for (double* x : {&f.elapsed.hi, &f.elapsed.lo, &f.duration.hi, &f.duration.lo}) *x = std::ldexp(*x, scale);
  complete(f, PieceKind::chord);
  return f;
}

TimeFraction ray_fraction(double t0, double t) {
  TimeFraction f;
  f.elapsed = two_diff(t, t0);
  f.duration = {1, 0};
  complete(f, PieceKind::ray);
  return f;
}

/// Exact times of a call, for the last stage.
struct Times {
  double t0, t1, t;
};

/// The last stage: round the exact quotient.
template <PieceKind kind, class S>
S round_exactly(S x0, S x1, const Times& times) {
  const Dyadic start(static_cast<double>(x0)), end(static_cast<double>(x1));
  const Dyadic elapsed = Dyadic(times.t) - Dyadic(times.t0);
  if constexpr (kind == PieceKind::ray) return round_quotient<S>(start + end * elapsed, Dyadic(1.0));
  const Dyadic duration = Dyadic(times.t1) - Dyadic(times.t0);
  return round_quotient<S>(start * duration + (end - start) * elapsed, duration);
}

/// What the vectorised stages left: one value at a time. Double-double evaluation gives two neighbours, an
/// exact expansion the side of their midpoint; failing that, big integers.
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
    const double error = (std::fabs(start) + std::fabs(way.hi)) * kDoubleFilter + kUnderflowFilter;
    S lower, upper;
    if constexpr (std::is_same_v<S, float>) {
      // Rounding hi to float is right unless hi is a midpoint; then, and near cancellation, lo and error
      // matter. A whole ulp of hi around hi contains hi + lo + error.
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
      // sign of (x0 - midpoint) * duration + dx * elapsed; midpoint = lower + half_gap
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
          return ((std::bit_cast<Bits>(lower) & 1) == 0 ? lower : upper) + S(0);
        }
      }
    }
  }
  ++stats.exact;
  return round_exactly<kind>(x0, x1, times);
}

/// Rounds one block of `size` values, a multiple of kGroup; x0, x1 and out may be the same array.
template <PieceKind kind, class S>
[[gnu::always_inline]] inline void round_block(const S* x0, const S* x1, std::size_t size,
                                               const TimeFraction& f, const Times& times, S* out,
                                               RoundingStats& stats) {
  alignas(64) S result[kBlock];
  std::uint16_t list[kBlock + kGroup];
  const std::size_t count = first_stage<kind>(x0, x1, f, result, list, size);
  stats.second_stage += count;
  const bool second_helps = std::is_same_v<S, float> ? f.single : f.ratio_exact;
  for (std::size_t k = 0; k < kGroup; ++k) list[count + k] = 0;
  for (std::size_t i = 0; i < count; i += kGroup) {
    alignas(64) S group0[kGroup], group1[kGroup], chosen[kGroup];
    alignas(64) Mask<S> hard[kGroup];
    if (second_helps) {
      for (std::size_t k = 0; k < kGroup; ++k) {
        group0[k] = x0[list[i + k]];
        group1[k] = x1[list[i + k]];
      }
      second_stage<kind>(group0, group1, f, chosen, hard);
    }
    for (std::size_t k = 0; k < kGroup && i + k < count; ++k) {
      const std::size_t j = list[i + k];
      result[j] = second_helps && hard[k] == 0 ? chosen[k] : round_one<kind>(x0[j], x1[j], f, times, stats);
    }
  }
  std::memcpy(out, result, size * sizeof(S));
}

template <PieceKind kind, class S>
void round_all(const S* x0, const S* x1, std::size_t count, const TimeFraction& f, const Times& times, S* out,
               RoundingStats& stats) {
  stats.values += count;
  if (!f.in_range) {
    stats.second_stage += count;
    for (std::size_t i = 0; i < count; ++i) out[i] = round_one<kind>(x0[i], x1[i], f, times, stats);
    return;
  }
  std::size_t begin = 0;
  for (; begin + kBlock <= count; begin += kBlock) {
    round_block<kind>(x0 + begin, x1 + begin, kBlock, f, times, out + begin, stats);
  }
  if (begin == count) return;
  const std::size_t rest = count - begin, size = (rest + kGroup - 1) / kGroup * kGroup;
  S start[kBlock], end[kBlock];
  std::copy(x0 + begin, x0 + count, start);
  std::copy(x1 + begin, x1 + count, end);
  std::fill(start + rest, start + size, S(0));
  std::fill(end + rest, end + size, S(0));
  round_block<kind>(start, end, size, f, times, start, stats);
  std::copy(start, start + (count - begin), out + begin);
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
  round_all<PieceKind::chord>(x0, x1, count, chord_fraction(t0, t1, t), {t0, t1, t}, out, sums);
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
  const TimeFraction f = chord_fraction(t0, t1, t);
  constexpr std::size_t per_block = kBlock / 3;
  S start[kBlock], end[kBlock];
  for (std::size_t begin = 0; begin < count; begin += per_block) {
    const std::size_t many = std::min(per_block, count - begin);
    for (std::size_t i = 0; i < many; ++i) {
      const std::size_t first = std::size_t{3} * vertices[begin + i];
      for (std::size_t axis = 0; axis < 3; ++axis) {
        start[3 * i + axis] = p0[first + axis];
        end[3 * i + axis] = p1[first + axis];
      }
    }
    S result[kBlock];
    round_all<PieceKind::chord>(start, end, 3 * many, f, {t0, t1, t}, result, sums);
    for (std::size_t i = 0; i < many; ++i) {
      const std::size_t first = std::size_t{3} * vertices[begin + i];
      for (std::size_t axis = 0; axis < 3; ++axis) out[first + axis] = result[3 * i + axis];
    }
  }
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
