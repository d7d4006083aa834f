#pragma once
#include <cstddef>
#include <cstdint>

#include "core/kernels/kernel_tables.hpp"

namespace kbvh {

enum class KernelSet : std::uint8_t;

template <class S>
struct MeetingKernels {
  /// Returns a mask. Bit i: the box in lane i of a wide node's rows overlaps `box`, [6]: lower x, y, z, upper
  /// x, y, z. Boxes are closed.
  using Meeting = unsigned (*)(const S* rows, const S* box);
  Meeting meeting_width[3];  ///< [log2(width) - 1]
  Meeting meeting(std::uint32_t width) const { return meeting_width[width == 2 ? 0 : width == 4 ? 1 : 2]; }
};
KBVH_DECLARE_KERNELS(MeetingKernels<float>, meeting_float)
KBVH_DECLARE_KERNELS(MeetingKernels<double>, meeting_double)

/// Returns the kernels of one instruction set.
template <class S>
const MeetingKernels<S>& meeting_kernels(KernelSet set);
template <>
const MeetingKernels<float>& meeting_kernels(KernelSet set);
template <>
const MeetingKernels<double>& meeting_kernels(KernelSet set);

}  // namespace kbvh
