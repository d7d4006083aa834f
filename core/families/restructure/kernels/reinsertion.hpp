#pragma once
#include <cstddef>
#include <cstdint>

#include "core/families/wide/kernels/wide_layout.hpp"
#include "core/kernels/kernel_tables.hpp"

namespace kbvh {

enum class KernelSet : std::uint8_t;

/// The 8-wide tree in which subtrees are moved: child nodes lie in blocks of 8 numbers, one parent for each
/// block. Node 0 is the root.
template <class S>
struct ReinsertionTree {
  WideArrays<S> arrays;
  const std::uint32_t* block_parent;  ///< [node / 8]: the node above
};

/// A node that is still to be searched.
template <class S>
struct ReinsertionOpen {
  S path;     ///< growth of the nodes above and of this node
  S surface;  ///< half the surface of the grown node
  std::uint32_t node;
};

/// A search for the best place for one child of a node, with its whole subtree (Meister & Bittner 2018,
/// section 3.2, for wide nodes). The cost of a tree is the sum of half the surfaces of its nodes, and of
/// `lane_price` times as much for each child.
template <class S>
struct ReinsertionSearch {
  static constexpr std::uint32_t into = 8;  ///< as `target_lane`: a further child of `target`

  ReinsertionTree<S> tree;
  S lane_price;
  S least;                    ///< smallest gain that counts, in half surfaces of the node
  std::uint32_t most_visits;  ///< nodes whose children are compared
  ReinsertionOpen<S>* stack;  ///< room for 8 entries per level of the tree
  // The child; it is not an only child, nor one of the root's only two:
  std::uint32_t node, lane;
  // The result:
  S gain;                             ///< 0: no place is better
  std::uint32_t target, target_lane;  ///< next to that child, both children of a new node; or `into`
  std::uint32_t visits;
};

template <class S>
struct ReinsertionKernels {
  void (*search)(ReinsertionSearch<S>& job);
  /// Writes, for each child of a node, how much the half surface of the node shrinks without that child.
  void (*gains)(const WideArrays<S>& tree, std::uint32_t node, S* gains);
  /// Writes, for each of some nodes, how much its half surface exceeds that in `settled`: 0 where it does not
  /// exceed it by the factor `growth`. Returns the sum of the half surfaces.
  double (*growths)(const WideArrays<S>& tree, const std::uint32_t* nodes, std::uint32_t count,
                    const S* settled, S growth, S* scores);
  /// Computes the box of a node from the rows of its children, as [8]: lower x, y, z, unused, upper x, y, z,
  /// unused.
  void (*box)(const S* rows, S* box);
};
KBVH_DECLARE_KERNELS(ReinsertionKernels<float>, reinsertion_float)
KBVH_DECLARE_KERNELS(ReinsertionKernels<double>, reinsertion_double)

/// Returns the kernels of one instruction set.
template <class S>
const ReinsertionKernels<S>& reinsertion_kernels(KernelSet set);
template <>
const ReinsertionKernels<float>& reinsertion_kernels(KernelSet set);
template <>
const ReinsertionKernels<double>& reinsertion_kernels(KernelSet set);

}  // namespace kbvh
