#pragma once
#include <cstdint>

#include "core/families/wide/kernels/wide_layout.hpp"
#include "core/kernels/kernel_tables.hpp"

namespace kbvh {

enum class KernelSet : std::uint8_t;

/// A simultaneous traversal that can pause and resume; the caller provides memory.
struct WideTraversal {
  WidePair* stack;
  std::size_t depth, stack_room;
  LeafSlot* out;                ///< pairs of overlapping leaves: first, second, first, second, ...
  std::size_t found, out_room;  ///< in pairs
  std::uint64_t tests, test_limit;
  /// Per node of each hierarchy, for the lazy traversal: not 0 if its children's boxes must be computed
  /// first.
  const std::uint8_t *stale_a = nullptr, *stale_b = nullptr;

  /// Return whether the pair on top waits for boxes of the first, or of the second hierarchy.
  [[gnu::always_inline]] bool first_is_stale() const {
    return (stack[depth - 1].first & WidePair::leaf_bit) == 0 && stale_a[stack[depth - 1].first] != 0;
  }
  [[gnu::always_inline]] bool second_is_stale() const {
    return (stack[depth - 1].second & WidePair::leaf_bit) == 0 && stale_b[stack[depth - 1].second] != 0;
  }
};
/// The largest number of pairs that one step may push, and find.
inline constexpr std::size_t max_pairs_per_step = 64;

/// The primitives of a hierarchy's leaves.
struct WideLeafLists {
  const std::uint32_t* first_entry;   ///< [leaf]: entries of a leaf
  const std::uint32_t* end_entry;     ///< [leaf]: one past its last
  const std::uint32_t* first_corner;  ///< [entry + 1]: corners of an entry's primitive
  const std::uint32_t* corners;       ///< vertices, times 3
  const std::uint32_t* primitives;    ///< [entry]
};

/// The primitive boxes of leaves, computed when a query first needs them.
template <class S>
struct WideLeaves {
  WideLeafLists lists;
  S* rows;                ///< [leaf][6][padded leaf size]: rows like those of a node
  std::uint32_t* stamps;  ///< [leaf]: number of the refit of its rows
  std::uint32_t stamp;    ///< of the current positions
  const S* positions;
};

/// Two primitives whose boxes overlap.
struct FoundPair {
  std::uint32_t body_a, primitive_a, body_b, primitive_b;
};

/// Turns pairs of leaves into pairs of primitives whose boxes overlap.
template <class S>
struct WideLeafPairs {
  WideArrays<S> a, b;
  WideLeaves<S> leaves_a, leaves_b;
  const LeafSlot* pairs;  ///< first, second, ...
  std::size_t next, count;
  std::uint32_t body_a, body_b;
  FoundPair* out;
  std::size_t found, out_room;
  std::uint64_t tests;
};
/// The largest number of primitive pairs from one pair of leaves.
inline constexpr std::size_t leaf_pair_step = 256;

/// Compares boxes of both bodies as closed sets, many at a time.
template <class S>
struct WideOverlapKernels {
  /// Continues until the stack is empty, the limit of tests is reached, or a step might exceed the free
  /// space.
  using Traverse = void (*)(WideArrays<S> a, WideArrays<S> b, WideTraversal& state);
  /// Continues until all pairs of leaves are done or the next one might exceed the free space. For leaves of
  /// up to 4, 8 or 16 primitives.
  using LeafPairs = void (*)(WideLeafPairs<S>& state);
  Traverse width2, width4, width8;
  /// [log2(width) - 1][padded leaf size 4, 8, 16]
  LeafPairs leaf_pairs[3][3];
  /// Like `traverse`, but also pauses when the pair on top of the stack waits for boxes.
  Traverse lazy2, lazy4, lazy8;
  /// Like `traverse`, for a hierarchy with itself: two different leaves once, and each leaf with itself.
  Traverse self_width[3];
  Traverse self(std::uint32_t width) const { return self_width[width == 2 ? 0 : width == 4 ? 1 : 2]; }
  Traverse lazy(std::uint32_t width) const { return width == 2 ? lazy2 : width == 4 ? lazy4 : lazy8; }
  Traverse traverse(std::uint32_t width) const { return width == 2 ? width2 : width == 4 ? width4 : width8; }
  LeafPairs pairs(std::uint32_t width, std::uint32_t padded_leaf) const {
    return leaf_pairs[width == 2 ? 0 : width == 4 ? 1 : 2][padded_leaf == 4 ? 0 : padded_leaf == 8 ? 1 : 2];
  }
};
KBVH_DECLARE_KERNELS(WideOverlapKernels<float>, wide_overlap_float)
KBVH_DECLARE_KERNELS(WideOverlapKernels<double>, wide_overlap_double)

/// Returns the kernels of one instruction set.
template <class S>
const WideOverlapKernels<S>& wide_overlap_kernels(KernelSet set);
template <>
const WideOverlapKernels<float>& wide_overlap_kernels(KernelSet set);
template <>
const WideOverlapKernels<double>& wide_overlap_kernels(KernelSet set);

}  // namespace kbvh
