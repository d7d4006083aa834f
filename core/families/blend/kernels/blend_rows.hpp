#pragma once
#include <cstddef>
#include <cstdint>

#include "core/families/wide/kernels/wide_layout.hpp"
#include "core/kernels/kernel_tables.hpp"

namespace kbvh {

enum class KernelSet : std::uint8_t;

/// One term of a blend of boxes: ranges of one quantity below every child, and its weight in the blend.
template <class S>
struct BlendTerm {
  /// Rows [6][width] as in WideArrays::child_bounds; those of a node start `Blend::stride` scalars after
  /// those of the node before.
  const S* rows;
  S weight;  ///< not negative
  /// 0, or 1: the quantity is multiplied by the negated weight, which swaps lower and upper sides.
  std::uint32_t mirrored;
};

/// Boxes as weighted sums of stored boxes: side i of a child is the sum of weight * side over all terms, plus
/// the offset of the side. A sum of intervals contains the sum of any of their members (interval arithmetic).
template <class S>
struct Blend {
  const BlendTerm<S>* terms;
  std::uint32_t count;  ///< at least 1
  std::size_t stride;
  S offset[6];  ///< as in rows: added to lower x, y, z and to -upper x, y, z, after all terms
  /// If not 0: every side moves outwards by this share of its terms' magnitudes.
  S rounding;
};

template <class S>
struct BlendKernels {
  /// Writes the rows of the listed wide nodes, and their own boxes: the union of the children's. Empty lanes
  /// have to be infinite in the first term, and 0 or, with a weight that is not 0, infinite in all others.
  using Make = void (*)(WideArrays<S> hierarchy, const Blend<S>& blend, const std::uint32_t* nodes,
                        std::size_t count);
  Make width2, width4, width8;
  Make of(std::uint32_t width) const { return width == 2 ? width2 : width == 4 ? width4 : width8; }
};
KBVH_DECLARE_KERNELS(BlendKernels<float>, blend_rows_float)
KBVH_DECLARE_KERNELS(BlendKernels<double>, blend_rows_double)

/// Returns the kernels of one instruction set.
template <class S>
const BlendKernels<S>& blend_kernels(KernelSet set);
template <>
const BlendKernels<float>& blend_kernels(KernelSet set);
template <>
const BlendKernels<double>& blend_kernels(KernelSet set);

}  // namespace kbvh
