#pragma once
#include <cstdint>
#include <limits>

namespace kbvh {

/// One linear piece of one coordinate of a flight plan: an exact function of the stored numbers (truth A).
///  chord: x(t) = x0 + (x1 - x0) * (t - t0) / (t1 - t0)   on t0 <= t <= t1, t0 < t1 (between two keyframes)
///  ray:   x(t) = x0 + x1 * (t - t0)                      on t0 <= t (x1 is a velocity; t1 is ignored)
/// A coordinate at rest is a ray with x1 = 0. Times are doubles in seconds, values are scalar S.
enum class PieceKind : std::uint8_t { chord, ray };

template <class S>
struct Piece {
  double t0 = 0, t1 = std::numeric_limits<double>::infinity();
  S x0 = 0, x1 = 0;
  PieceKind kind = PieceKind::ray;

  bool operator==(const Piece&) const = default;
};

}  // namespace kbvh
