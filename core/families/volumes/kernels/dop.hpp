#pragma once
#include <cstddef>
#include <cstdint>

#include "core/kernels/kernel_tables.hpp"

namespace kbvh {

enum class KernelSet : std::uint8_t;

/// The sides of a k-DOP as they are stored: for each slab the largest n . p, then for each slab the largest
/// -n . p. The slabs of each half are padded to a multiple of four by slabs of direction 0, whose sides are
/// 0.
constexpr std::size_t padded_slabs(int sides) {
  return (std::size_t(sides / 2) + 3) / 4 * 4;
}
constexpr std::size_t padded_sides(int sides) {
  return 2 * padded_slabs(sides);
}

/// A node, as in Topology: children or leaf content.
struct DopNode {
  std::uint32_t first;  ///< the first child; of a leaf, the first entry in its list of points
  std::uint32_t end;    ///< one past the last; parents precede their children
  bool leaf;
};

/// A k-DOP per node, computed from points. `coefficients` has three rows of padded sides: the components of
/// the sides' directions along x, y, z, each -1, 0 or 1.
template <class S>
struct DopRefit {
  const DopNode* nodes;
  std::uint32_t node_count;
  const std::uint32_t* points;  ///< of the leaves
  const S* positions;           ///< [point][3]
  const S* coefficients;        ///< [3][padded sides]
  const S*
      two_terms;  ///< [padded sides]: 2^-23 (float) or 2^-52 for directions of two or three terms, else 0
  const S* three_terms;  ///< [padded sides]: the same for directions of three terms, else 0
  S* sides;              ///< [node][padded sides]
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

/// Functions for 14, 18 and 26 sides.
template <class S>
struct DopKernels {
  using Refit = void (*)(const DopRefit<S>& job);
  using Search = void (*)(DopSearch<S>& job);
  using Overlap = bool (*)(const S* a, const S* b);
  Refit refit_sides[3];
  Search search_sides[3];
  Overlap overlap_sides[3];

  static constexpr std::size_t index(int sides) { return sides == 14 ? 0 : sides == 18 ? 1 : 2; }
  Refit refit(int sides) const { return refit_sides[index(sides)]; }
  Search search(int sides) const { return search_sides[index(sides)]; }
  Overlap overlap(int sides) const { return overlap_sides[index(sides)]; }
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
