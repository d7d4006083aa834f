#pragma once
#include <cstddef>
#include <cstdint>

#include "core/motion/piece.hpp"

namespace kbvh {

/// Counts rounded values, and those that the filter left to the second stage (error-free transforms) and to
/// big integers. Calls add to it; the caller sums over threads.
struct RoundingStats {
  std::uint64_t values = 0;        ///< all values
  std::uint64_t second_stage = 0;  ///< values that the first filter left undecided
  std::uint64_t exact = 0;         ///< of these, values that needed exact integers
};

// Truth B, the position P(t): the flight plan (truth A, an exact function of the stored numbers) rounded
// correctly to S, to nearest even, subnormals included, and never -0. Results depend on the numbers alone,
// not on compiler, instruction set or order. They are monotone in the exact value: rounding commutes with min
// and max.
//
// Admissible: |x| <= 1e30 (float), 1e100 (double), the same for velocities, |times| <= 2^900. The caller
// checks coordinates once; calls do not check them. Round-to-nearest without flush-to-zero must be in force.
// A result beyond the range of S is infinite, as in IEEE rounding.
//
// Cost: O(count), with the active kernel set (core/kernels/kernel_set.hpp). With AVX2 at 3 GHz about 0.45 ns
// per float of a chord: 2 to 3 times plain interpolation from L2 or L3. This includes the frames of clips,
// where up to a tenth of all values are ties or near ties: their side follows from the fraction
// (core/motion/kernels/round.cpp). About 25 ns for each value left to later stages: some in 10^4 or 10^3,
// those much smaller than their segment's larger end. 1.5 to 2 ns per double, more where ties are frequent.
// Exact integers (about 1 us) are left for results near zero between values of opposite sign and for extreme
// magnitudes and times. Only that last stage allocates.

/// Computes out[i] = RN(x0[i] + (x1[i] - x0[i]) * (t - t0) / (t1 - t0)): coordinates between two keyframes at
/// t0 < t1. At t == t0 and t == t1 it returns the stored values. `out` may equal x0 or x1 but must not
/// overlap them otherwise. Throws std::invalid_argument unless t0 < t1 and t0 <= t <= t1 (also for NaN).
template <class S>
void round_chord(const S* x0, const S* x1, std::size_t count, double t0, double t1, double t, S* out,
                 RoundingStats* stats = nullptr);

/// Computes out[i] = RN(x0[i] + v[i] * (t - t0)): coordinates on rays from t0 with velocities v. Throws
/// std::invalid_argument unless t0 <= t, both finite. Otherwise like round_chord.
template <class S>
void round_ray(const S* x0, const S* v, std::size_t count, double t0, double t, S* out,
               RoundingStats* stats = nullptr);

/// Performs round_chord for the three coordinates of a few vertices: out[3 v + axis] for each v in vertices[0
/// .. count), from p0 and p1 in the same layout; other entries of out stay unchanged. A vertex may be listed
/// twice.
template <class S>
void round_chord_vertices(const S* p0, const S* p1, const std::uint32_t* vertices, std::size_t count,
                          double t0, double t1, double t, S* out, RoundingStats* stats = nullptr);

/// Evaluates one piece at one time: the same value as from round_chord or round_ray.
template <class S>
S round_piece(const Piece<S>& piece, double t, RoundingStats* stats = nullptr);

}  // namespace kbvh
