#pragma once
#include <cstddef>
#include <cstdint>

#include "core/kernels/kernel_tables.hpp"

namespace kbvh {

enum class KernelSet : std::uint8_t;

/// A part of space; the fourth numbers are 0.
template <class S>
struct GridRegion {
  S lower[4], upper[4];
};

/// The primitives whose boxes meet a region. Boxes are [primitive][8]: lower x, y, z, unused, upper x, y, z,
/// unused.
template <class S>
struct GridSelectJob {
  const S* boxes;
  const std::uint32_t* ids;  ///< [count]; null: all numbers below `count`
  std::uint32_t count;
  GridRegion<S> region;
  std::uint32_t* selected;  ///< room for one more than `count`
  S* sizes;                 ///< [selected]: longest side of the box; as much room
  std::uint32_t found;
  double size_sum;
};

inline constexpr std::uint32_t grid_levels = 8;

/// The cells for boxes of similar size. Numbers of cells along an axis are taken modulo a power of two, so
/// that the array of cells stays small, however far the region extends.
template <class S>
struct GridLevel {
  S most_size;          ///< the longest side of a box of this level; infinite for the last level
  S scale;              ///< cells per unit
  S reach[4];           ///< at least the longest side of any box of this level, along each axis
  std::uint32_t count;  ///< of boxes
  std::uint32_t end;    ///< one past the place of the level's last box
  std::uint32_t first_cell;
  std::uint32_t bits[3];  ///< log2 of the number of cells along x, y, z
};

/// Boxes that are put into levels, then into cells.
template <class S>
struct GridCellsJob {
  const S* boxes;
  const std::uint32_t* selected;
  const S* sizes;
  std::uint32_t count;
  GridRegion<S> region;
  GridLevel<S>* levels;   ///< [grid_levels]
  std::uint8_t* level;    ///< [selected]
  std::uint32_t* cell;    ///< [selected]
  std::uint32_t* counts;  ///< [cell], added to
};

/// Two primitives whose boxes overlap: one that was looked up, and one in the grid.
struct GridPair {
  std::uint32_t own, entered;
};

/// A search for the boxes that meet boxes in a grid; can pause and resume.
template <class S>
struct GridLookUpJob {
  const S* boxes;
  const std::uint32_t* ids;
  std::uint32_t count, next;
  GridRegion<S> region;
  const GridLevel<S>* levels;
  std::uint32_t level_count;
  const std::uint32_t* begins;   ///< [cell, and one more]: place of its first box
  const std::uint32_t* entries;  ///< [place]: primitive
  const S* rows;  ///< [6][stride]: lower x, y, z, upper x, y, z, by place; 16 more than entries readable
  std::size_t stride;
  GridPair* out;
  std::size_t found, out_room;  ///< room for at least as many pairs as there are entries
  std::uint64_t tests;
};

template <class S>
struct GridKernels {
  /// Computes the box of all boxes, [8]. `count` is not 0.
  void (*bound)(const S* boxes, const std::uint32_t* ids, std::uint32_t count, S* box);
  void (*select)(GridSelectJob<S>& job);
  /// Sets `level`, and `count` and `reach` of the levels, whose `most_size` ascend.
  void (*measure)(const GridCellsJob<S>& job);
  /// Sets `cell`, that of a box's lower corner, and adds to `counts`.
  void (*cells)(const GridCellsJob<S>& job);
  /// Continues until all boxes are looked up, or `out` might not have room for the next one's pairs.
  void (*between)(GridLookUpJob<S>& job);
  /// Does the same if `ids` are the entries: each two different boxes once.
  void (*within)(GridLookUpJob<S>& job);
};
KBVH_DECLARE_KERNELS(GridKernels<float>, grid_float)
KBVH_DECLARE_KERNELS(GridKernels<double>, grid_double)

/// Returns the kernels of one instruction set.
template <class S>
const GridKernels<S>& grid_kernels(KernelSet set);
template <>
const GridKernels<float>& grid_kernels(KernelSet set);
template <>
const GridKernels<double>& grid_kernels(KernelSet set);

}  // namespace kbvh
