#pragma once
#include <cstdint>

#include "core/families/wide/kernels/wide_layout.hpp"
#include "core/kernels/kernel_tables.hpp"

namespace kbvh {

enum class KernelSet : std::uint8_t;

/// A ray in the form that the traversal reads: along each axis it enters a box at (row + add) * scale of one
/// of the six rows of the children's boxes, and leaves it at (row - add) * -scale of another.
template <class S>
struct WideRay {
  std::uint32_t enter_row[3], leave_row[3];
  S add[3], scale[3];
  S limit;  ///< nothing beyond this parameter can be the answer
  // For the filter of triangles, which looks along an axis in which the direction is largest.
  std::uint32_t axes[3];  ///< the two others in cyclic order, and this axis
  S origin[3];            ///< in the order of `axes`
  S shear[2];             ///< the direction's components along axes[0] and axes[1] over that along axes[2]
  S steepness;            ///< magnitude of the direction along axes[2]; 0: the ray is a point
  S sign;                 ///< 1 or -1: that of the direction along axes[2]
};

/// Says whether a leaf's corners were copied.
struct WideLeafCopy {
  std::uint32_t stamp = 0;
  std::uint32_t unusual = 0;  ///< bit k: entry k is no triangle, and its copy is of its first corner only
};

/// A node, or with `WidePair::leaf_bit` a leaf, numbered as by `WideNode::first_leaf`; and the parameter at
/// which the ray enters it.
template <class S>
struct WideRayItem {
  S near;
  std::uint32_t item;
};

/// One ray in one hierarchy: a traversal that can pause and resume; the caller provides memory.
template <class S>
struct WideRayJob {
  WideRay<S>* ray;
  WideArrays<S> tree;
  const std::uint32_t* first_entry;  ///< [leaf], as in WideLeafLists
  const std::uint32_t* end_entry;    ///< [leaf]
  const std::uint32_t* entries;      ///< the primitives of leaves
  /// Primitive p has the corners vertices[offsets[p] .. offsets[p + 1]); null: entries are decided without a
  /// filter.
  const std::uint32_t* offsets;
  const std::uint32_t* vertices;
  /// [entry][3]: corners of the entries' primitives, times 3; null: they are found by offsets and vertices.
  const std::uint32_t* triangle_corners;
  const S* positions;  ///< [vertex][3], one scalar past the end
  /// Entries of leaves, padded to 4, 8 or 16: numbers in a row of copied corners.
  std::uint32_t row;
  /// [leaf][corner][axis][row]: the corners of leaves that a ray has reached, copied at the first one; null:
  /// each ray reads them from `positions`.
  S* copied;
  WideLeafCopy* copies;       ///< [leaf]
  std::uint32_t stamp;        ///< of the copies that are current
  const std::uint8_t* stale;  ///< [node]: not 0 while its children's boxes must be made; null: none
  WideRayItem<S>* stack;
  std::size_t depth, room;
  void* context;
  void (*make)(void* context, std::uint32_t node);  ///< makes the boxes of a node's children
  /// Decides a primitive; may lower the limit; true ends the search. `corners`, [3][3], are those of a
  /// triangle; null: they have not been read.
  bool (*decide)(void* context, std::uint32_t primitive, const S* corners);
  std::uint64_t tests;
  bool over;
};
/// The largest number of items that one step may push.
inline constexpr std::size_t max_items_per_step = 8;

/// Rays side by side, for a test without branches of many against few boxes.
template <class S>
struct WideRayBlock {
  static constexpr std::size_t size = 64;
  alignas(64) S origin[3][size], direction[3][size], length[size];
};

/// Rays of a block that enter each box through the same sides, to be followed together.
template <class S>
struct WideRayPacket {
  static constexpr std::size_t size = WideRayBlock<S>::size;
  /// As in `WideRay`, and finite. A negative limit: the ray is not followed, or its search has ended.
  alignas(64) S add[3][size], scale[3][size], limit[size];
  S least_add[3], most_add[3], least_scale[3], most_scale[3];
  std::uint32_t enter_row[3], leave_row[3];
  std::uint32_t searching;  ///< the number of rays without a negative limit
  WideRay<S>* rays;         ///< [size]
};

/// A node or a leaf as in `WideRayItem`, and where its box is.
template <class S>
struct WidePacketItem {
  static constexpr std::uint32_t no_box = ~std::uint32_t(0);
  S near;  ///< no ray enters it before
  std::uint32_t item;
  std::uint32_t box;  ///< 8 * parent + lane; no_box: all rays enter it
};

/// A packet in one hierarchy: a traversal that can pause and resume.
template <class S>
struct WidePacketJob {
  WideRayJob<S>* single;  ///< for the rays one by one
  WideRayPacket<S>* packet;
  WidePacketItem<S>* stack;
  std::size_t depth, room;
  std::uint64_t alone;  ///< set on return: rays that go on alone
  std::uint32_t item;   ///< from this item
};

/// Follows rays, nearer children first. Boxes are closed and tested conservatively: an item is left out only
/// if the ray certainly misses its box within the limit. A filter leaves out primitives of three corners that
/// the ray certainly misses; the caller decides all others.
template <class S>
struct WideRayKernels {
  /// Continues until the stack is empty, the search has ended, or a step might exceed the free space.
  using Follow = void (*)(WideRayJob<S>& job);
  Follow width2, width4, width8;
  Follow follow(std::uint32_t width) const { return width == 2 ? width2 : width == 4 ? width4 : width8; }
  /// Follows the rays of a packet until the stack is empty, a step might exceed the free space, or so few
  /// rays enter a node that they are faster one by one.
  using Together = void (*)(WidePacketJob<S>& job);
  Together together2, together4, together8;
  Together together(std::uint32_t width) const {
    return width == 2 ? together2 : width == 4 ? together4 : together8;
  }
  /// Returns bit i unless ray i of a block certainly misses all of the first `count` boxes of a node of
  /// width 8.
  using Screen = std::uint64_t (*)(const WideRayBlock<S>& rays, const S* child_bounds, std::uint32_t count);
  Screen screen;
};
KBVH_DECLARE_KERNELS(WideRayKernels<float>, wide_rays_float)
KBVH_DECLARE_KERNELS(WideRayKernels<double>, wide_rays_double)

/// Returns the kernels of one instruction set.
template <class S>
const WideRayKernels<S>& wide_ray_kernels(KernelSet set);
template <>
const WideRayKernels<float>& wide_ray_kernels(KernelSet set);
template <>
const WideRayKernels<double>& wide_ray_kernels(KernelSet set);

}  // namespace kbvh
