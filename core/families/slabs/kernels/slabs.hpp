#pragma once
#include <cstddef>
#include <cstdint>

#include "core/families/wide/kernels/wide_overlap.hpp"
#include "core/kernels/kernel_tables.hpp"

namespace kbvh {

enum class KernelSet : std::uint8_t;

/// A leaf of triangles as a block of rows of `padded` lanes, one triangle per lane: six rows of boxes like
/// those of a node; nine rows of coordinates (corner 0 x, y, z, corner 1 x, ...); three rows of normals, with
/// the smallest and the largest product of a triangle's normal and its corners, and the sum of the normal's
/// absolute components. The slab follows the rows: a direction whose absolute components add up to about 1,
/// the smallest and the largest product of it and a corner, and the largest coordinate. Lanes after the last
/// triangle have empty boxes and repeat its other numbers.
struct SlabBlock {
  static constexpr std::size_t corner_row = 6, normal_row = 15, low_row = 18, high_row = 19, size_row = 20;
  static constexpr std::size_t rows = 21, tail = 16;
  static constexpr std::size_t scalars(std::size_t padded) { return rows * padded + tail; }
};

/// The blocks of a body's leaves, computed when a query first needs them.
template <class S>
struct SlabLeaves {
  WideLeafLists lists;
  S* blocks;              ///< [leaf][SlabBlock::scalars]
  std::uint32_t* stamps;  ///< [leaf]: number of the refit of its block
  std::uint32_t stamp;    ///< of the current positions
  const S* positions;
};

/// Turns pairs of leaves into pairs of triangles whose boxes overlap, if each triangle meets the slab of the
/// other's leaf, and the second one meets the plane of the first.
template <class S>
struct SlabLeafPairs {
  WideArrays<S> a, b;
  SlabLeaves<S> leaves_a, leaves_b;
  /// Bounds the rounding of a product of a direction and a corner, relative to the leaf's largest coordinate.
  S rounding;
  const LeafSlot* pairs;  ///< first, second, ...
  std::size_t next, count;
  std::uint32_t *primitives_a, *primitives_b;  ///< found pairs in columns
  std::size_t found, room;
  std::uint64_t tests;      ///< of boxes
  std::uint64_t separated;  ///< pairs of leaves that a slab separates completely
};
/// The space that one pair of leaves may write, in pairs: 256 and a register.
inline constexpr std::size_t slab_pair_step = 256 + 16;

template <class S>
struct SlabKernels {
  /// Continues until all pairs of leaves are done or the next one might exceed the free space.
  using LeafPairs = void (*)(SlabLeafPairs<S>& state);
  /// [log2(width) - 1][padded leaf size 4, 8, 16]
  LeafPairs leaf_pairs[3][3];
  LeafPairs pairs(std::uint32_t width, std::uint32_t padded) const {
    return leaf_pairs[width == 2 ? 0 : width == 4 ? 1 : 2][padded <= 4 ? 0 : padded <= 8 ? 1 : 2];
  }
};
KBVH_DECLARE_KERNELS(SlabKernels<float>, slabs_float)
KBVH_DECLARE_KERNELS(SlabKernels<double>, slabs_double)

/// Returns the kernels of one instruction set.
template <class S>
const SlabKernels<S>& slab_kernels(KernelSet set);
template <>
const SlabKernels<float>& slab_kernels(KernelSet set);
template <>
const SlabKernels<double>& slab_kernels(KernelSet set);

}  // namespace kbvh
