#pragma once
#include <cstddef>
#include <cstdint>

#include "core/families/volumes/kernels/lane_pair.hpp"
#include "core/kernels/kernel_tables.hpp"

namespace kbvh {

/// Spheres of one tree, computed from points. A node's rows are the centres' x, y, z and the radii of its
/// children, eight lanes each; lanes without a child repeat the first child.
template <class S>
struct SphereRefit {
  const WideNode* nodes;
  std::uint32_t node_count;
  const std::uint32_t* lists;  ///< [list][length][8]: points of leaves, times 3
  const S* positions;          ///< [point][3]
  S* scratch;                  ///< [longest list][3][8]
  S* rows;                     ///< [node][4][8]
  S* own;                      ///< [node][4]: the node's own sphere
  S* boxes;                    ///< [node][8]: its own box, lower x, y, z, unused, upper x, y, z, unused
  S least;                     ///< added to radii: more than squares can lose by underflow
  // For spheres that bound the points below a node:
  const std::uint32_t* points;  ///< times 3, a multiple of eight of them
  std::size_t point_count;
  const std::uint32_t* ranges;  ///< [node][2]: begin and end of the points below
  S* coordinates;               ///< [3][point_count]
};

template <class S>
struct SphereKernels {
  /// Centres are those of the boxes around the points below. Squares must not overflow.
  /// `wrapped`: a node's sphere reaches to the furthest point below.
  /// `layered`: it reaches the furthest sphere of a child or the furthest corner of the box, whichever is
  /// less.
  void (*wrapped)(const SphereRefit<S>& job);
  void (*layered)(const SphereRefit<S>& job);
  /// Continues a traversal (WideTraversal); `within`: of a tree with itself.
  void (*traverse)(const LanePair<S>& pair, WideTraversal& state);
  void (*within)(const LanePair<S>& pair, WideTraversal& state);
  /// Returns false only if two spheres (centre, radius) have no common point.
  bool (*overlap)(const S* a, const S* b);
};
KBVH_DECLARE_KERNELS(SphereKernels<float>, sphere_float)
KBVH_DECLARE_KERNELS(SphereKernels<double>, sphere_double)

/// Returns the kernels of one instruction set.
template <class S>
const SphereKernels<S>& sphere_kernels(KernelSet set);
template <>
const SphereKernels<float>& sphere_kernels(KernelSet set);
template <>
const SphereKernels<double>& sphere_kernels(KernelSet set);

}  // namespace kbvh
