#pragma once
// Internal: block kernels of core/motion/round_positions.cpp, one table for each instruction set. Their
// results are the correctly rounded values wherever they claim one, so the sets agree to the last bit; only
// which values are left to later stages may differ.
#include <cstddef>
#include <cstdint>

#include "core/kernels/kernel_tables.hpp"
#include "core/motion/error_free.hpp"
#include "core/motion/piece.hpp"

namespace kbvh {

/// How the first stage for float chords treats ties, chosen once per call from the fraction of the segment.
enum class TieRule : std::uint8_t {
  undecided,  ///< lists what comes near a tie
  toward,     ///< the fraction is p / q + delta: near p / q's ties, delta tells the side
  even,       ///< the fraction is p / q: its ties are ties
};

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

  // Chords of floats; core/motion/kernels/round.cpp derives the numbers.
  TieRule ties = TieRule::undecided;
  /// undecided: half width of the filter. toward: nudge off the tie, with the sign of delta. Both relative.
  double bias = 0;
  std::int64_t grid = 0;  ///< even: a value is taken for a multiple of so many of its ulps, a power of two
  float spread = 0;       ///< most that the larger end may exceed the smaller one and the result
};

/// Most values per block.
constexpr std::size_t kRoundBlock = 256;
/// Block sizes are multiples of this.
constexpr std::size_t kRoundGroup = 16;
/// Room for the places that a first stage lists, padded to whole groups.
constexpr std::size_t kRoundList = kRoundBlock + kRoundGroup;

/// One instruction set's kernels for one scalar. `second` is x1 (chord) or the velocity (ray).
template <class S>
struct RoundKernels {
  /// Rounds `size` values (a multiple of kRoundGroup, at most kRoundBlock) into out, which overlaps neither
  /// input, but for the places that it appends to `list`; returns their number. Needs fraction.in_range.
  using FirstStage = std::size_t (*)(const S* x0, const S* second, const TimeFraction& fraction, S* out,
                                     std::uint16_t* list, std::size_t size);
  /// Decides kRoundGroup values that the first stage left; hard[i] != 0: not this one. Needs in_range, and
  /// fraction.single (float) or fraction.ratio_exact (double).
  using SecondStage = void (*)(const S* x0, const S* second, const TimeFraction& fraction, S* out,
                               std::uint8_t* hard);
  FirstStage first_chord, first_ray;
  SecondStage second_chord, second_ray;
};

KBVH_DECLARE_KERNELS(RoundKernels<float>, round_float)
KBVH_DECLARE_KERNELS(RoundKernels<double>, round_double)

}  // namespace kbvh
