#pragma once
#include <cstdint>

#include "core/families/wide/kernels/wide_layout.hpp"
#include "core/kernels/kernel_tables.hpp"

namespace kbvh {

enum class KernelSet : std::uint8_t;

/// Recomputes the boxes of the wide nodes [begin, end), the last first. Children that are nodes must be
/// current or lie in the range, too. `positions` is [vertex][3], with one readable number after the last
/// vertex.
template <class S>
struct WideRefitKernels {
  using Refit = void (*)(WideArrays<S> hierarchy, const S* positions, std::uint32_t begin, std::uint32_t end);
  /// Recomputes the boxes of the wide nodes order[0, count), children before parents: for layouts in which
  /// parents may have larger numbers than their children.
  using RefitListed = void (*)(WideArrays<S> hierarchy, const S* positions, const std::uint32_t* order,
                               std::uint32_t count);
  Refit width2, width4, width8;
  RefitListed listed2, listed4, listed8;
  Refit of(std::uint32_t width) const { return width == 2 ? width2 : width == 4 ? width4 : width8; }
  RefitListed listed(std::uint32_t width) const {
    return width == 2 ? listed2 : width == 4 ? listed4 : listed8;
  }
};
KBVH_DECLARE_KERNELS(WideRefitKernels<float>, wide_refit_float)
KBVH_DECLARE_KERNELS(WideRefitKernels<double>, wide_refit_double)

/// Returns the kernels of one instruction set.
template <class S>
const WideRefitKernels<S>& wide_refit_kernels(KernelSet set);
template <>
const WideRefitKernels<float>& wide_refit_kernels(KernelSet set);
template <>
const WideRefitKernels<double>& wide_refit_kernels(KernelSet set);

}  // namespace kbvh
