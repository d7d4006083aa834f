#pragma once
#include <cstddef>
#include <cstdint>
#include <span>

#include "core/geometry/box.hpp"

namespace kbvh {

/// Lower and upper corner of a box in 4 lanes, so that the compiler keeps each corner in one register; the
/// last lane has no meaning.
template <class S>
struct LaneBox {
  S lower[4], upper[4];

  /// The box of at least one vertex. Reads one scalar past the last vertex (playback positions are padded).
  static LaneBox of(std::span<const std::uint32_t> vertices, const S* positions) {
    LaneBox box;
    const S* first = positions + std::size_t(3) * vertices[0];
    for (int lane = 0; lane < 4; ++lane) box.lower[lane] = box.upper[lane] = first[lane];
    for (const std::uint32_t v : vertices.subspan(1)) {
      const S* p = positions + std::size_t(3) * v;
      box.extend(p, p);
    }
    return box;
  }
  void extend(const LaneBox& other) { extend(other.lower, other.upper); }
  bool overlaps(const LaneBox& other) const {
    return (lower[0] <= other.upper[0]) & (other.lower[0] <= upper[0]) & (lower[1] <= other.upper[1]) &
           (other.lower[1] <= upper[1]) & (lower[2] <= other.upper[2]) & (other.lower[2] <= upper[2]);
  }
  Box<S> box() const { return {{lower[0], lower[1], lower[2]}, {upper[0], upper[1], upper[2]}}; }

 private:
  void extend(const S* low, const S* high) {
    for (int lane = 0; lane < 4; ++lane) {
      lower[lane] = low[lane] < lower[lane] ? low[lane] : lower[lane];
      upper[lane] = high[lane] > upper[lane] ? high[lane] : upper[lane];
    }
  }
};

/// The box of one primitive at the motion's current time; its vertices must be current.
/// Reads one scalar past the last vertex.
template <class S>
Box<S> primitive_box(std::span<const std::uint32_t> vertices, const S* positions) {
  return LaneBox<S>::of(vertices, positions).box();
}

}  // namespace kbvh
