#pragma once
#include <cstddef>
#include <cstdint>

#include "core/families/wide/kernels/wide_overlap.hpp"
#include "core/kernels/kernel_tables.hpp"

namespace kbvh {

enum class KernelSet : std::uint8_t;

/// The slab of a leaf over a segment: one direction for the whole segment, the leaf's extent along it at both
/// ends, and its largest coordinate.
template <class S>
struct SpanSlab {
  S direction[3], low[2], high[2], largest;
};

/// A leaf of triangles at one end of a segment: nine rows of coordinates as in SlabBlock, and the direction
/// of its slab at that time.
struct SpanBlock {
  static constexpr std::size_t rows = 9, tail = 16;
  static constexpr std::size_t scalars(std::size_t padded) { return rows * padded + tail; }
};

/// The leaves of one body of triangles in linear motion over a segment.
template <class S>
struct SlabSpanLeaves {
  WideLeafLists lists;
  /// By end; both the same for a body at rest.
  S* blocks[2];              ///< [leaf][SpanBlock::scalars]
  std::uint32_t* stamps[2];  ///< [leaf]: stamp of the positions of its block
  std::uint32_t stamp[2];    ///< stamp of these positions
  const S* positions[2];
  SpanSlab<S>* slabs;          ///< [leaf]
  std::uint32_t* slab_stamps;  ///< [leaf]: stamp of the segment of its slab
  std::uint32_t slab_stamp;    ///< of the segment
};

/// Leaves out the pairs of leaves whose triangles a slab separates throughout the segment. A slab has a
/// constant direction. Along it the gap between two sets of points in linear motion is concave in time: sets
/// that are apart, on the same side, at both ends are apart in between.
template <class S>
struct SlabSpanPairs {
  WideArrays<S> a, b;
  SlabSpanLeaves<S> leaves_a, leaves_b;
  /// Bounds the rounding of a product, and the distance of positions from the lines, relative to a leaf's
  /// largest coordinate.
  S rounding;
  LeafSlot* pairs;  ///< first, second, ...; replaced by the remaining ones
  std::size_t count;
  /// For the remaining pairs: bit i, triangle i of the first leaf may meet the second leaf; bit 16 + i,
  /// triangle i of the second.
  std::uint32_t* masks;
  std::uint64_t tests;
};

template <class S>
struct SlabSpanKernels {
  /// Filters; computes the blocks and slabs that are not current.
  using Filter = void (*)(SlabSpanPairs<S>& state);
  /// Computes the slabs of a list of leaves, and their blocks unless they are current. The caller stamps the
  /// slabs: several threads may make different leaves.
  using Make = void (*)(const SlabSpanLeaves<S>& leaves, const std::uint32_t* list, std::size_t count);
  Filter padded_filter[3];  ///< [padded leaf size 4, 8, 16]
  Make padded_make[3];
  Make make(std::uint32_t padded) const { return padded_make[padded <= 4 ? 0 : padded <= 8 ? 1 : 2]; }
  Filter filter(std::uint32_t padded) const { return padded_filter[padded <= 4 ? 0 : padded <= 8 ? 1 : 2]; }
};
KBVH_DECLARE_KERNELS(SlabSpanKernels<float>, slab_spans_float)
KBVH_DECLARE_KERNELS(SlabSpanKernels<double>, slab_spans_double)

/// Returns the kernels of one instruction set.
template <class S>
const SlabSpanKernels<S>& slab_span_kernels(KernelSet set);
template <>
const SlabSpanKernels<float>& slab_span_kernels(KernelSet set);
template <>
const SlabSpanKernels<double>& slab_span_kernels(KernelSet set);

}  // namespace kbvh
