#pragma once
#include <cstddef>
#include <cstdint>

#include "core/kernels/kernel_tables.hpp"

namespace kbvh {

enum class KernelSet : std::uint8_t;

/// The rows of many vertices along one direction: row v begins at values + v * stride.
template <class S>
struct RowTable {
  const S* values;
  std::size_t stride;
};

/// The first vertex of a list whose row gets ahead of another row, and where.
struct RowAhead {
  std::size_t index;  ///< in the list; the list's length if there is none
  std::size_t at;     ///< the first column at which that row is ahead
};

template <class S>
struct RowScanKernels {
  /// Returns the first i in [from, end) with a[i] > b[i], or `end`. May read `row_padding` numbers past
  /// `end`.
  std::size_t (*first_above)(const S* a, const S* b, std::size_t from, std::size_t end);
  /// Returns the first of vertices[first .. count) whose row is ahead of `winner` in a column of [from, end):
  /// [1] above it, [0] below it. May read `row_padding` numbers past `end`.
  RowAhead (*next_ahead[2])(RowTable<S> rows, const std::uint32_t* vertices, std::size_t first,
                            std::size_t count, const S* winner, std::size_t from, std::size_t end);
  /// Returns how often `vertex` is in a list of `count`.
  std::uint32_t (*occurrences)(const std::uint32_t* vertices, std::size_t count, std::uint32_t vertex);
};
/// The largest number of values of a row that are read at once.
inline constexpr std::size_t row_padding = 16;

KBVH_DECLARE_KERNELS(RowScanKernels<float>, row_scan_float)
KBVH_DECLARE_KERNELS(RowScanKernels<double>, row_scan_double)

/// Returns the kernels of one instruction set.
template <class S>
const RowScanKernels<S>& row_scan_kernels(KernelSet set);
template <>
const RowScanKernels<float>& row_scan_kernels(KernelSet set);
template <>
const RowScanKernels<double>& row_scan_kernels(KernelSet set);

}  // namespace kbvh
