#pragma once
#include "core/families/wide/kernels/wide_layout.hpp"
#include "core/kernels/kernel_tables.hpp"

namespace kbvh {

enum class KernelSet : std::uint8_t;

/// Vertices [first, first + count), contiguous in memory.
struct VertexRun {
  std::uint32_t first, count;
};

/// Boxes computed directly from vertices, without a hierarchy.
template <class S>
struct BoundsKernels {
  /// Writes the box of the vertices in the runs (at least one) into 8 numbers: lower x, y, z, unused, upper
  /// x, y, z, unused. `positions` is [vertex][3], with one readable number after the last vertex.
  void (*of_runs)(const VertexRun* runs, std::size_t count, const S* positions, S* box);
};
KBVH_DECLARE_KERNELS(BoundsKernels<float>, bounds_float)
KBVH_DECLARE_KERNELS(BoundsKernels<double>, bounds_double)

/// Returns the kernels of one instruction set.
template <class S>
const BoundsKernels<S>& bounds_kernels(KernelSet set);
template <>
const BoundsKernels<float>& bounds_kernels(KernelSet set);
template <>
const BoundsKernels<double>& bounds_kernels(KernelSet set);

}  // namespace kbvh
