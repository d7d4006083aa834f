#pragma once
#include "core/families/wide/kernels/wide_layout.hpp"
#include "core/families/wide/kernels/wide_overlap.hpp"
#include "core/kernels/kernel_tables.hpp"

namespace kbvh {

enum class KernelSet : std::uint8_t;

/// Two near primitives, with the share of the reach at which their boxes can first meet. 0 if and only if
/// they overlap already.
struct NearPair {
  std::uint32_t primitive_a, primitive_b;
  float ratio;
};

/// One side of leaf pairs: like `WideLeaves`, with its own memory for rows, in leaves of any size.
template <class S>
struct NearLeaves {
  WideLeafLists lists;
  S* rows;                ///< [leaf][6][padded leaf size, at least 4]
  std::uint32_t* stamps;  ///< [leaf]: stamp of the positions of its rows
  std::uint32_t stamp;
  const S* positions;
  S margin[6];  ///< margin by which the hierarchy's rows exceed the vertices: lower sides, upper ones
  S rounding;   ///< additional error of vertices, relative to their coordinates
};

/// Turns pairs of leaves into pairs of primitives whose boxes may meet while the two bodies close in on each
/// other by no more than the reach. Sides 0 to 2: b lies on the upper side of a along x, y, z; 3 to 5: on the
/// lower side.
template <class S>
struct LeafNear {
  WideArrays<S> a, b;
  NearLeaves<S> leaves_a, leaves_b;
  S inverse_reach[6];     ///< 1 / reach, by side; positive and finite
  const LeafSlot* pairs;  ///< first, second, ...
  std::size_t next, count;
  NearPair* out;
  std::size_t found, out_room;
  std::uint64_t tests;
};

/// The current primitives of one body: CSR lists, and positions [vertex][3], one number past the end
/// readable.
template <class S>
struct PrimitivesNow {
  const std::uint32_t *offsets, *vertices;
  const S* positions;
};

template <class S>
struct NearKernels {
  /// Continues until all pairs of leaves are done or the next one might exceed the free space
  /// (`leaf_pair_step`).
  using Near = void (*)(LeafNear<S>& state);
  /// Inflates all boxes of a hierarchy by the margin, lower sides x, y, z, upper sides x, y, z, and by
  /// `rounding` of each side, with an allowance for the roundings of this function.
  using Widen = void (*)(WideArrays<S> hierarchy, std::uint32_t node_count, const S* margin, S rounding);
  Near near_padded[3][3];  ///< [log2(width) - 1][padded leaf size 4, 8, 16]
  Widen widen_width[3];    ///< [log2(width) - 1]
  /// Computes the least and the largest of now - before over `vertices` points [vertex][3], each rounded to
  /// nearest: lower x, y, z, unused, upper x, y, z, unused.
  void (*drift)(const S* now, const S* before, std::size_t vertices, S* interval);

  /// Keeps the pairs whose primitives' boxes overlap now, in their order, and returns their number; `out` has
  /// space for all pairs.
  std::size_t (*meeting)(const FoundPair* pairs, std::size_t count, PrimitivesNow<S> a, PrimitivesNow<S> b,
                         FoundPair* out);

  static constexpr std::size_t index(std::uint32_t width) { return width == 2 ? 0 : width == 4 ? 1 : 2; }
  Near near(std::uint32_t width, std::uint32_t padded) const {
    return near_padded[index(width)][index(padded / 2)];
  }
  Widen widen(std::uint32_t width) const { return widen_width[index(width)]; }
};
KBVH_DECLARE_KERNELS(NearKernels<float>, near_float)
KBVH_DECLARE_KERNELS(NearKernels<double>, near_double)

/// Returns the kernels of one instruction set.
template <class S>
const NearKernels<S>& near_kernels(KernelSet set);
template <>
const NearKernels<float>& near_kernels(KernelSet set);
template <>
const NearKernels<double>& near_kernels(KernelSet set);

}  // namespace kbvh
