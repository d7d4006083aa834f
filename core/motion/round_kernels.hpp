#pragma once
// Internal: the block kernels of round_positions.cpp. Everything is in an anonymous namespace and calls only
// what is forced inline, so that several translation units may compile this file under different instruction
// sets without sharing code. Written in the vector extensions of GCC and clang: GCC 12 vectorises the
// equivalent loops only in part.
#include <cstddef>
#include <cstdint>
#include <limits>
#if defined(__SSE2__)
#include <emmintrin.h>
#endif

#include "core/motion/error_free.hpp"
#include "core/motion/piece.hpp"

#if defined(__GNUC__) && !defined(__clang__)
#define KBVH_UNROLL _Pragma("GCC unroll 8")
#else
#define KBVH_UNROLL
#endif

namespace kbvh {
namespace {

#if defined(__AVX512F__) && defined(__AVX512DQ__)
constexpr std::size_t kLanes = 8;
#elif defined(__AVX__)
constexpr std::size_t kLanes = 4;
#else
constexpr std::size_t kLanes = 2;
#endif

using Doubles [[gnu::vector_size(kLanes * 8)]] = double;
using Floats [[gnu::vector_size(kLanes * 4)]] = float;
using Longs [[gnu::vector_size(kLanes * 8)]] = std::int64_t;
using Ints [[gnu::vector_size(kLanes * 4)]] = std::int32_t;
using Unsigned [[gnu::vector_size(kLanes * 4)]] = std::uint32_t;

/// Most values per block; blocks are padded to whole groups.
constexpr std::size_t kBlock = 256;
/// Values whose masks are looked at together.
constexpr std::size_t kGroup = 8;

/// What one call shares: value = x0 + dx * elapsed / duration, where dx = x1 - x0 (chord) or x1 (ray,
/// duration 1).
struct TimeFraction {
  DoubleDouble elapsed, duration;  ///< exact, scaled so that 1 <= duration < 2
  DoubleDouble ratio;              ///< elapsed / duration, relative error below 2^-100
  DoubleDouble elapsed_halves, duration_halves, ratio_halves;  ///< of the hi parts
  double rest = 0;           ///< 1 - ratio (chord) or 1 (ray) if short_ratio
  bool short_ratio = false;  ///< ratio_exact, and ratio and rest have at most 24 bits: 1/2, 3/4, ...
  bool single = false;       ///< elapsed.lo == duration.lo == 0
  bool ratio_exact = false;  ///< ratio.hi is the ratio, exactly
  bool in_range = false;     ///< false: times so odd that only the last stage is safe
};

/// Relative half width of the float filter: rounding of dx, ratio, product and sum, 2^-53 each, on |x0| + |dx
/// ratio|; half as much again pays for the rounding of the filter itself.
constexpr double kFloatFilter = 0x1.8p-51;
/// The same for double-double evaluation: each of about 12 errors is below 2^-104 of |x0| + |dx ratio|.
constexpr double kDoubleFilter = 0x1p-97;
/// Covers underflow of error terms. Results this small are left to the last stage.
constexpr double kUnderflowFilter = 0x1p-1040;

template <class V, class S>
[[gnu::always_inline]] inline V load(const S* from) {
  V v;
  __builtin_memcpy(&v, from, sizeof v);
  return v;
}

template <class V, class S>
[[gnu::always_inline]] inline void store(S* to, V v) {
  __builtin_memcpy(to, &v, sizeof v);
}

[[gnu::always_inline]] inline Doubles absolute(Doubles x) {
  return reinterpret_cast<Doubles>(reinterpret_cast<Longs>(x) & std::numeric_limits<std::int64_t>::max());
}

[[gnu::always_inline]] inline Doubles load_widened(const float* from) {
#if defined(__SSE2__) && !defined(__AVX__)
  // GCC 12 would convert one lane at a time.
  double both;
  __builtin_memcpy(&both, from, sizeof both);  // `from` is aligned for a float only
  return _mm_cvtps_pd(_mm_castpd_ps(_mm_set_sd(both)));
#else
  return __builtin_convertvector(load<Floats>(from), Doubles);
#endif
}

[[gnu::always_inline]] inline Doubles widened(Floats x) {
  return __builtin_convertvector(x, Doubles);
}

[[gnu::always_inline]] inline Floats narrowed(Doubles x) {
  return __builtin_convertvector(x, Floats);
}

template <class V>
[[gnu::always_inline]] inline bool any(V mask) {
  std::uint64_t words[sizeof(V) / 8];
  __builtin_memcpy(words, &mask, sizeof mask);
  std::uint64_t all = 0;
  for (const std::uint64_t word : words) all |= word;
  return all != 0;
}

/// The float filter's candidates: the value lies between them or on one of them.
struct Candidates {
  Floats lower, upper;
};

template <PieceKind kind>
[[gnu::always_inline]] inline Candidates candidates(Doubles start, Doubles end, double ratio) {
  const Doubles way = (kind == PieceKind::chord ? end - start : end) * ratio;
  const Doubles value = start + way;
  const Doubles error = (absolute(start) + absolute(way)) * kFloatFilter;
  return {narrowed(value - error), narrowed(value + error)};
}

/// The same with short factors, so that a float times either is a double: if the sum is one too, both
/// candidates are the correctly rounded value, ties included (half of all values at t = 1/2).
[[gnu::always_inline]] inline Candidates candidates(Doubles start, Doubles end, double ratio, double rest) {
  const TwoPart<Doubles> value = two_sum(start * rest, end * ratio);
  const Doubles error = value.lo != 0.0 ? absolute(value.hi) * 0x1p-51 : Doubles{};
  return {narrowed(value.hi - error), narrowed(value.hi + error)};
}

/// Appends base + k to list for each lane k of a group whose mask is set; returns the new length. Writes
/// without branching, so list needs room for one more than it holds.
template <class I>
[[gnu::always_inline]] inline std::size_t append_set(const I* mask, std::size_t base, std::uint16_t* list,
                                                     std::size_t length) {
  for (std::size_t k = 0; k < kGroup; ++k) {
    list[length] = static_cast<std::uint16_t>(base + k);
    length += static_cast<std::size_t>(mask[k] & 1);
  }
  return length;
}

/// Which candidates stage 1 computes.
enum class RatioLength { any, short_ratio };

/// Stage 1 for float over `size` values, a multiple of kGroup: out is right but at the places listed; returns
/// their number.
template <PieceKind kind, RatioLength length_of_ratio>
[[gnu::always_inline]] inline std::size_t first_stage(const float* x0, const float* x1,
                                                      const TimeFraction& fraction, float* __restrict out,
                                                      std::uint16_t* __restrict list, std::size_t size) {
  const double ratio = fraction.ratio.hi, rest = fraction.rest;
  std::size_t length = 0;
  for (std::size_t i = 0; i < size; i += kGroup) {
    Ints open[kGroup / kLanes];
    Ints some{};
    KBVH_UNROLL
    for (std::size_t k = 0; k < kGroup / kLanes; ++k) {
      const std::size_t at = i + k * kLanes;
      const Doubles start = load_widened(x0 + at), end = load_widened(x1 + at);
      const Candidates c = length_of_ratio == RatioLength::any ? candidates<kind>(start, end, ratio)
                                                               : candidates(start, end, ratio, rest);
      store(out + at, c.upper + 0.0F);  // -0 becomes +0
      open[k] = c.lower != c.upper;
      some |= open[k];
    }
    if (any(some)) {
      std::int32_t masks[kGroup];
      __builtin_memcpy(masks, open, sizeof masks);
      length = append_set(masks, i, list, length);
    }
  }
  return length;
}

/// Maps floats to integers in the same order, neighbours to neighbours, both zeros to 0.
[[gnu::always_inline]] inline Unsigned ordinal(Ints bits) {
  const Unsigned size = reinterpret_cast<Unsigned>(bits) & 0x7fffffffU;  // unsigned: differences may wrap
  return bits < 0 ? -size : size;
}

/// Stage 2 for float: decides kGroup undecided values by the exact sign of value - midpoint, that is, of
/// dx * elapsed - (midpoint - x0) * duration, from error-free products. hard[i] is not 0 where that does not
/// apply: the candidates are not neighbours, or a difference is no double. Needs fraction.single.
template <PieceKind kind>
[[gnu::always_inline]] inline void second_stage(const float* x0, const float* x1,
                                                const TimeFraction& fraction, float* __restrict out,
                                                std::int32_t* __restrict hard) {
  for (std::size_t at = 0; at < kGroup; at += kLanes) {
    const Doubles start = load_widened(x0 + at), end = load_widened(x1 + at);
    const auto [lower, upper] = candidates<kind>(start, end, fraction.ratio.hi);
    const Doubles midpoint = 0.5 * (widened(lower) + widened(upper));
    const TwoPart<Doubles> dx =
        kind == PieceKind::chord ? two_diff(end, start) : TwoPart<Doubles>{end, Doubles{}};
    const TwoPart<Doubles> dm = two_diff(midpoint, start);
    const TwoPart<Doubles> p = two_product(dx.hi, fraction.elapsed.hi, fraction.elapsed_halves);
    const TwoPart<Doubles> q = two_product(dm.hi, fraction.duration.hi, fraction.duration_halves);
    // The hi parts are the products rounded, so by monotony they order the products unless they are equal.
    const Doubles high = p.hi - q.hi;
    const Doubles side = high != 0.0 ? high : p.lo - q.lo;
    const Ints below = __builtin_convertvector(side < 0.0, Ints);
    const Ints tie = __builtin_convertvector(side == 0.0, Ints);
    const Ints lower_bits = reinterpret_cast<Ints>(lower), upper_bits = reinterpret_cast<Ints>(upper);
    const Ints take_lower = below | (tie & ((lower_bits & 1) == 0));
    store(out + at, (take_lower ? lower : upper) + 0.0F);
    const Ints inexact =
        __builtin_convertvector((dx.lo != 0.0) | (dm.lo != 0.0) | (absolute(midpoint) >= 0x1p127), Ints);
    store(hard + at, inexact | (ordinal(upper_bits) - ordinal(lower_bits) != 1U));
  }
}

template <PieceKind kind>
[[gnu::always_inline]] inline std::size_t first_stage(const float* x0, const float* x1,
                                                      const TimeFraction& fraction, float* __restrict out,
                                                      std::uint16_t* __restrict list, std::size_t size) {
  return fraction.short_ratio ? first_stage<kind, RatioLength::short_ratio>(x0, x1, fraction, out, list, size)
                              : first_stage<kind, RatioLength::any>(x0, x1, fraction, out, list, size);
}

/// Stage 1 for double, in double-double, likewise: out is right but at the places listed; returns their
/// number.
template <PieceKind kind>
[[gnu::always_inline]] inline std::size_t first_stage(const double* x0, const double* x1,
                                                      const TimeFraction& fraction, double* __restrict out,
                                                      std::uint16_t* __restrict list, std::size_t size) {
  const DoubleDouble ratio = fraction.ratio, halves = fraction.ratio_halves;
  std::size_t length = 0;
  for (std::size_t i = 0; i < size; i += kGroup) {
    Longs open[kGroup / kLanes];
    Longs some{};
    KBVH_UNROLL
    for (std::size_t k = 0; k < kGroup / kLanes; ++k) {
      const std::size_t at = i + k * kLanes;
      const Doubles start = load<Doubles>(x0 + at), end = load<Doubles>(x1 + at);
      const TwoPart<Doubles> dx =
          kind == PieceKind::chord ? two_diff(end, start) : TwoPart<Doubles>{end, Doubles{}};
      const TwoPart<Doubles> way = two_product(dx.hi, ratio.hi, halves);
      const TwoPart<Doubles> sum = two_sum(start, way.hi);
      const Doubles tail = (sum.lo + way.lo) + (dx.hi * ratio.lo + dx.lo * ratio.hi);
      const TwoPart<Doubles> value = two_sum(sum.hi, tail);
      const Doubles error = (absolute(start) + absolute(way.hi)) * kDoubleFilter + kUnderflowFilter;
      const Doubles lower = value.hi + (value.lo - error), upper = value.hi + (value.lo + error);
      store(out + at, value.hi + 0.0);
      open[k] = (lower != upper) & (dx.hi != 0.0);  // what rests is exact
      some |= open[k];
    }
    if (any(some)) {
      std::int64_t masks[kGroup];
      __builtin_memcpy(masks, open, sizeof masks);
      length = append_set(masks, i, list, length);
    }
  }
  return length;
}

/// Stage 2 for double when the ratio is exact (1/2, 1/4, ...), where ties abound: the whole evaluation is
/// exact if no transform leaves a remainder, and then the last addition rounds correctly. hard[i] is not 0
/// elsewhere.
template <PieceKind kind>
[[gnu::always_inline]] inline void second_stage(const double* x0, const double* x1,
                                                const TimeFraction& fraction, double* __restrict out,
                                                std::int64_t* __restrict hard) {
  const double ratio = fraction.ratio.hi;
  const DoubleDouble halves = fraction.ratio_halves;
  for (std::size_t at = 0; at < kGroup; at += kLanes) {
    const Doubles start = load<Doubles>(x0 + at), end = load<Doubles>(x1 + at);
    const TwoPart<Doubles> dx =
        kind == PieceKind::chord ? two_diff(end, start) : TwoPart<Doubles>{end, Doubles{}};
    const TwoPart<Doubles> way = two_product(dx.hi, ratio, halves), minor = two_product(dx.lo, ratio, halves);
    const TwoPart<Doubles> sum = two_sum(start, way.hi);
    const TwoPart<Doubles> rest = two_sum(sum.lo, way.lo);
    const TwoPart<Doubles> tail = two_sum(rest.hi, minor.hi);
    store(out + at, (sum.hi + tail.hi) + 0.0);
    // Products below 2^-900 may have lost their remainders.
    const Longs small = (absolute(way.hi) < 0x1p-900) | ((dx.lo != 0.0) & (absolute(minor.hi) < 0x1p-900));
    store(hard + at, small | (minor.lo != 0.0) | (rest.lo != 0.0) | (tail.lo != 0.0));
  }
}

}  // namespace
}  // namespace kbvh

#undef KBVH_UNROLL
