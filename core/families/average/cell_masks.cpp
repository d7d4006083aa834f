#include "core/families/average/cell_masks.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace kbvh {

template <class S>
void CellMasks<S>::assign(WideHierarchy<S>& hierarchy) {
  const std::size_t slots = std::size_t(8) * hierarchy.node_count();
  masks_.assign(slots, 0);
  amounts_.assign(slots, 0);
  areas_.assign(64 * slots, 0);
  parent_.assign(hierarchy.node_count(), none);
  const WideNode* const nodes = hierarchy.arrays().nodes;
  for (std::uint32_t wide = 0; wide < parent_.size(); ++wide)
    for (std::uint32_t lane = nodes[wide].leaf_count; lane < nodes[wide].count; ++lane)
      parent_[nodes[wide].first_child + lane - nodes[wide].leaf_count] = 8 * wide + lane;
}

template <class S>
auto CellMasks<S>::grid_of(const S* rows, std::uint32_t width, std::uint32_t slot) -> Grid {
  const S* const row = rows + slot / 8 * lane_scalars(width) + slot % 8;
  Grid grid;
  for (std::uint32_t axis = 0; axis < 3; ++axis) {
    grid.lower[axis] = row[axis * width];
    const S extent = -row[(axis + 3) * width] - grid.lower[axis];
    grid.scale[axis] = extent > 0 ? S(cells_per_axis) / extent : S(0);
    if (!std::isfinite(grid.scale[axis])) grid.scale[axis] = 0;
  }
  grid.areas = areas_.data() + std::size_t(64) * slot;
  return grid;
}

/// Adds the area of a triangle, cut into cuts^2 equal triangles, to the cells of their centroids.
template <class S>
void CellMasks<S>::add_triangle(const Grid& grid, int cuts, const S* const (&corners)[3], float area) {
  const S step = S(1) / S(3 * cuts);
  // A cell that holds a polygon is filled, however small (or not a number) the computed area is.
  const float share = std::max(std::numeric_limits<float>::min(), area / float(cuts * cuts));
  for (int i = 0; i < cuts; ++i)
    for (int j = 0; j < cuts - i; ++j)
      for (int up = 0; up < (i + j + 1 < cuts ? 2 : 1); ++up) {
        // Upright triangles: the corner of least coordinates plus a third; the other triangles lie between
        // upright ones.
        const S u = S(3 * i + 1 + up) * step, v = S(3 * j + 1 + up) * step, w = 1 - u - v;
        S x[3];
        for (int axis = 0; axis < 3; ++axis)
          x[axis] = w * corners[0][axis] + u * corners[1][axis] + v * corners[2][axis];
        grid.areas[grid.cell_of(x)] += share;
      }
}

template <class S>
void CellMasks<S>::sample(WideHierarchy<S>& hierarchy, const Primitives& primitives, const S* positions) {
  if (hierarchy.empty()) return;
  constexpr float certain = 1e30f;  // an area that fills every cell
  const std::uint32_t width = hierarchy.topology().width;
  const WideArrays<S> arrays = hierarchy.arrays();
  const bool has_area = primitives.kind == PrimitiveKind::polygons;
  std::fill(areas_.begin(), areas_.end(), 0.0f);
  for (std::uint32_t wide = 0; wide < parent_.size(); ++wide)
    for (std::uint32_t lane = 0; lane < arrays.nodes[wide].leaf_count; ++lane) {
      int cuts = 4;
      for (std::uint32_t slot = 8 * wide + lane; slot != none;
           slot = parent_[slot / 8], cuts = std::max(1, cuts / 2)) {
        const Grid grid = grid_of(arrays.child_bounds, width, slot);
        for (const std::uint32_t primitive :
             hierarchy.leaf_primitives(arrays.nodes[wide].first_leaf + lane)) {
          const auto corners = primitives[primitive];
          if (!has_area || corners.size() < 3) {
            for (const std::uint32_t v : corners)
              grid.areas[grid.cell_of(positions + std::size_t(3) * v)] += certain;
            continue;
          }
          const PolygonTriangles triangles = primitives.triangles(primitive);
          for (std::uint32_t i = 0; i < triangles.count(); ++i) {
            const auto vertices = triangles[i];
            const S* const triangle[3] = {positions + std::size_t(3) * vertices[0],
                                          positions + std::size_t(3) * vertices[1],
                                          positions + std::size_t(3) * vertices[2]};
            S edge[2][3];
            for (int axis = 0; axis < 3; ++axis)
              for (int e = 0; e < 2; ++e) edge[e][axis] = triangle[e + 1][axis] - triangle[0][axis];
            const S normal[3] = {edge[0][1] * edge[1][2] - edge[0][2] * edge[1][1],
                                 edge[0][2] * edge[1][0] - edge[0][0] * edge[1][2],
                                 edge[0][0] * edge[1][1] - edge[0][1] * edge[1][0]};
            const S squares = normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2];
            add_triangle(grid, cuts, triangle, float(std::sqrt(squares) / 2));
          }
        }
      }
    }
  for (std::uint32_t slot = 0; slot < slots(); ++slot) {
    masks_[slot] = 0;
    if (slot % 8 >= arrays.nodes[slot / 8].count) continue;
    const S* const row = arrays.child_bounds + slot / 8 * lane_scalars(width) + slot % 8;
    float edges[3];
    for (std::uint32_t axis = 0; axis < 3; ++axis)
      edges[axis] = float(-row[(axis + 3) * width] - row[axis * width]) / float(cells_per_axis);
    std::sort(edges, edges + 3);
    // The smallest plane that cuts a cell has the area of its smallest face.
    const float face = edges[0] * edges[1];
    const float* const areas = areas_.data() + std::size_t(64) * slot;
    float cells = 0, amount = 0;
    for (std::uint32_t cell = 0; cell < 64; ++cell) {
      if (!(areas[cell] > 0)) continue;
      masks_[slot] |= CellMask(1) << cell;
      amount += areas[cell] < face ? areas[cell] / face : 1.0f;
      ++cells;
    }
    amounts_[slot] = cells > 0 ? amount / cells : 0.0f;
  }
}

template class CellMasks<float>;
template class CellMasks<double>;

}  // namespace kbvh
