#pragma once
#include <cstddef>
#include <cstdint>

#include "core/families/wide/kernels/wide_overlap.hpp"
#include "core/kernels/kernel_tables.hpp"

namespace kbvh {

/// An entry of a front: two nodes, or a node and a leaf (named as in WidePair), whose boxes overlapped at the
/// last update, and which of their children did. 16 bytes.
struct FrontPair {
  std::uint32_t first, second;
  /// Of two nodes, bit 8 i + j: child i of the first overlapped child j of the second. Of a node and a leaf,
  /// bit i: child i of the node overlapped the leaf. Each such pair of children is an entry of its own,
  /// unless both are leaves. 0 for a new entry.
  std::uint64_t met;
};
static_assert(sizeof(FrontPair) == 16);

/// The update of the front of two hierarchies, which can pause and resume. New entries wait on the stack;
/// updated ones, except those whose boxes are apart, are appended to `kept`.
struct FrontUpdate {
  const FrontPair* old;
  std::size_t next, end;  ///< entries of the last update that are still to be tested
  FrontPair* stack;
  std::size_t depth, stack_room;
  FrontPair* kept;
  std::size_t kept_count, kept_room;
  LeafSlot* out;                ///< pairs of overlapping leaves: first, second, first, second, ...
  std::size_t found, out_room;  ///< in pairs
  std::uint64_t tests, test_limit;
  std::uint64_t descended, climbed;  ///< number of entries made, and dropped
  bool done() const { return depth == 0 && next == end; }
};
/// The space for pairs of leaves that one step may write, in pairs.
inline constexpr std::size_t front_step = max_pairs_per_step + 8;

template <class S>
struct FrontKernels {
  /// Continues until nothing is left to be tested, the limit of tests is reached, or a step might exceed the
  /// free space.
  using Update = void (*)(WideArrays<S> a, WideArrays<S> b, FrontUpdate& update);
  Update two[3];     ///< [log2(width) - 1]
  Update within[3];  ///< the same for a hierarchy with itself: two different leaves once, each with itself
  Update update(std::uint32_t width, bool within_one) const {
    return (within_one ? within : two)[width == 2 ? 0 : width == 4 ? 1 : 2];
  }
};
KBVH_DECLARE_KERNELS(FrontKernels<float>, front_float)
KBVH_DECLARE_KERNELS(FrontKernels<double>, front_double)

/// Returns the kernels of one instruction set.
template <class S>
const FrontKernels<S>& front_kernels(KernelSet set);
template <>
const FrontKernels<float>& front_kernels(KernelSet set);
template <>
const FrontKernels<double>& front_kernels(KernelSet set);

}  // namespace kbvh
