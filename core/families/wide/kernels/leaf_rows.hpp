#pragma once
#include "core/families/wide/kernels/wide_overlap.hpp"
#include "core/kernels/kernel_tables.hpp"

namespace kbvh {

/// Computes the rows of leaves outside of a query (`WideOverlapKernels` computes them at their first use).
template <class S>
struct LeafRowsKernels {
  /// Computes the rows of the listed leaves, for leaves of up to 4, 8 or 16 primitives; does not change
  /// stamps.
  using Fit = void (*)(const WideLeaves<S>& leaves, const std::uint32_t* list, std::size_t count);
  Fit fit_padded[3];
  Fit fit(std::uint32_t padded) const { return fit_padded[padded == 4 ? 0 : padded == 8 ? 1 : 2]; }
};
KBVH_DECLARE_KERNELS(LeafRowsKernels<float>, leaf_rows_float)
KBVH_DECLARE_KERNELS(LeafRowsKernels<double>, leaf_rows_double)

/// Returns the kernels of one instruction set.
template <class S>
const LeafRowsKernels<S>& leaf_rows_kernels(KernelSet set);
template <>
const LeafRowsKernels<float>& leaf_rows_kernels(KernelSet set);
template <>
const LeafRowsKernels<double>& leaf_rows_kernels(KernelSet set);

}  // namespace kbvh
