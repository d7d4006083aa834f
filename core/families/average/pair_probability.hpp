#pragma once
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>

namespace kbvh {

/// The polygons of a node over a grid of 4 x 4 x 4 cells in its box, one bit per cell: whether the cell holds
/// any. Bit x + 4 y + 16 z.
using CellMask = std::uint64_t;
inline constexpr int cells_per_axis = 4;

/// How a probability uses the grid.
enum class Distribution : std::uint8_t {
  count,  ///< the number of filled cells, as if they were spread evenly over the box (the paper)
  cells,  ///< those in the overlap of the two boxes
};

/// The data of a node that the probability uses.
struct FilledBox {
  std::array<double, 3> lower, upper;
  CellMask filled;
  /// How well these cells are filled, on average: 1 where the polygons of a cell have at least the area that
  /// cuts it in two, and less in proportion to their area. (Klein & Zachmann 2003 count only cells that are
  /// well filled; where polygons are sparse there are none, and all pairs would be equal.)
  double amount = 1;
};

/// The probability that two planes meet within a ball, given that both hit it: pi^2 / 16 (Santalo 1976,
/// II.14). Stands for two pieces of surface that both cut one cell.
inline constexpr double planes_meet = 0.61685027506808487;

/// Estimates the probability that polygons of two nodes intersect, from their boxes, which overlap, and their
/// grids. Below, R is the overlap of the boxes, and a cell is one of the coarser grid.
///
///   P = 1 - (1 - planes_meet f_a w_a f_b w_b)^s
///   s     the number of cells in R
///   f_a   the share of the cells of a in R that are filled, times the amount
///   w_a   the probability that what cuts a cell of a also cuts R, where R is smaller: the quotient of their
///         mean widths, which for boxes are the sums of their edges (Cauchy)
///
/// The paper counts cells that are filled by both (hypergeometric: s cells, of which s f_a and s f_b are
/// filled), and assumes a certain intersection in each of them. Here the cells are independent, so that
/// fractions of cells count, too. O(1).
inline double probability_of_meeting(const FilledBox& a, const FilledBox& b, Distribution distribution) {
  struct Tables {
    // [axis][first cell][last cell]: the cells of the grid in that range on the axis
    CellMask range[3][cells_per_axis][cells_per_axis] = {};
    constexpr Tables() {
      for (int first = 0; first < cells_per_axis; ++first)
        for (int last = first; last < cells_per_axis; ++last)
          for (int cell = 0; cell < 64; ++cell) {
            const int at[3] = {cell % 4, cell / 4 % 4, cell / 16};
            for (int axis = 0; axis < 3; ++axis)
              if (at[axis] >= first && at[axis] <= last) range[axis][first][last] |= CellMask(1) << cell;
          }
    }
  };
  static constexpr Tables tables;
  double cells = 1;
  const FilledBox* const boxes[2] = {&a, &b};
  CellMask region[2] = {~CellMask(0), ~CellMask(0)};
  double edges[2] = {0, 0}, cut[2] = {0, 0};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double lower = std::max(a.lower[axis], b.lower[axis]),
                 upper = std::min(a.upper[axis], b.upper[axis]);
    const double length = upper - lower;
    double coarser = 0;
    for (int side = 0; side < 2; ++side) {
      const FilledBox& box = *boxes[side];
      const double cell = (box.upper[axis] - box.lower[axis]) / cells_per_axis;
      coarser = std::max(coarser, cell);
      edges[side] += cell;
      cut[side] += std::min(length, cell);
      if (!(cell > 0)) continue;
      const auto index = [&](double x) {
        return std::clamp(int((x - box.lower[axis]) / cell), 0, cells_per_axis - 1);
      };
      region[side] &= tables.range[axis][index(lower)][index(upper)];
    }
    if (coarser > 0) cells *= std::max(1.0, length / coarser);
  }
  double both = planes_meet;
  for (int side = 0; side < 2; ++side) {
    const CellMask within = distribution == Distribution::cells ? region[side] : ~CellMask(0);
    both *= boxes[side]->amount * double(std::popcount(boxes[side]->filled & within)) /
            double(std::popcount(within));
    if (edges[side] > 0) both *= cut[side] / edges[side];
  }
  return -std::expm1(cells * std::log1p(-both));
}

}  // namespace kbvh
