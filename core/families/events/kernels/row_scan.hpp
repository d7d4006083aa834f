#pragma once
#include <cstddef>
#include <cstdint>

#include "core/kernels/kernel_tables.hpp"

namespace kbvh {

enum class KernelSet : std::uint8_t;

template <class S>
struct RowScanKernels {
  /// The first i in [from, end) with a[i] > b[i], or `end`. May read `row_padding` numbers past `end`.
  std::size_t (*first_above)(const S* a, const S* b, std::size_t from, std::size_t end);
};
/// As many numbers of a row are read at once, at most.
inline constexpr std::size_t row_padding = 16;

KBVH_DECLARE_KERNELS(RowScanKernels<float>, row_scan_float)
KBVH_DECLARE_KERNELS(RowScanKernels<double>, row_scan_double)

/// Those of one instruction set.
template <class S>
const RowScanKernels<S>& row_scan_kernels(KernelSet set);
template <>
const RowScanKernels<float>& row_scan_kernels(KernelSet set);
template <>
const RowScanKernels<double>& row_scan_kernels(KernelSet set);

}  // namespace kbvh
