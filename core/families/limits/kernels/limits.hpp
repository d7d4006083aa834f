#pragma once
#include <cstddef>
#include <cstdint>

#include "core/kernels/kernel_tables.hpp"

namespace kbvh {

enum class KernelSet : std::uint8_t;

/// Lower bounds for every refit: loops that only move bytes, and interpolation without correct rounding.
struct LimitKernels {
  /// Read all of `from` and write all of `to`, in order. Return a value that depends on the data read.
  unsigned (*read)(const void* from, std::size_t bytes);
  void (*write)(void* to, std::size_t bytes, unsigned value);
  /// Computes out = x0 + ratio * (x1 - x0) with the default rounding.
  void (*lerp_float)(const float* x0, const float* x1, std::size_t count, float ratio, float* out);
  void (*lerp_double)(const double* x0, const double* x1, std::size_t count, double ratio, double* out);
};
KBVH_DECLARE_KERNELS(LimitKernels, limits)

/// Returns the kernels of one instruction set.
const LimitKernels& limit_kernels(KernelSet set);

}  // namespace kbvh
