#pragma once
// Internal to kernels: blocks of leaves (SlabBlock), and the test of triangles against a slab.
#include "core/families/slabs/kernels/slabs.hpp"
#include "core/kernels/quads.hpp"

namespace kbvh {
namespace {

template <class S, std::size_t padded>
constexpr std::size_t block_lanes = [] {
  constexpr std::size_t fit = native_lanes<S> < padded ? native_lanes<S> : padded;
  return fit * sizeof(S) < 16 ? std::size_t(1) : fit;  // there are no shorter registers
}();

/// The slab of a leaf, with bounds moved outwards.
template <class S>
struct Slab {
  S direction[3], low, high;
};

/// Returns the smallest or largest products of the direction and the three corners, for a register of
/// triangles.
template <class S, std::size_t padded, class V>
[[gnu::always_inline]] inline void project(const S* block, std::size_t lane, const S (&direction)[3], V& low,
                                           V& high) {
  const S* const corners = block + SlabBlock::corner_row * padded + lane;
  for (std::size_t c = 0; c < 3; ++c) {
    const V d = load_lanes<V>(corners + (3 * c) * padded) * direction[0] +
                load_lanes<V>(corners + (3 * c + 1) * padded) * direction[1] +
                load_lanes<V>(corners + (3 * c + 2) * padded) * direction[2];
    low = c == 0 ? d : smaller(d, low);
    high = c == 0 ? d : larger(d, high);
  }
}

/// Sums a row; the order of the additions does not depend on the instruction set.
template <class S, std::size_t padded>
[[gnu::always_inline]] inline S sum_of_row(S (&row)[padded]) {
  for (std::size_t half = padded / 2; half > 0; half /= 2)
    for (std::size_t i = 0; i < half; ++i) row[i] += row[i + half];
  return row[0];
}

/// Writes the direction of the slab: the sum of the normals, or zero, which separates nothing, where that is
/// too small or too large to be scaled.
template <class S, std::size_t padded>
[[gnu::always_inline]] inline void find_direction(S* block) {
  using V = Vector<S, block_lanes<S, padded>>;
  constexpr std::size_t lanes = block_lanes<S, padded>;
  alignas(64) S normal[3][padded];
  const S* const corners = block + SlabBlock::corner_row * padded;
  for (std::size_t lane = 0; lane < padded; lane += lanes) {
    V e[3], f[3];
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const V p = load_lanes<V>(corners + axis * padded + lane);
      e[axis] = load_lanes<V>(corners + (3 + axis) * padded + lane) - p;
      f[axis] = load_lanes<V>(corners + (6 + axis) * padded + lane) - p;
    }
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const std::size_t j = (axis + 1) % 3, k = (axis + 2) % 3;
      store_lanes(normal[axis] + lane, e[j] * f[k] - e[k] * f[j]);
    }
  }
  S n[3], size = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    n[axis] = sum_of_row<S, padded>(normal[axis]);
    size += n[axis] < 0 ? -n[axis] : n[axis];
  }
  constexpr S least = sizeof(S) == 4 ? S(0x1p-100) : S(0x1p-900), most = 1 / least;
  const S scale = size > least && size < most ? 1 / size : 0;
  S* const tail = block + SlabBlock::rows * padded;
  for (std::size_t axis = 0; axis < 3; ++axis) tail[axis] = scale == 0 ? 0 : n[axis] * scale;
}

/// Computes the rows of corners.
template <class S, std::size_t padded>
[[gnu::always_inline]] inline void load_corners(const WideLeafLists& lists, std::uint32_t leaf,
                                              const S* positions, S* block) {
  using P = Points<S, 1>;
  using Pack = typename P::Pack;
  const std::uint32_t begin = lists.first_entry[leaf], end = lists.end_entry[leaf];
  S* const corners = block + SlabBlock::corner_row * padded;
  for (std::uint32_t quad = 0; quad < padded; quad += 4) {
    Pack pack[3][4];
    for (std::uint32_t j = 0; j < 4; ++j) {
      const std::uint32_t entry = begin + quad + j < end ? begin + quad + j : end - 1;
      const std::uint32_t* const corner = lists.corners + lists.first_corner[entry];
      for (std::size_t c = 0; c < 3; ++c) pack[c][j] = P::load(positions + corner[c], positions);
    }
    for (std::size_t c = 0; c < 3; ++c)
      P::template store_rows<false>(pack[c], corners + 3 * c * padded + quad, padded, 4);
  }
}

/// Computes the rows of boxes from those of corners.
template <class S, std::size_t padded>
[[gnu::always_inline]] inline void box_corners(const WideLeafLists& lists, std::uint32_t leaf, S* block) {
  using V = Vector<S, block_lanes<S, padded>>;
  constexpr std::size_t lanes = block_lanes<S, padded>;
  const S* const corners = block + SlabBlock::corner_row * padded;
  for (std::size_t axis = 0; axis < 3; ++axis)
    for (std::size_t lane = 0; lane < padded; lane += lanes) {
      const V p = load_lanes<V>(corners + axis * padded + lane);
      const V q = load_lanes<V>(corners + (3 + axis) * padded + lane);
      const V r = load_lanes<V>(corners + (6 + axis) * padded + lane);
      store_lanes(block + axis * padded + lane, smaller(smaller(p, q), r));
      store_lanes(block + (3 + axis) * padded + lane, -larger(larger(p, q), r));
    }
  for (std::size_t row = 0; row < 6; ++row)
    for (std::size_t i = lists.end_entry[leaf] - lists.first_entry[leaf]; i < padded; ++i)
      block[row * padded + i] = S(__builtin_inf());
}

/// Computes the extent of the leaf along a direction.
template <class S, std::size_t padded>
[[gnu::always_inline]] inline void find_extent(const S* block, const S (&direction)[3], S& low, S& high) {
  using V = Vector<S, block_lanes<S, padded>>;
  constexpr std::size_t lanes = block_lanes<S, padded>;
  alignas(64) S lows[padded], highs[padded];
  for (std::size_t lane = 0; lane < padded; lane += lanes) {
    V l, h;
    project<S, padded, V>(block, lane, direction, l, h);
    store_lanes(lows + lane, l);
    store_lanes(highs + lane, h);
  }
  for (std::size_t half = padded / 2; half > 0; half /= 2)
    for (std::size_t i = 0; i < half; ++i) {
      lows[i] = smaller(lows[i], lows[i + half]);
      highs[i] = larger(highs[i], highs[i + half]);
    }
  low = lows[0];
  high = highs[0];
}

/// Returns a mask. Bit i: triangle i may reach into the slab.
template <class S, std::size_t padded>
[[gnu::always_inline]] inline unsigned meeting_slab(const S* block, const Slab<S>& slab) {
  using V = Vector<S, block_lanes<S, padded>>;
  constexpr std::size_t lanes = block_lanes<S, padded>;
  unsigned bits = 0;
  for (std::size_t lane = 0; lane < padded; lane += lanes) {
    V low, high;
    project<S, padded, V>(block, lane, slab.direction, low, high);
    const auto meets = (high >= slab.low) & (low <= slab.high);
    if constexpr (lanes == 1)
      bits |= unsigned(meets) << lane;
    else
      bits |= mask_bits(meets) << lane;
  }
  return bits;
}

}  // namespace
}  // namespace kbvh
