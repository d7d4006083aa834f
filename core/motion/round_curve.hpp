#pragma once
#include <cstddef>
#include <cstdint>

#include "core/motion/curved_piece.hpp"
#include "core/motion/round_positions.hpp"

namespace kbvh {

// Truth B of curved pieces: the exact cubic of curved_piece.hpp, rounded correctly to S as
// round_positions.hpp says. Admissible numbers are the same; a null `twist` means parabolas. A filter in
// double decides most floats, about 3 ns each; double-double arithmetic most of the rest, exact expansions
// ties at fractions of few bits (1/2, 1/4, ...), and big integers what is left.

/// Computes out[i] = RN(x(t)) for the curves through x0[i] and x1[i] with bend[i] and twist[i]. At t == t0
/// and t == t1 it returns the stored values. `out` may equal an input but must not overlap one otherwise.
/// Throws std::invalid_argument unless t0 < t1 and t0 <= t <= t1 (also for NaN).
template <class S>
void round_curve(const S* x0, const S* x1, const S* bend, const S* twist, std::size_t count, double t0,
                 double t1, double t, S* out, RoundingStats* stats = nullptr);

/// Does the same for the three coordinates of a few vertices, like round_chord_vertices.
template <class S>
void round_curve_vertices(const S* x0, const S* x1, const S* bend, const S* twist,
                          const std::uint32_t* vertices, std::size_t count, double t0, double t1, double t,
                          S* out, RoundingStats* stats = nullptr);

/// Evaluates one piece at one time: the same value as from round_curve.
template <class S>
S round_piece(const CurvedPiece<S>& piece, double t, RoundingStats* stats = nullptr);

}  // namespace kbvh
