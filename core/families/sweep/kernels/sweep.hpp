#pragma once
#include <cstddef>
#include <cstdint>

#include "core/families/wide/kernels/wide_overlap.hpp"
#include "core/kernels/kernel_tables.hpp"

namespace kbvh {

inline constexpr std::uint32_t sweep_block = 16;  ///< boxes that are compared together

/// The boxes of a body in ascending order of their lower sides on one axis, in blocks of 16.
template <class S>
struct SweepSide {
  const S*
      rows;  ///< [block][6][16]: lower x, y, z, -upper x, y, z; the last block is filled up with infinity
  const S* reach;  ///< [block]: the largest upper side on the axis of all boxes up to the block's end
  const std::uint32_t* primitives;  ///< in the same order
  std::uint32_t count;
  std::uint32_t body;
  S box[8];  ///< of all: lower x, y, z, unused, upper x, y, z, unused
};

/// A sweep over two bodies, or over one body and itself, which can pause and resume.
template <class S>
struct SweepJob {
  SweepSide<S> a, b;
  std::uint32_t axis;
  std::uint32_t next;         ///< box of a; 0 at the start
  std::uint32_t first_block;  ///< of b: the first that may overlap the next box; 0 at the start
  std::uint32_t block;        ///< of b: the next one to compare with; `no_block` at the start
  FoundPair* out;
  std::size_t found, out_room;  ///< room for at least `sweep_block` pairs
  std::uint64_t tests;
  static constexpr std::uint32_t no_block = ~std::uint32_t(0);
};

template <class S>
struct SweepKernels {
  /// Continues until all boxes of a are done, or `out` might not have room for the next block. A box of a is
  /// compared with the boxes of b from the first one that reaches it to the last one that begins before its
  /// end.
  void (*two)(SweepJob<S>& job);
  /// Does the same for a body and itself: each two different boxes once.
  void (*one)(SweepJob<S>& job);
};
KBVH_DECLARE_KERNELS(SweepKernels<float>, sweep_float)
KBVH_DECLARE_KERNELS(SweepKernels<double>, sweep_double)

/// Returns the kernels of one instruction set.
template <class S>
const SweepKernels<S>& sweep_kernels(KernelSet set);
template <>
const SweepKernels<float>& sweep_kernels(KernelSet set);
template <>
const SweepKernels<double>& sweep_kernels(KernelSet set);

}  // namespace kbvh
