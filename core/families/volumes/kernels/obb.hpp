#pragma once
#include <cstddef>
#include <cstdint>

#include "core/families/volumes/kernels/lane_pair.hpp"
#include "core/kernels/kernel_tables.hpp"

namespace kbvh {

/// The numbers of an oriented box: centre, three axes, and the half extents along them; boxes of nodes have
/// one more.
inline constexpr std::size_t obb_rows = 15, obb_own = 16;

/// Oriented boxes of one tree, computed from points: each contains the points below its node. A node's rows
/// are the numbers of its children, eight lanes each; lanes without a child repeat the first child.
template <class S>
struct ObbRefit {
  const WideNode* nodes;
  std::uint32_t node_count;
  const std::uint32_t* lists;  ///< [list][length][8]: points of leaves, times 3
  const S* positions;          ///< [point][3]
  S* scratch;                  ///< [longest list][3][8]
  S* rows;                     ///< [node][15][8]
  S* own;                      ///< [node][16]: the node's own box
  // Frames: the axes are the direction from the first to the second of three points, the normal to it in the
  // plane of the third, and the normal of the plane.
  const std::uint32_t* leaf_frames;  ///< [node][3][8]: points of leaves, times 3, in the places of lists
  const std::uint32_t* node_frames;  ///< [node / 8][3][8]: the same for the nodes' own boxes
  S* node_axes;                      ///< [node / 8][9][8]
  const std::uint32_t* points;       ///< times 3, a multiple of eight of them
  std::size_t point_count;
  const std::uint32_t* ranges;  ///< [node][2]: begin and end of the points below
  S* coordinates;               ///< [3][point_count]
  bool turn;                    ///< false: the axes in `rows` and `node_axes` stay as they are
};

template <class S>
struct ObbKernels {
  void (*refit)(const ObbRefit<S>& job);
  /// Continues a traversal (WideTraversal); `within`: of a tree with itself.
  void (*traverse)(const LanePair<S>& pair, WideTraversal& state);
  void (*within)(const LanePair<S>& pair, WideTraversal& state);
  /// Returns false only if two boxes (15 numbers each) have no common point.
  bool (*overlap)(const S* a, const S* b);
};
KBVH_DECLARE_KERNELS(ObbKernels<float>, obb_float)
KBVH_DECLARE_KERNELS(ObbKernels<double>, obb_double)

/// Returns the kernels of one instruction set.
template <class S>
const ObbKernels<S>& obb_kernels(KernelSet set);
template <>
const ObbKernels<float>& obb_kernels(KernelSet set);
template <>
const ObbKernels<double>& obb_kernels(KernelSet set);

}  // namespace kbvh
