#pragma once
#include <cstdint>
#include <vector>

#include "core/families/average/pair_probability.hpp"
#include "core/families/wide/wide_hierarchy.hpp"

namespace kbvh {

/// The grids of all nodes of a wide hierarchy, by slot: 8 * wide node + lane of the node's box there.
///
/// A grid is relative to its box, so it stays right while the polygons of a node only move, turn by right
/// angles and stretch along the axes; any other deformation gradually invalidates it. `sample` makes all
/// grids from scratch.
template <class S>
class CellMasks {
 public:
  /// Takes the shape of a hierarchy. Allocates.
  void assign(WideHierarchy<S>& hierarchy);
  /// Makes the grids from the boxes of the hierarchy, which must be current, and the primitives at
  /// `positions`. Polygons are sampled: 16 points in the grid of a leaf, 4 in that above, 1 in all others.
  /// Points and control nets fill the cells of their vertices. O(primitives x depth).
  void sample(WideHierarchy<S>& hierarchy, const Primitives& primitives, const S* positions);

  CellMask of(std::uint32_t slot) const { return masks_[slot]; }
  /// Returns how well the cells are filled (FilledBox).
  float amount(std::uint32_t slot) const { return amounts_[slot]; }
  std::uint32_t slots() const { return std::uint32_t(masks_.size()); }
  std::size_t bytes() const {
    return masks_.capacity() * sizeof(CellMask) + (areas_.capacity() + amounts_.capacity()) * sizeof(float) +
           parent_.capacity() * sizeof(std::uint32_t);
  }

 private:
  static constexpr std::uint32_t none = ~std::uint32_t(0);
  /// The grid of a slot, to find cells in.
  struct Grid {
    S lower[3], scale[3];
    float* areas;
    std::uint32_t cell_of(const S* x) const {
      std::uint32_t cell = 0;
      for (int axis = 2; axis >= 0; --axis) {
        const int at = int((x[axis] - lower[axis]) * scale[axis]);
        cell = 4 * cell + std::uint32_t(at < 0 ? 0 : at > 3 ? 3 : at);
      }
      return cell;
    }
  };
  Grid grid_of(const S* rows, std::uint32_t width, std::uint32_t slot);
  void add_triangle(const Grid& grid, int cuts, const S* const (&corners)[3], float area);

  std::vector<CellMask> masks_;        ///< [slot]
  std::vector<float> amounts_;         ///< [slot]
  std::vector<float> areas_;           ///< [slot][cell], while sampling
  std::vector<std::uint32_t> parent_;  ///< [wide node]: the slot of its own box; none for the root
};

extern template class CellMasks<float>;
extern template class CellMasks<double>;

}  // namespace kbvh
