#pragma once
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>

#include "core/geometry/box.hpp"

namespace kbvh {

/// Lower and upper corner of a box in 4 lanes each; the last lane has no meaning. The lanes are vector types
/// of the compiler, 16 bytes wide: GCC 12 turns loops over four scalars into scalar code at -O3.
template <class S>
struct LaneBox {
  using Lanes [[gnu::vector_size(16)]] = S;
  static constexpr int width = 16 / sizeof(S), parts = 4 / width;
  Lanes lower[parts], upper[parts];

  /// Computes the box of at least one vertex. Reads one scalar past the last vertex (playback positions are
  /// padded).
  static LaneBox of(std::span<const std::uint32_t> vertices, const S* positions) {
    LaneBox box;
    std::memcpy(box.lower, positions + std::size_t(3) * vertices[0], sizeof box.lower);
    std::memcpy(box.upper, box.lower, sizeof box.upper);
    for (const std::uint32_t v : vertices.subspan(1)) {
      Lanes p[parts];
      std::memcpy(p, positions + std::size_t(3) * v, sizeof p);
      box.extend(p, p);
    }
    return box;
  }
  void extend(const LaneBox& other) { extend(other.lower, other.upper); }
  bool overlaps(const LaneBox& other) const {
    return (low(0) <= other.high(0)) & (other.low(0) <= high(0)) & (low(1) <= other.high(1)) &
           (other.low(1) <= high(1)) & (low(2) <= other.high(2)) & (other.low(2) <= high(2));
  }
  Box<S> box() const { return {{low(0), low(1), low(2)}, {high(0), high(1), high(2)}}; }

 private:
  S low(int axis) const { return lower[axis / width][axis % width]; }
  S high(int axis) const { return upper[axis / width][axis % width]; }
  void extend(const Lanes* from_lower, const Lanes* from_upper) {
    for (int i = 0; i < parts; ++i) {
      lower[i] = from_lower[i] < lower[i] ? from_lower[i] : lower[i];
      upper[i] = from_upper[i] > upper[i] ? from_upper[i] : upper[i];
    }
  }
};

/// Computes the box of one primitive at the motion's current time; its vertices must be current. Reads one
/// scalar past the last vertex.
template <class S>
Box<S> primitive_box(std::span<const std::uint32_t> vertices, const S* positions) {
  return LaneBox<S>::of(vertices, positions).box();
}

}  // namespace kbvh
