#pragma once
#include <cstddef>
#include <cstdint>

#include "core/families/wide/kernels/wide_layout.hpp"
#include "core/kernels/kernel_tables.hpp"

namespace kbvh {

enum class KernelSet : std::uint8_t;

/// The boxes of a body's primitives, and the centres of these boxes.
template <class S>
struct PrimitiveBoxesJob {
  const std::uint32_t* offsets;   ///< [primitive + 1]: its corners
  const std::uint32_t* vertices;  ///< of all corners
  std::uint32_t corners_each;     ///< the number of corners of every primitive; 0: it varies
  const std::uint32_t* living;    ///< [k]: the k-th primitive; null: k
  std::uint32_t count;            ///< of living primitives; not 0
  const S* positions;             ///< [vertex][3], one scalar past the end readable
  S* boxes;    ///< [primitive][8]: lower x, y, z, unused, upper x, y, z, unused; 64 bytes past the end
  S* centres;  ///< [axis][stride]: lower + upper of the k-th primitive
  std::size_t stride;  ///< at least `count` rounded up to a multiple of 16
  S* extent;           ///< [8]: the smallest centre x, y, z, unused, and the largest
};

/// The order in which a space-filling curve visits the cells of a grid.
enum class Curve : std::uint8_t { morton, hilbert };

/// Keys along a space-filling curve through a grid of 1,024 cells along each axis: the code in the upper 32
/// bits, the primitive in the lower 32.
template <class S>
struct CurveKeysJob {
  const S* centres;  ///< as above, and so `stride`, `living`
  std::size_t stride;
  const std::uint32_t* living;
  std::uint32_t count;
  Curve curve;
  std::uint32_t dropped_bits;  ///< number of lowest bits of the code that are left out
  S lower[3];                  ///< corner of the grid
  S scale[3];                  ///< cells per unit
  std::uint64_t* keys;
  /// [2][3][2048], added to: counts of the code's digits of 11 bits, the lowest first, for keys at even and
  /// at odd places. Neighbours often share a digit, and a single counter would have to wait for its last
  /// update. May be null.
  std::uint32_t* histogram;
};
inline constexpr std::uint32_t code_digit_bits = 11, code_digits = 3;
inline constexpr std::uint32_t curve_bits = 10;  ///< of each axis

/// The rows and boxes of leaves, from the boxes of their primitives.
template <class S>
struct LeafRowsJob {
  const S* boxes;  ///< [primitive][8]
  const std::uint32_t* entries;
  const std::uint32_t *first_entry, *end_entry;  ///< [leaf]
  std::uint32_t leaves;
  S* rows;        ///< [leaf][6][padded leaf size], as in WideLeaves; not read for leaves of one primitive
  S* leaf_boxes;  ///< [leaf][8], like `boxes`
};

template <class S>
struct BuildKernels {
  void (*primitive_boxes)(const PrimitiveBoxesJob<S>& job);
  void (*curve_keys)(const CurveKeysJob<S>& job);
  /// [padded leaf size 1, 4, 8, 16]
  void (*leaf_rows[4])(const LeafRowsJob<S>& job);
  /// Computes the boxes of the 8-wide nodes [begin, end) of a hierarchy in which parents have smaller numbers
  /// than their children; those of other children are current.
  void (*nodes)(WideArrays<S> hierarchy, const S* leaf_boxes, std::uint32_t begin, std::uint32_t end);
};
KBVH_DECLARE_KERNELS(BuildKernels<float>, build_float)
KBVH_DECLARE_KERNELS(BuildKernels<double>, build_double)

/// Returns the kernels of one instruction set.
template <class S>
const BuildKernels<S>& build_kernels(KernelSet set);
template <>
const BuildKernels<float>& build_kernels(KernelSet set);
template <>
const BuildKernels<double>& build_kernels(KernelSet set);

}  // namespace kbvh
