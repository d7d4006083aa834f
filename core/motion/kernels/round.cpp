// Correct rounding of flight plans, block by block (defined in round_positions.hpp). Written in the vector
// extensions of GCC and clang: GCC 12 vectorises the equivalent loops only in part. "portable" has two double
// lanes and no intrinsics; compilers split the lanes on machines without vectors.
#include "core/motion/kernels/round.hpp"

#include "core/kernels/lanes.hpp"

#if defined(__GNUC__) && !defined(__clang__)
#define KBVH_UNROLL _Pragma("GCC unroll 16")
#else
#define KBVH_UNROLL
#endif

namespace kbvh {
namespace {

constexpr std::size_t kLanes = kRegisterBytes == 0 ? 2 : kRegisterBytes / 8;

using Doubles = Vector<double, kLanes>;
using Longs = Vector<std::int64_t, kLanes>;
using Floats = Vector<float, kLanes>;  ///< half a register, as wide in values as Doubles
using Ints = Vector<std::int32_t, kLanes>;
using Unsigned = Vector<std::uint32_t, kLanes>;
using AllFloats = Vector<float, 2 * kLanes>;
using AllInts = Vector<std::int32_t, 2 * kLanes>;

// The following holds for every set: a product and a sum round once with FMA, twice without. The bounds
// assume two roundings.

[[gnu::always_inline]] inline Doubles product_plus(Doubles a, Doubles b, Doubles c) {
#if defined(KBVH_KERNELS_avx512)
  return (Doubles)_mm512_fmadd_pd((__m512d)a, (__m512d)b, (__m512d)c);
#elif defined(KBVH_KERNELS_avx2)
  return (Doubles)_mm256_fmadd_pd((__m256d)a, (__m256d)b, (__m256d)c);
#else
  return a * b + c;
#endif
}

/// Like kbvh::two_product.
[[gnu::always_inline]] inline TwoPart<Doubles> product(Doubles a, double b, DoubleDouble halves) {
#if defined(KBVH_KERNELS_avx2) || defined(KBVH_KERNELS_avx512)
  static_cast<void>(halves);
  const Doubles all = Doubles{} + b;
  const Doubles hi = a * all;
  return {hi, product_plus(a, all, -hi)};
#else
  return two_product(a, b, halves);
#endif
}

[[gnu::always_inline]] inline Doubles absolute(Doubles x) {
  return (Doubles)((Longs)x & INT64_MAX);
}
[[gnu::always_inline]] inline AllFloats absolute(AllFloats x) {
  return (AllFloats)((AllInts)x & INT32_MAX);
}

[[gnu::always_inline]] inline Doubles load_widened(const float* from) {
  // GCC 12 would convert one or two lanes at a time.
#if defined(KBVH_KERNELS_avx512)
  return (Doubles)_mm512_maskz_cvtps_pd(0xff, _mm256_loadu_ps(from));
#elif defined(KBVH_KERNELS_avx2)
  return (Doubles)_mm256_cvtps_pd(_mm_loadu_ps(from));
#elif defined(KBVH_KERNELS_sse)
  double both;
  __builtin_memcpy(&both, from, sizeof both);  // `from` is aligned for a float only
  return (Doubles)_mm_cvtps_pd(_mm_castpd_ps(_mm_set_sd(both)));
#else
  return __builtin_convertvector(load_lanes<Floats>(from), Doubles);
#endif
}

[[gnu::always_inline]] inline Doubles widened(Floats x) {
  return __builtin_convertvector(x, Doubles);
}
[[gnu::always_inline]] inline Floats narrowed(Doubles x) {
  return __builtin_convertvector(x, Floats);
}
/// Rounds two halves to one register of floats.
[[gnu::always_inline]] inline AllFloats narrowed(Doubles low, Doubles high) {
#if defined(KBVH_KERNELS_avx512)
  // GCC 12 warns of its own undefined values in the intrinsics.
  return __builtin_shufflevector(narrowed(low), narrowed(high), 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13,
                                 14, 15);
#elif defined(KBVH_KERNELS_avx2)
  return (AllFloats)_mm256_insertf128_ps(_mm256_castps128_ps256(_mm256_cvtpd_ps((__m256d)low)),
                                         _mm256_cvtpd_ps((__m256d)high), 1);
#elif defined(KBVH_KERNELS_sse)
  return (AllFloats)_mm_movelh_ps(_mm_cvtpd_ps((__m128d)low), _mm_cvtpd_ps((__m128d)high));
#else
  AllFloats both{};
  for (std::size_t k = 0; k < kLanes; ++k) {
    both[k] = static_cast<float>(low[k]);
    both[kLanes + k] = static_cast<float>(high[k]);
  }
  return both;
#endif
}

template <class V>
[[gnu::always_inline]] inline unsigned bits_of(V mask) {
#if defined(KBVH_KERNELS_portable)
  unsigned bits = 0;
  for (std::size_t k = 0; k < sizeof(V) / sizeof mask[0]; ++k) bits |= unsigned(mask[k] & 1) << k;
  return bits;
#else
  return mask_bits(mask);
#endif
}

/// Appends base + k to list for each bit k; returns the new length.
[[gnu::always_inline]] inline std::size_t append_set(unsigned bits, std::size_t base, std::uint16_t* list,
                                                     std::size_t length) {
  for (; bits != 0; bits &= bits - 1)
    list[length++] = static_cast<std::uint16_t>(base + std::size_t(__builtin_ctz(bits)));
  return length;
}

// ---- Chords of floats ----
//
// Let v* = x0 + dx f be the exact value, M = max(|x0|, |x1|), so |dx| <= 2 M, |v*| <= M, |dx f| <= 2 M. In
// double, V = x0 + dx r with r = f (1 + e), |e| <= 2^-53 (1 + 2^-46): difference, ratio and product each
// contribute at most 2 M 2^-53, the sum M 2^-53, and therefore
//   (1)  |V - v*| <= 7.01 * 2^-53 M.
// Nothing underflows: the least float is 2^-149, ratios are at least 2^-250. Where both ends are zeros, V =
// +0: dx is -0 only if x0 = +0, and then (+0) + (-0) = +0; otherwise dx is +0.
//
// z is the result. A lane counts only if, C being fraction.spread,
//   (2)  C |z| >= M,
// which is exact in float (scaling up by a power of two). What was rounded to z is at least |z| / 2
// (subnormals; else |z| (1 - 2^-24)), so (1) is below 7.02 * 2^-52 C |V|. z = 0 counts only if M = 0, where V
// = +0: no -0 passes.
//
// undecided: with c = 2^-49 C, V (1 - c) and V (1 + c) enclose v*. If they round to one float, v* does too.
//
// Now let f = p / q + delta, w = x0 + dx p / q, and also, for the ends that are not 0,
//   (3)  C |x0| >= M and C |x1| >= M.
// x0 and x1 are multiples of u = 2^k > 2^-24 M / C, so w is a multiple of u / q. The midpoints between
// floats that are next to w, where 2^e <= |w| < 2^(e + 1), are multiples of h = 2^(e - 25) > 2^-26 |w| (also
// for subnormals: of 2^-150). So a midpoint that is not w is at least g = min(u, h) / q away from w.
//
// toward: V' = V (1 + s b), b = 2^-48 C, with the sign s that moves it to the side of dx delta. b |V| exceeds
// (1) and the rounding of V' (2^-52 |V|), so V' lies beyond v* on that side, and
//   (4)  |V' - w| < 2.02 b |V| + |dx delta| <= 2.02 b |V| + 2 M |delta|.
// If that is below g, then no midpoint but w itself lies in the closed interval from w to V', and v* and V'
// are inside it (w excluded, as delta != 0; if dx = 0, V' rounds to x0). So V' and v* round to the same
// float. It suffices that
//   q C (2.03 * 2^-48 C + 2 |delta|) < 2^-24      (u, as |V| <= 1.001 M)
//   q C (2.03 * 2^-48 + 4.01 |delta|) < 2^-26.02  (h, as M <= 2.001 C |V|, |w| > 0.999 |V|),
// which choose_tie_rule in round_positions.cpp checks when it chooses C.
//
// even: delta = 0, v* = w. V is rounded to V'', the nearest multiple of G = 2^5 C ulps of V (fraction.grid;
// the bits of a double count its ulps, across powers of two, too). With E = 2^floor(log2 |V|), G = 2^-47 C E,
// and half of that exceeds (1), as |V| < 2 E. If w is a midpoint, it is a multiple of h >= 2^-26 E and so of
// G: it is the nearest; rounding it to float is the rounding of a tie to even. If it is no midpoint, V'' is
// off w by less than (1) + G / 2 < G <= 2 b |V| < g: it stays on its side.
//
// Zero ends are multiples of any u: (3) need not hold for them, (2) must. If x0 = x1, V = x0 and all hold.

/// `factor` with the sign flipped where sign < 0.
[[gnu::always_inline]] inline Doubles signed_by(Longs sign, double factor) {
  const Doubles plus = Doubles{} + factor;
#if defined(KBVH_KERNELS_avx2)
  return (Doubles)_mm256_blendv_pd((__m256d)plus, (__m256d)-plus, (__m256d)sign);
#elif defined(KBVH_KERNELS_sse)
  return (Doubles)_mm_blendv_pd((__m128d)plus, (__m128d)-plus, (__m128d)sign);
#else
  return (Doubles)((sign & INT64_MIN) ^ (Longs)plus);
#endif
}

template <TieRule ties>
[[gnu::always_inline]] inline Doubles moved(Doubles value, Doubles dx, const TimeFraction& fraction) {
  if constexpr (ties == TieRule::toward) {
    return product_plus(value, signed_by((Longs)value ^ (Longs)dx, fraction.bias), value);
  } else {
    const std::int64_t grid = fraction.grid;
    return (Doubles)(((Longs)value + grid / 2) & -grid);
  }
}

template <TieRule ties>
[[gnu::always_inline]] inline std::size_t chord_stage(const float* x0, const float* x1,
                                                      const TimeFraction& fraction, float* __restrict out,
                                                      std::uint16_t* __restrict list, std::size_t size) {
  const Doubles ratio = Doubles{} + fraction.ratio.hi;
  const float spread = fraction.spread;
  const double error = fraction.bias;
  std::size_t length = 0;
  for (std::size_t i = 0; i < size; i += 2 * kLanes) {
    const Doubles start0 = load_widened(x0 + i), start1 = load_widened(x0 + i + kLanes);
    const Doubles dx0 = load_widened(x1 + i) - start0, dx1 = load_widened(x1 + i + kLanes) - start1;
    const Doubles value0 = product_plus(dx0, ratio, start0), value1 = product_plus(dx1, ratio, start1);
    const AllFloats size0 = absolute(load_lanes<AllFloats>(x0 + i));
    const AllFloats size1 = absolute(load_lanes<AllFloats>(x1 + i));
    const AllFloats most = larger(size0, size1);
    if constexpr (ties == TieRule::undecided) {
      const Doubles less = Doubles{} - error, more = Doubles{} + error;
      const AllFloats lower =
          narrowed(product_plus(value0, less, value0), product_plus(value1, less, value1));
      const AllFloats upper =
          narrowed(product_plus(value0, more, value0), product_plus(value1, more, value1));
      store_lanes(out + i, upper);
      const unsigned open = bits_of((AllInts)((lower != upper) | (absolute(upper) * spread < most)));
      if (__builtin_expect(open != 0, 0)) length = append_set(open, i, list, length);
    } else {
      const AllFloats result =
          narrowed(moved<ties>(value0, dx0, fraction), moved<ties>(value1, dx1, fraction));
      store_lanes(out + i, result);
      const AllFloats reached = absolute(result), least = smaller(size0, size1);
      const AllInts open = (AllInts)(smaller(reached, least) * spread < most);
      if (__builtin_expect(bits_of(open) != 0, 0)) {
        const AllInts zero = (AllInts)(least == 0.0F);
        const AllInts still = open & (~zero | (AllInts)(reached * spread < most));
        length = append_set(bits_of(still), i, list, length);
      }
    }
  }
  return length;
}

[[gnu::always_inline]] inline std::size_t first_chord(const float* x0, const float* x1,
                                                      const TimeFraction& fraction, float* out,
                                                      std::uint16_t* list, std::size_t size) {
  switch (fraction.ties) {
    case TieRule::toward:
      return chord_stage<TieRule::toward>(x0, x1, fraction, out, list, size);
    case TieRule::even:
      return chord_stage<TieRule::even>(x0, x1, fraction, out, list, size);
    default:
      return chord_stage<TieRule::undecided>(x0, x1, fraction, out, list, size);
  }
}

// ---- Rays of floats, and what chords leave ----

/// Relative half width of the float filter: rounding of dx, ratio, product and sum, 2^-53 each, on |x0| + |dx
/// ratio|; a margin of another half covers the rounding of the filter itself.
constexpr double kFloatFilter = 0x1.8p-51;

/// The float filter's candidates: the exact value lies between them or equals one of them.
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

/// The same with short factors, for which a float times either factor is a double: if the sum is a double
/// too, both candidates are the correctly rounded value, ties included.
[[gnu::always_inline]] inline Candidates candidates(Doubles start, Doubles end, double ratio, double rest) {
  const TwoPart<Doubles> value = two_sum(start * rest, end * ratio);
  const Doubles error = value.lo != 0.0 ? absolute(value.hi) * 0x1p-51 : Doubles{};
  return {narrowed(value.hi - error), narrowed(value.hi + error)};
}

/// The candidates that the first stage of rays computes.
enum class RatioLength : std::uint8_t { any, short_ratio };

template <RatioLength length_of_ratio>
[[gnu::always_inline]] inline std::size_t ray_stage(const float* x0, const float* speed,
                                                    const TimeFraction& fraction, float* __restrict out,
                                                    std::uint16_t* __restrict list, std::size_t size) {
  std::size_t length = 0;
  for (std::size_t i = 0; i < size; i += kLanes) {
    const Doubles start = load_widened(x0 + i), end = load_widened(speed + i);
    const Candidates c = length_of_ratio == RatioLength::any
                             ? candidates<PieceKind::ray>(start, end, fraction.ratio.hi)
                             : candidates(start, end, fraction.ratio.hi, fraction.rest);
    store_lanes(out + i, c.upper + 0.0F);  // -0 becomes +0
    const Longs open = __builtin_convertvector(c.lower != c.upper, Longs);
    if (const unsigned bits = bits_of(open); __builtin_expect(bits != 0, 0))
      length = append_set(bits, i, list, length);
  }
  return length;
}

[[gnu::always_inline]] inline std::size_t first_ray(const float* x0, const float* speed,
                                                    const TimeFraction& fraction, float* out,
                                                    std::uint16_t* list, std::size_t size) {
  return fraction.short_ratio ? ray_stage<RatioLength::short_ratio>(x0, speed, fraction, out, list, size)
                              : ray_stage<RatioLength::any>(x0, speed, fraction, out, list, size);
}

/// Maps floats to integers in the same order, neighbours to neighbours, both zeros to 0.
[[gnu::always_inline]] inline Unsigned ordinal(Ints bits) {
  const Unsigned size = (Unsigned)bits & 0x7fffffffU;  // unsigned: differences may wrap
  return bits < 0 ? -size : size;
}

/// Second stage for float: decides undecided values by the exact sign of value - midpoint, which is the sign
/// of dx * elapsed - (midpoint - x0) * duration, from error-free products. Sets hard[i] to a nonzero value
/// where that does not apply: the candidates are not neighbours, or a difference is no double.
template <PieceKind kind>
[[gnu::always_inline]] inline void second_stage(const float* x0, const float* second,
                                                const TimeFraction& fraction, float* __restrict out,
                                                std::uint8_t* __restrict hard) {
  for (std::size_t at = 0; at < kRoundGroup; at += kLanes) {
    const Doubles start = load_widened(x0 + at), end = load_widened(second + at);
    const auto [lower, upper] = candidates<kind>(start, end, fraction.ratio.hi);
    const Doubles midpoint = 0.5 * (widened(lower) + widened(upper));
    const TwoPart<Doubles> dx =
        kind == PieceKind::chord ? two_diff(end, start) : TwoPart<Doubles>{end, Doubles{}};
    const TwoPart<Doubles> dm = two_diff(midpoint, start);
    const TwoPart<Doubles> p = product(dx.hi, fraction.elapsed.hi, fraction.elapsed_halves);
    const TwoPart<Doubles> q = product(dm.hi, fraction.duration.hi, fraction.duration_halves);
    // The hi parts are the rounded products, so by monotonicity they order the products unless they are
    // equal.
    const Doubles high = p.hi - q.hi;
    const Doubles side = high != 0.0 ? high : p.lo - q.lo;
    const Ints below = __builtin_convertvector(side < 0.0, Ints);
    const Ints tie = __builtin_convertvector(side == 0.0, Ints);
    const Ints lower_bits = (Ints)lower, upper_bits = (Ints)upper;
    const Ints take_lower = below | (tie & ((lower_bits & 1) == 0));
    store_lanes(out + at, (take_lower ? lower : upper) + 0.0F);
    const Ints inexact =
        __builtin_convertvector((dx.lo != 0.0) | (dm.lo != 0.0) | (absolute(midpoint) >= 0x1p127), Ints);
    const Ints left = inexact | (Ints)(ordinal(upper_bits) - ordinal(lower_bits) != 1U);
    // Equal candidates need no second stage: first stages may list more values than necessary.
    const Ints open = left & (Ints)(lower != upper);
    for (std::size_t k = 0; k < kLanes; ++k) hard[at + k] = static_cast<std::uint8_t>(open[k] & 1);
  }
}

// ---- Doubles ----

/// The filter's relative half width for double-double: each of about 12 errors is below 2^-104 of |x0| + |dx
/// ratio|.
constexpr double kDoubleFilter = 0x1p-97;
/// Covers underflow of error terms. Results this small are left to the last stage.
constexpr double kUnderflowFilter = 0x1p-1040;

/// First stage for double, in double-double.
template <PieceKind kind>
[[gnu::always_inline]] inline std::size_t first_stage(const double* x0, const double* second,
                                                      const TimeFraction& fraction, double* __restrict out,
                                                      std::uint16_t* __restrict list, std::size_t size) {
  const DoubleDouble ratio = fraction.ratio, halves = fraction.ratio_halves;
  std::size_t length = 0;
  for (std::size_t i = 0; i < size; i += 2 * kLanes) {
    unsigned open = 0;
    KBVH_UNROLL
    for (std::size_t k = 0; k < 2; ++k) {
      const std::size_t at = i + k * kLanes;
      const Doubles start = load_lanes<Doubles>(x0 + at), end = load_lanes<Doubles>(second + at);
      const TwoPart<Doubles> dx =
          kind == PieceKind::chord ? two_diff(end, start) : TwoPart<Doubles>{end, Doubles{}};
      const TwoPart<Doubles> way = product(dx.hi, ratio.hi, halves);
      const TwoPart<Doubles> sum = two_sum(start, way.hi);
      const Doubles tail = (sum.lo + way.lo) + (dx.hi * ratio.lo + dx.lo * ratio.hi);
      const TwoPart<Doubles> value = two_sum(sum.hi, tail);
      const Doubles error = (absolute(start) + absolute(way.hi)) * kDoubleFilter + kUnderflowFilter;
      const Doubles lower = value.hi + (value.lo - error), upper = value.hi + (value.lo + error);
      store_lanes(out + at, value.hi + 0.0);
      open |= bits_of((Longs)((lower != upper) & (dx.hi != 0.0)))
              << (k * kLanes);  // resting coordinates are exact
    }
    if (open != 0) length = append_set(open, i, list, length);
  }
  return length;
}

/// Second stage for double when the ratio is exact (1/2, 1/4, ...), where ties are frequent: the whole
/// evaluation is exact if no transform leaves a remainder, and then the last addition rounds correctly. Sets
/// hard[i] to a nonzero value elsewhere.
template <PieceKind kind>
[[gnu::always_inline]] inline void second_stage(const double* x0, const double* second,
                                                const TimeFraction& fraction, double* __restrict out,
                                                std::uint8_t* __restrict hard) {
  const double ratio = fraction.ratio.hi;
  const DoubleDouble halves = fraction.ratio_halves;
  for (std::size_t at = 0; at < kRoundGroup; at += kLanes) {
    const Doubles start = load_lanes<Doubles>(x0 + at), end = load_lanes<Doubles>(second + at);
    const TwoPart<Doubles> dx =
        kind == PieceKind::chord ? two_diff(end, start) : TwoPart<Doubles>{end, Doubles{}};
    const TwoPart<Doubles> way = product(dx.hi, ratio, halves), minor = product(dx.lo, ratio, halves);
    const TwoPart<Doubles> sum = two_sum(start, way.hi);
    const TwoPart<Doubles> rest = two_sum(sum.lo, way.lo);
    const TwoPart<Doubles> tail = two_sum(rest.hi, minor.hi);
    store_lanes(out + at, (sum.hi + tail.hi) + 0.0);
    // Products below 2^-900 may have lost their remainders.
    const Longs small =
        (Longs)((absolute(way.hi) < 0x1p-900) | ((dx.lo != 0.0) & (absolute(minor.hi) < 0x1p-900)));
    const Longs open = small | (Longs)((minor.lo != 0.0) | (rest.lo != 0.0) | (tail.lo != 0.0));
    for (std::size_t k = 0; k < kLanes; ++k) hard[at + k] = static_cast<std::uint8_t>(open[k] & 1);
  }
}

}  // namespace

namespace kernels::KBVH_KERNELS {
namespace {

std::size_t float_chord(const float* x0, const float* x1, const TimeFraction& fraction, float* out,
                        std::uint16_t* list, std::size_t size) {
  return first_chord(x0, x1, fraction, out, list, size);
}
std::size_t float_ray(const float* x0, const float* speed, const TimeFraction& fraction, float* out,
                      std::uint16_t* list, std::size_t size) {
  return first_ray(x0, speed, fraction, out, list, size);
}
template <PieceKind kind>
std::size_t double_first(const double* x0, const double* second, const TimeFraction& fraction, double* out,
                         std::uint16_t* list, std::size_t size) {
  return first_stage<kind>(x0, second, fraction, out, list, size);
}
template <PieceKind kind, class S>
void decide(const S* x0, const S* second, const TimeFraction& fraction, S* out, std::uint8_t* hard) {
  second_stage<kind>(x0, second, fraction, out, hard);
}

}  // namespace

const RoundKernels<float> round_float = {float_chord, float_ray, decide<PieceKind::chord, float>,
                                         decide<PieceKind::ray, float>};
const RoundKernels<double> round_double = {double_first<PieceKind::chord>, double_first<PieceKind::ray>,
                                           decide<PieceKind::chord, double>, decide<PieceKind::ray, double>};

}  // namespace kernels::KBVH_KERNELS
}  // namespace kbvh
