#pragma once
#include <cstddef>
#include <cstdint>

#include "core/kernels/kernel_tables.hpp"

namespace kbvh {

enum class KernelSet : std::uint8_t;

/// The approximations of positions and boxes. All sets of instructions compute the same bits.
template <class S>
struct ReduceKernels {
  /// Computes out = from + u (to - from) in S, each operation rounded to nearest.
  void (*interpolate)(const S* from, const S* to, S u, S* out, std::size_t count);
  /// Rounds to the nearest number with `dropped` binary digits fewer than S has, ties to even; 0 < dropped <
  /// the digits of S. The range of exponents stays; infinities stay, too.
  void (*nearest)(S* values, std::size_t count, unsigned dropped);
  /// Rounds down to the next such number; leaves such numbers unchanged.
  void (*down)(S* values, std::size_t count, unsigned dropped);
  /// Subtracts a margin, rounded to nearest. In rows of boxes, which hold lower and -upper sides, boxes grow
  /// by it.
  void (*widen)(S* values, std::size_t count, S margin);
};
KBVH_DECLARE_KERNELS(ReduceKernels<float>, reduce_float)
KBVH_DECLARE_KERNELS(ReduceKernels<double>, reduce_double)

/// Returns the kernels of one instruction set.
template <class S>
const ReduceKernels<S>& reduce_kernels(KernelSet set);
template <>
const ReduceKernels<float>& reduce_kernels(KernelSet set);
template <>
const ReduceKernels<double>& reduce_kernels(KernelSet set);

}  // namespace kbvh
