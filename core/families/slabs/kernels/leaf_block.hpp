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
[[gnu::always_inline]] inline void project(const S* corners, std::size_t lane, const S (&direction)[3],
                                           V& low, V& high) {
  corners += lane;
  for (std::size_t c = 0; c < 3; ++c) {
    const V d = load_lanes<V>(corners + (3 * c) * padded) * direction[0] +
                load_lanes<V>(corners + (3 * c + 1) * padded) * direction[1] +
                load_lanes<V>(corners + (3 * c + 2) * padded) * direction[2];
    low = c == 0 ? d : smaller(d, low);
    high = c == 0 ? d : larger(d, high);
  }
}

/// Combines the numbers of a row, each half with the other; the order does not depend on the instruction set.
/// Registers are written out, because compilers do not vectorise loops of this kind.
template <class S, std::size_t count, class Combine>
[[gnu::always_inline]] inline S reduced(const S* row, const Combine& combine) {
  if constexpr (count == 1) {
    return row[0];
  } else {
    constexpr std::size_t half = count / 2;
    constexpr std::size_t fit = native_lanes<S> < half ? native_lanes<S> : half;
    constexpr std::size_t lanes = fit * sizeof(S) < 16 ? 1 : fit;
    using V = Vector<S, lanes>;
    alignas(64) S rest[half];
    for (std::size_t i = 0; i < half; i += lanes)
      store_lanes(rest + i, combine(load_lanes<V>(row + i), load_lanes<V>(row + half + i)));
    return reduced<S, half>(rest, combine);
  }
}
inline constexpr auto add_lanes = [](const auto& a, const auto& b) { return a + b; };
inline constexpr auto smaller_lanes = [](const auto& a, const auto& b) { return smaller(a, b); };
inline constexpr auto larger_lanes = [](const auto& a, const auto& b) { return larger(a, b); };

/// Computes the normals of the triangles, as rows.
template <class S, std::size_t padded>
[[gnu::always_inline]] inline void find_normals(const S* corners, S (&normals)[3][padded]) {
  using V = Vector<S, block_lanes<S, padded>>;
  constexpr std::size_t lanes = block_lanes<S, padded>;
  for (std::size_t lane = 0; lane < padded; lane += lanes) {
    V e[3], f[3];
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const V p = load_lanes<V>(corners + axis * padded + lane);
      e[axis] = load_lanes<V>(corners + (3 + axis) * padded + lane) - p;
      f[axis] = load_lanes<V>(corners + (6 + axis) * padded + lane) - p;
    }
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const std::size_t j = (axis + 1) % 3, k = (axis + 2) % 3;
      store_lanes(normals[axis] + lane, e[j] * f[k] - e[k] * f[j]);
    }
  }
}

/// Writes the direction of the slab: the sum of the normals of the first `count` triangles. Writes zero,
/// which separates nothing, if the sum is too small or too large to be scaled. The other triangles repeat the
/// last one.
template <class S, std::size_t padded>
[[gnu::always_inline]] inline void find_direction(const S (&normals)[3][padded], std::uint32_t count,
                                                  S* direction) {
  S n[3], size = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    alignas(64) S row[padded];
    for (std::size_t i = 0; i < padded; ++i) row[i] = i < count ? normals[axis][i] : S(0);
    n[axis] = reduced<S, padded>(row, add_lanes);
    size += n[axis] < 0 ? -n[axis] : n[axis];
  }
  constexpr S least = sizeof(S) == 4 ? S(0x1p-100) : S(0x1p-900), most = 1 / least;
  const S scale = size > least && size < most ? 1 / size : 0;
  for (std::size_t axis = 0; axis < 3; ++axis) direction[axis] = scale == 0 ? 0 : n[axis] * scale;
}

/// Computes the rows of corners.
template <class S, std::size_t padded>
[[gnu::always_inline]] inline void load_corners(const WideLeafLists& lists, std::uint32_t leaf,
                                                const S* positions, S* corners) {
  using P = Points<S, 1>;
  using Pack = typename P::Pack;
  const std::uint32_t begin = lists.first_entry[leaf], end = lists.end_entry[leaf];
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
[[gnu::always_inline]] inline void find_extent(const S* corners, const S (&direction)[3], S& low, S& high) {
  using V = Vector<S, block_lanes<S, padded>>;
  constexpr std::size_t lanes = block_lanes<S, padded>;
  alignas(64) S lows[padded], highs[padded];
  for (std::size_t lane = 0; lane < padded; lane += lanes) {
    V l, h;
    project<S, padded, V>(corners, lane, direction, l, h);
    store_lanes(lows + lane, l);
    store_lanes(highs + lane, h);
  }
  low = reduced<S, padded>(lows, smaller_lanes);
  high = reduced<S, padded>(highs, larger_lanes);
}

/// Returns the largest magnitude among the rows of corners.
template <class S, std::size_t padded>
[[gnu::always_inline]] inline S largest_coordinate(const S* corners) {
  using V = Vector<S, block_lanes<S, padded>>;
  constexpr std::size_t lanes = block_lanes<S, padded>;
  alignas(64) S most[padded];
  for (std::size_t lane = 0; lane < padded; lane += lanes) {
    V m{};
    for (std::size_t row = 0; row < 9; ++row) {
      const V x = load_lanes<V>(corners + row * padded + lane);
      m = larger(larger(x, -x), m);
    }
    store_lanes(most + lane, m);
  }
  return reduced<S, padded>(most, larger_lanes);
}

/// Returns a mask. Bit i: triangle i may reach into the slab, or an intermediate result is not finite.
template <class S, std::size_t padded>
[[gnu::always_inline]] inline unsigned meeting_slab(const S* corners, const Slab<S>& slab) {
  using V = Vector<S, block_lanes<S, padded>>;
  constexpr std::size_t lanes = block_lanes<S, padded>;
  unsigned bits = 0;
  for (std::size_t lane = 0; lane < padded; lane += lanes) {
    V low, high;
    project<S, padded, V>(corners, lane, slab.direction, low, high);
    const auto apart = (high < slab.low) | (low > slab.high);
    if constexpr (lanes == 1)
      bits |= unsigned(apart) << lane;
    else
      bits |= mask_bits(apart) << lane;
  }
  return ~bits & ((1U << padded) - 1);
}

}  // namespace
}  // namespace kbvh
