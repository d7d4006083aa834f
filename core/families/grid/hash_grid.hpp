#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "core/families/build/curve_order.hpp"
#include "core/families/grid/kernels/grid.hpp"

namespace kbvh {

/// The boxes of one body's primitives, and the box of all.
template <class S>
class GridBody {
 public:
  /// Computes all boxes. O(corners).
  void update(const Primitives& primitives, const PrimitiveList& list, const S* positions, KernelSet kernels);
  std::uint32_t count() const { return boxes_.count(); }
  /// Returns the boxes, [primitive][8]: lower x, y, z, unused, upper x, y, z, unused.
  const S* boxes() const { return boxes_.boxes(); }
  /// Returns the box of all, in the same layout.
  const S* bound() const { return bound_; }
  Box<double> box() const;
  std::size_t bytes() const { return boxes_.bytes(); }

 private:
  CurveOrder<S> boxes_;
  S bound_[8] = {};
};

/// Finds the pairs of overlapping boxes of two bodies, or of one body, by a uniform grid in space that lasts
/// for one search. Only boxes that meet both bodies' boxes take part. Each box of one body is entered once,
/// into the cell of its lower corner, so that no pair is found twice and the boxes of consecutive cells along
/// x are one run of an array. A box looks up all cells in which a box that it meets can begin.
///
/// Boxes much larger than most have grids with larger cells of their own (up to 8 levels), as in a
/// hierarchical grid. Cells are numbered modulo powers of two (the hash), so that memory is proportional to
/// the number of boxes, for any size of space. Time is proportional to boxes and tests. Exact: boxes are
/// closed and compared as they are.
template <class S>
class HashGrid {
 public:
  /// `cell` is the size of the smallest cells over the mean of the boxes' longest sides.
  HashGrid(double cell, KernelSet kernels) : cell_(cell), kernels_(kernels) {}

  /// Calls `found(primitive of a, primitive of b)` for each two boxes that overlap, each pair once; if `a` is
  /// `b`, for each two different boxes, in either order. Adds the box tests made to `tests`.
  template <class Found>
  void search(const GridBody<S>& a, const PrimitiveList& list_a, const GridBody<S>& b,
              const PrimitiveList& list_b, std::uint64_t& tests, const Found& found) {
    if (!enter(a, list_a, b, list_b)) return;
    while (look_up(tests))
      for (const GridPair& pair : std::span(pairs_.data(), job_.found))
        a_is_entered_ ? found(pair.entered, pair.own) : found(pair.own, pair.entered);
  }

  std::size_t bytes() const;

 private:
  struct Selection {
    const S* boxes = nullptr;
    std::vector<std::uint32_t> primitives;
    std::vector<S> sizes;
    std::uint32_t count = 0;
    double size_sum = 0;
    std::size_t bytes() const {
      return primitives.capacity() * sizeof(std::uint32_t) + sizes.capacity() * sizeof(S);
    }
  };
  /// Returns false if nothing can overlap.
  bool enter(const GridBody<S>& a, const PrimitiveList& list_a, const GridBody<S>& b,
             const PrimitiveList& list_b);
  void select(const GridBody<S>& body, const PrimitiveList& list, Selection& selection);
  void plan_sizes(double mean_size);
  /// Returns the number of cells of all levels.
  std::uint32_t plan_cells();
  void fill(const Selection& entered);
  /// Returns whether there may be more pairs than the buffer currently holds.
  bool look_up(std::uint64_t& tests);

  double cell_;
  KernelSet kernels_;
  GridRegion<S> region_{};
  GridLevel<S> levels_[grid_levels] = {};
  Selection selections_[2];
  bool a_is_entered_ = false, within_ = false;
  std::vector<std::uint8_t> level_;
  std::vector<std::uint32_t> cell_of_, begins_, entries_;
  AlignedArray<S> rows_;
  GridLookUpJob<S> job_{};
  std::vector<GridPair> pairs_;
};

extern template class GridBody<float>;
extern template class GridBody<double>;
extern template class HashGrid<float>;
extern template class HashGrid<double>;

}  // namespace kbvh
