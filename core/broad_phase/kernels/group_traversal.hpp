#pragma once
#include <cstdint>

#include "core/families/wide/kernels/wide_overlap.hpp"

namespace kbvh {

/// Groups and masks or-ed up an 8-wide tree: of a node, those of all elements below.
struct GroupArrays {
  const std::uint32_t* children;  ///< [node][2][8]: the groups of each child, then the masks; empty lanes: 0
  const std::uint32_t* nodes;     ///< [node][2]: the node's own groups and mask
};

/// The traversal of WideOverlapKernels, which leaves out two subtrees if no element of one may pair with an
/// element of the other: if no group of one is in the mask of the other.
template <class S>
struct GroupTraversalKernels {
  using Traverse = void (*)(WideArrays<S> a, WideArrays<S> b, GroupArrays groups_a, GroupArrays groups_b,
                            WideTraversal& state);
  Traverse two, self;
};
KBVH_DECLARE_KERNELS(GroupTraversalKernels<float>, group_traversal_float)
KBVH_DECLARE_KERNELS(GroupTraversalKernels<double>, group_traversal_double)

/// Returns the kernels of one instruction set.
template <class S>
const GroupTraversalKernels<S>& group_traversal_kernels(KernelSet set);
template <>
const GroupTraversalKernels<float>& group_traversal_kernels(KernelSet set);
template <>
const GroupTraversalKernels<double>& group_traversal_kernels(KernelSet set);

}  // namespace kbvh
