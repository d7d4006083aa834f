#pragma once
// Internal: the block kernels of round_positions.cpp. Everything is in an anonymous namespace and calls only
// what is forced inline, so that several translation units may compile this file under different instruction
// sets without sharing code. Plain loops with constant trip counts: every compiler vectorises them, GCC 12 at
// -O2 included.
#include <bit>
#include <cstddef>
#include <cstdint>

#include "core/motion/error_free.hpp"
#include "core/motion/piece.hpp"

namespace kbvh {
namespace {

/// Values per block; blocks are padded.
constexpr std::size_t kBlock = 256;
/// Values per group of the second stage.
constexpr std::size_t kGroup = 8;

/// What one call shares: value = x0 + dx * elapsed / duration, where dx = x1 - x0 (chord) or x1 (ray,
/// duration 1).
struct TimeFraction {
  DoubleDouble elapsed, duration;  ///< exact, scaled so that 1 <= duration < 2
  DoubleDouble ratio;              ///< elapsed / duration, relative error below 2^-100
  DoubleDouble elapsed_halves, duration_halves, ratio_halves;  ///< of the hi parts
  bool single = false;                                         ///< elapsed.lo == duration.lo == 0
  bool ratio_exact = false;                                    ///< ratio.hi is the ratio, exactly
  bool in_range = false;  ///< false: times so odd that only the last stage is safe
};

/// Relative half width of the float filter: rounding of dx, ratio, product and sum, 2^-53 each, on |x0| + |dx
/// ratio|; half as much again pays for the rounding of the filter itself.
constexpr double kFloatFilter = 0x1.8p-51;
/// The same for double-double evaluation: each of about 12 errors is below 2^-104 of |x0| + |dx ratio|.
constexpr double kDoubleFilter = 0x1p-97;
/// Covers underflow of error terms. Results this small are left to the last stage.
constexpr double kUnderflowFilter = 0x1p-1040;

[[gnu::always_inline]] inline double absolute(double x) {
  return __builtin_fabs(x);
}

/// Stage 1 for float: out is right where undecided is 0; elsewhere out is the upper candidate.
template <PieceKind kind>
[[gnu::always_inline]] inline void first_stage(const float* __restrict x0, const float* __restrict x1,
                                               const TimeFraction& fraction, float* __restrict out,
                                               std::int32_t* __restrict undecided) {
  const double ratio = fraction.ratio.hi;
  for (std::size_t i = 0; i < kBlock; ++i) {
    const double start = static_cast<double>(x0[i]);
    const double dx =
        kind == PieceKind::chord ? static_cast<double>(x1[i]) - start : static_cast<double>(x1[i]);
    const double way = dx * ratio;
    const double value = start + way;
    const double error = (absolute(start) + absolute(way)) * kFloatFilter;
    const float lower = static_cast<float>(value - error), upper = static_cast<float>(value + error);
    undecided[i] = lower == upper ? 0 : 1;
    out[i] = upper + 0.0F;  // -0 becomes +0
  }
}

/// Maps floats to integers in the same order, neighbours to neighbours, both zeros to 0.
[[gnu::always_inline]] inline std::int32_t ordinal(float x) {
  const auto bits = std::bit_cast<std::int32_t>(x);
  return bits < 0 ? std::numeric_limits<std::int32_t>::min() - bits : bits;
}

/// Stage 2 for float: decides one group of undecided values by the exact sign of value - midpoint, that is,
/// of dx * elapsed - (midpoint - x0) * duration, from error-free products. hard[i] is 1 where that does not
/// apply: the candidates are not neighbours, a difference is no double, or times are double-double.
template <PieceKind kind>
[[gnu::always_inline]] inline void second_stage(const float* __restrict x0, const float* __restrict x1,
                                                const TimeFraction& fraction, float* __restrict out,
                                                std::int32_t* __restrict hard) {
  const double ratio = fraction.ratio.hi;
  for (std::size_t i = 0; i < kGroup; ++i) {
    const double start = static_cast<double>(x0[i]), end = static_cast<double>(x1[i]);
    const DoubleDouble dx = kind == PieceKind::chord ? two_diff(end, start) : DoubleDouble{end, 0};
    const double way = dx.hi * ratio;
    const double value = start + way;
    const double error = (absolute(start) + absolute(way)) * kFloatFilter;
    const float lower = static_cast<float>(value - error), upper = static_cast<float>(value + error);
    const double midpoint = 0.5 * (static_cast<double>(lower) + static_cast<double>(upper));
    const DoubleDouble dm = two_diff(midpoint, start);
    const DoubleDouble p = two_product(dx.hi, fraction.elapsed.hi, fraction.elapsed_halves);
    const DoubleDouble q = two_product(dm.hi, fraction.duration.hi, fraction.duration_halves);
    // The hi parts are the products rounded, so by monotony they order the products unless they are equal.
    const double high = p.hi - q.hi, low = p.lo - q.lo;
    const double side = high != 0 ? high : low;
    const float even = (std::bit_cast<std::int32_t>(lower) & 1) == 0 ? lower : upper;
    const float nearest = side < 0 ? lower : upper;
    out[i] = (side == 0 ? even : nearest) + 0.0F;
    const bool neighbours = ordinal(upper) - ordinal(lower) == 1 && absolute(midpoint) < 0x1p127;
    hard[i] = (dx.lo == 0 && dm.lo == 0 && neighbours) ? 0 : 1;
  }
}

/// Stage 1 for double: double-double evaluation; out is right where undecided is 0.
template <PieceKind kind>
[[gnu::always_inline]] inline void first_stage(const double* __restrict x0, const double* __restrict x1,
                                               const TimeFraction& fraction, double* __restrict out,
                                               std::int64_t* __restrict undecided) {
  const DoubleDouble ratio = fraction.ratio, halves = fraction.ratio_halves;
  // With an exact ratio the evaluation may be exact as a whole: then even a tie is decided by the last
  // addition.
  const double if_exact = fraction.ratio_exact ? 0.0 : 1.0;
  for (std::size_t i = 0; i < kBlock; ++i) {
    const double start = x0[i];
    const DoubleDouble dx = kind == PieceKind::chord ? two_diff(x1[i], start) : DoubleDouble{x1[i], 0};
    const DoubleDouble way = two_product(dx.hi, ratio.hi, halves);
    const DoubleDouble minor = two_product(dx.lo, ratio.hi, halves);
    const DoubleDouble sum = two_sum(start, way.hi);
    const DoubleDouble rest = two_sum(sum.lo, way.lo);
    const DoubleDouble tail = two_sum(rest.hi, minor.hi);
    const double lost = absolute(minor.lo) + absolute(rest.lo) + absolute(tail.lo);
    const DoubleDouble value = two_sum(sum.hi, tail.hi + dx.hi * ratio.lo);
    const double filter = (absolute(start) + absolute(way.hi)) * kDoubleFilter + kUnderflowFilter;
    const bool small = absolute(way.hi) < 0x1p-900 || (dx.lo != 0 && absolute(minor.hi) < 0x1p-900);
    const double error = (lost + if_exact == 0 && !small) ? 0.0 : filter;
    const double lower = value.hi + (value.lo - error), upper = value.hi + (value.lo + error);
    undecided[i] = (lower == upper || x1[i] == (kind == PieceKind::chord ? start : 0.0)) ? 0 : 1;
    out[i] = value.hi + 0.0;
  }
}

}  // namespace
}  // namespace kbvh
