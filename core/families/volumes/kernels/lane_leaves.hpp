#pragma once
#include <cstdint>

#include "core/families/wide/kernels/wide_overlap.hpp"
#include "core/kernels/kernel_tables.hpp"

namespace kbvh {

/// Turns pairs of leaves into pairs of primitives whose boxes overlap, for trees without boxes of nodes. The
/// boxes of primitives are computed at the first use of a leaf: rows as in WideLeaves, followed by the box
/// around all of them as lower x, y, z, -upper x, y, z and two unused numbers.
template <class S>
struct LaneLeafPairs {
  const WideNode *nodes_a, *nodes_b;
  WideLeaves<S> leaves_a, leaves_b;
  const LeafSlot* pairs;  ///< first, second, ...
  std::size_t next, count;
  std::uint32_t body_a, body_b;
  FoundPair* out;
  std::size_t found, out_room;
  std::uint64_t tests;
};

template <class S>
struct LaneLeafKernels {
  /// Continues until all pairs of leaves are done or the next one might exceed the free space. For leaves of
  /// up to 4, 8 or 16 primitives.
  using Pairs = void (*)(LaneLeafPairs<S>& job);
  Pairs pairs_padded[3];
  Pairs pairs(std::uint32_t padded) const { return pairs_padded[padded == 4 ? 0 : padded == 8 ? 1 : 2]; }
};
KBVH_DECLARE_KERNELS(LaneLeafKernels<float>, lane_leaf_float)
KBVH_DECLARE_KERNELS(LaneLeafKernels<double>, lane_leaf_double)

/// Returns the kernels of one instruction set.
template <class S>
const LaneLeafKernels<S>& lane_leaf_kernels(KernelSet set);
template <>
const LaneLeafKernels<float>& lane_leaf_kernels(KernelSet set);
template <>
const LaneLeafKernels<double>& lane_leaf_kernels(KernelSet set);

}  // namespace kbvh
