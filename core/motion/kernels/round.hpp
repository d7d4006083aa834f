#pragma once
// Internal: block kernels of core/motion/round_positions.cpp, one table per instruction set. A value that a
// kernel decides is correctly rounded, so the sets agree to the last bit. The sets may differ only in the
// values that they leave to later stages.
#include <cstddef>
#include <cstdint>

#include "core/kernels/kernel_tables.hpp"
#include "core/motion/error_free.hpp"
#include "core/motion/piece.hpp"

namespace kbvh {

/// The treatment of ties in the first stage for float chords, chosen once per call from the fraction of the
/// segment.
enum class TieRule : std::uint8_t {
  undecided,  ///< lists values near a tie
  toward,     ///< the fraction is p / q + delta: near the ties of p / q, delta decides the side
  even,       ///< the fraction is p / q: its ties are ties of the values
};

/// The shared data of one call: value = x0 + dx * elapsed / duration, where dx = x1 - x0 (chord) or x1 (ray,
/// duration 1).
struct TimeFraction {
  DoubleDouble elapsed, duration;  ///< exact, scaled so that 1 <= duration < 2
  DoubleDouble ratio;              ///< elapsed / duration, relative error below 2^-100
  DoubleDouble elapsed_halves, duration_halves, ratio_halves;  ///< of the hi parts
  double rest = 0;           ///< 1 - ratio (chord) or 1 (ray) if short_ratio
  bool short_ratio = false;  ///< ratio_exact, and ratio and rest have at most 24 bits: 1/2, 3/4, ...
  bool single = false;       ///< elapsed.lo == duration.lo == 0
  bool ratio_exact = false;  ///< ratio.hi is the exact ratio
  bool in_range = false;     ///< false: the times are so extreme that only the last stage is safe

  // For chords of floats; core/motion/kernels/round.cpp derives the numbers.
  TieRule ties = TieRule::undecided;
  /// undecided: half width of the filter. toward: nudge off the tie, with the sign of delta. Both relative.
  double bias = 0;
  std::int64_t grid = 0;  ///< even: a value is rounded to a multiple of this many of its ulps, a power of two
  float spread = 0;       ///< upper limit of the larger end over the smaller end and over the result
};

/// The largest number of values per block.
constexpr std::size_t kRoundBlock = 256;
/// Block sizes are multiples of this.
constexpr std::size_t kRoundGroup = 16;
/// Room for the indices that a first stage lists, padded to whole groups.
constexpr std::size_t kRoundList = kRoundBlock + kRoundGroup;

/// The kernels of one instruction set for one scalar. `second` is x1 (chord) or the velocity (ray).
template <class S>
struct RoundKernels {
  /// Rounds `size` values (a multiple of kRoundGroup, at most kRoundBlock) into out, which overlaps neither
  /// input. The values whose indices it appends to `list` are left undecided; returns their number. Needs
  /// fraction.in_range.
  using FirstStage = std::size_t (*)(const S* x0, const S* second, const TimeFraction& fraction, S* out,
                                     std::uint16_t* list, std::size_t size);
  /// Decides kRoundGroup values that the first stage left; hard[i] != 0 marks values that it could not
  /// decide. Needs in_range, and fraction.single (float) or fraction.ratio_exact (double).
  using SecondStage = void (*)(const S* x0, const S* second, const TimeFraction& fraction, S* out,
                               std::uint8_t* hard);
  FirstStage first_chord, first_ray;
  SecondStage second_chord, second_ray;
};

KBVH_DECLARE_KERNELS(RoundKernels<float>, round_float)
KBVH_DECLARE_KERNELS(RoundKernels<double>, round_double)

}  // namespace kbvh
