#pragma once
#include <cstddef>
#include <cstdint>

#include "core/motion/piece.hpp"

namespace kbvh {

/// How many values were rounded, and how many of them the filter left to the second stage (error-free
/// transforms) and to big integers. Calls add to it; the caller sums over threads.
struct RoundingStats {
  std::uint64_t values = 0;        ///< all values
  std::uint64_t second_stage = 0;  ///< those the first filter left undecided
  std::uint64_t exact = 0;         ///< those of them that needed exact integers
};

// Truth B, the position P(t): the flight plan (truth A, an exact function of the stored numbers) rounded
// correctly to S, to nearest even, subnormals included, and never -0. Results depend on the numbers alone,
// not on compiler, instruction set or order, and are monotone in the exact value: rounding commutes with min
// and max.
//
// Admissible: |x| <= 1e30 (float), 1e100 (double), velocities alike, |times| <= 2^900; the caller checks
// coordinates once (they are not checked per call). Round-to-nearest without flush-to-zero must be in force.
// A result beyond the range of S is infinite, as IEEE rounding says. Cost: O(count), with the kernel set in
// use (core/kernels/kernel_set.hpp). With AVX2 at 3 GHz about 0.45 ns per float of a chord: 2 to 3 times
// plain interpolation from L2 or L3, also at the frames of clips, where up to a tenth of all values are ties
// or next to one: their side follows from the fraction (core/motion/kernels/round.cpp). About 25 ns for each
// value left to later stages: some in 10^4 or 10^3, those much smaller than their segment's larger end. 1.5
// to 2 ns per double, more where ties abound. Exact integers (about 1 us) are left for results near zero
// between values of opposite sign and for odd magnitudes and times. No allocation but in that last stage.

/// out[i] = RN(x0[i] + (x1[i] - x0[i]) * (t - t0) / (t1 - t0)): coordinates between two keyframes at t0 < t1.
/// At t == t0 and t == t1 the stored values come back. `out` may be x0 or x1, but must not overlap them
/// otherwise. Throws std::invalid_argument unless t0 < t1 and t0 <= t <= t1 (NaN included).
template <class S>
void round_chord(const S* x0, const S* x1, std::size_t count, double t0, double t1, double t, S* out,
                 RoundingStats* stats = nullptr);

/// out[i] = RN(x0[i] + v[i] * (t - t0)): coordinates that fly on from t0 with velocities v. Throws
/// std::invalid_argument unless t0 <= t, both finite. Otherwise as round_chord.
template <class S>
void round_ray(const S* x0, const S* v, std::size_t count, double t0, double t, S* out,
               RoundingStats* stats = nullptr);

/// round_chord for the three coordinates of a few vertices: out[3 v + axis] for each v in vertices[0 ..
/// count), from p0 and p1 in the same layout; the rest of out is left alone. A vertex may be listed twice.
template <class S>
void round_chord_vertices(const S* p0, const S* p1, const std::uint32_t* vertices, std::size_t count,
                          double t0, double t1, double t, S* out, RoundingStats* stats = nullptr);

/// One piece at one time: the value that round_chord or round_ray gives.
template <class S>
S round_piece(const Piece<S>& piece, double t, RoundingStats* stats = nullptr);

}  // namespace kbvh
