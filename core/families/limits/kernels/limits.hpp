#pragma once
#include <cstddef>
#include <cstdint>

#include "core/kernels/kernel_tables.hpp"

namespace kbvh {

enum class KernelSet : std::uint8_t;

/// What nothing can beat: loops that only move bytes, and the interpolation that does not care how it rounds.
struct LimitKernels {
  /// Reads all of `from` and writes all of `to`, in order. Returns something that depends on what was read.
  unsigned (*read)(const void* from, std::size_t bytes);
  void (*write)(void* to, std::size_t bytes, unsigned value);
  /// out = x0 + ratio * (x1 - x0), rounded as it comes.
  void (*lerp_float)(const float* x0, const float* x1, std::size_t count, float ratio, float* out);
  void (*lerp_double)(const double* x0, const double* x1, std::size_t count, double ratio, double* out);
};
KBVH_DECLARE_KERNELS(LimitKernels, limits)

/// Those of one instruction set.
const LimitKernels& limit_kernels(KernelSet set);

}  // namespace kbvh
