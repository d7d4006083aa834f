#pragma once
#include <cstddef>
#include <cstdint>

#include "core/kernels/kernel_tables.hpp"

namespace kbvh {

enum class KernelSet : std::uint8_t;

/// The sides of a k-DOP as they are stored: for each slab the largest n . p, then for each slab the largest
/// -n . p. Each half is padded to 8 or 16 slabs by slabs of direction 0, whose sides are 0: one or two cache
/// lines in float, and whole vectors.
constexpr std::size_t padded_sides(int sides) {
  return sides <= 16 ? 16 : 32;
}

/// A node, as in Topology: children or leaf content.
struct DopNode {
  std::uint32_t first;  ///< the first child; of a leaf, the first entry in its list of points
  std::uint32_t end;    ///< one past the last; parents precede their children
  bool leaf;
};

/// A k-DOP per node, computed from points. Slabs are padded, as in half of the sides.
template <class S>
struct DopRefit {
  const DopNode* nodes;
  std::uint32_t node_count;
  const std::uint32_t* points;  ///< of the leaves
  const S* positions;           ///< [point][3]
  const S* directions;          ///< [3][slabs]: components along x, y, z, each -1, 0 or 1
  const S* margins;             ///< [slabs]: margin by which both sides of a leaf move outwards
  S* sides;                     ///< [node][padded sides]
};

struct DopPair {
  std::uint32_t a, b;
};

/// The largest number of pairs that one step of a search puts on its stack: all pairs of eight children.
constexpr std::size_t dop_search_step = 36;

/// The traversal of two trees, or of one tree with itself. Pairs on the stack overlap. It pauses when `found`
/// is full, or the stack might become too small for the next step.
template <class S>
struct DopSearch {
  const DopNode *nodes_a, *nodes_b;
  const S *sides_a, *sides_b;
  bool within;  ///< both trees are one; each two leaves are found once, a leaf of several points with itself
  DopPair* stack;
  std::size_t depth, stack_room;
  DopPair* found;  ///< pairs of leaves
  std::size_t found_count, found_room;
  std::uint64_t tests, most_tests;  ///< it pauses once `tests` reaches `most_tests`
};

/// Functions for 16 and 32 padded sides.
template <class S>
struct DopKernels {
  using Refit = void (*)(const DopRefit<S>& job);
  using Search = void (*)(DopSearch<S>& job);
  using Overlap = bool (*)(const S* a, const S* b);
  Refit refit_padded[2];
  Search search_padded[2];
  Overlap overlap_padded[2];
  S (*reach)(const S* numbers, std::size_t count);  ///< the largest absolute value; 0 of none

  static constexpr std::size_t index(int sides) { return padded_sides(sides) == 16 ? 0 : 1; }
  Refit refit(int sides) const { return refit_padded[index(sides)]; }
  Search search(int sides) const { return search_padded[index(sides)]; }
  Overlap overlap(int sides) const { return overlap_padded[index(sides)]; }
};
KBVH_DECLARE_KERNELS(DopKernels<float>, dop_float)
KBVH_DECLARE_KERNELS(DopKernels<double>, dop_double)

/// Returns the kernels of one instruction set.
template <class S>
const DopKernels<S>& dop_kernels(KernelSet set);
template <>
const DopKernels<float>& dop_kernels(KernelSet set);
template <>
const DopKernels<double>& dop_kernels(KernelSet set);

}  // namespace kbvh
