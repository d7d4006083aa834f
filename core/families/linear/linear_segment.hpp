#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "core/families/slabs/kernels/slab_spans.hpp"
#include "core/families/wide/kernels/wide_linear.hpp"
#include "core/families/wide/wide_hierarchy.hpp"

namespace kbvh {

/// Boxes of one body at one end of a segment, with their positions.
template <class S>
struct EndpointBounds {
  const S *child_bounds = nullptr, *node_bounds = nullptr;  ///< as in WideArrays
  const S* positions = nullptr;                             ///< [vertex][3]
  std::uint32_t slot = 0;  ///< index into LinearBody::rows of the data made from the positions
  std::uint32_t made = 0;  ///< a number that identifies the positions
  /// Upper bound on the excess of a box's side over the tight box, relative to the largest coordinate that
  /// the side has had since it was tight.
  S excess = 0;
};

/// A body with linear bounds: its topology, and memory for three ends, those of the current segment and of
/// the next one.
template <class S>
struct LinearBody {
  static constexpr std::uint32_t slots = 3;
  WideHierarchy<S> hierarchy;  ///< its boxes are free for temporary use
  /// The same tree over two points for each vertex, those that bound its curve; empty for bodies without
  /// curves.
  WideHierarchy<S> hulls;
  UnfilledArray<S> child_bounds[slots], node_bounds[slots];
  std::vector<S> room[slots];  ///< for positions that are not stored elsewhere
  /// Rows of the leaves that a join visited, with stamps of their positions.
  UnfilledArray<S> rows[slots];
  std::vector<std::uint32_t> stamps[slots];
  std::uint32_t made = 0;  ///< number of ends made so far
  /// Corners of the leaves that a join with slabs visited, with stamps of their positions.
  UnfilledArray<S> blocks[slots];
  std::vector<std::uint32_t> block_stamps[slots];
  UnfilledArray<SpanSlab<S>> slabs;  ///< [leaf]
  std::vector<std::uint32_t> slab_stamps;
  std::uint32_t slab_stamp = 0, slab_ends[2] = {0, 0};  ///< of the last requested segment, and its `made`

  WideLinearLeaves<S> leaves(const EndpointBounds<S>& first, const EndpointBounds<S>& last) {
    const std::size_t count = hierarchy.leaf_count();
    for (const std::uint32_t slot : {first.slot, last.slot}) {
      rows[slot].resize(count * lane_scalars(std::max(4u, hierarchy.padded_leaf_size())));
      stamps[slot].resize(count, 0);
    }
    return {hierarchy.leaf_lists(),
            {rows[first.slot].data(), rows[last.slot].data()},
            {stamps[first.slot].data(), stamps[last.slot].data()},
            {first.made, last.made},
            {first.positions, last.positions}};
  }
  /// Returns the corresponding data for slabs, of a body of triangles.
  SlabSpanLeaves<S> slab_leaves(const EndpointBounds<S>& first, const EndpointBounds<S>& last) {
    const std::size_t count = hierarchy.leaf_count();
    for (const std::uint32_t slot : {first.slot, last.slot}) {
      blocks[slot].resize(count * SpanBlock::scalars(std::max(4u, hierarchy.padded_leaf_size())));
      block_stamps[slot].resize(count, 0);
    }
    slabs.resize(count);
    slab_stamps.resize(count, 0);
    if (slab_ends[0] != first.made || slab_ends[1] != last.made) {
      slab_ends[0] = first.made;
      slab_ends[1] = last.made;
      ++slab_stamp;
    }
    return {hierarchy.leaf_lists(),
            {blocks[first.slot].data(), blocks[last.slot].data()},
            {block_stamps[first.slot].data(), block_stamps[last.slot].data()},
            {first.made, last.made},
            {first.positions, last.positions},
            slabs.data(),
            slab_stamps.data(),
            slab_stamp};
  }
  std::size_t bytes() const {
    std::size_t total = hierarchy.bytes() + hulls.bytes() + slabs.size() * sizeof(SpanSlab<S>) +
                        slab_stamps.size() * sizeof(std::uint32_t);
    for (std::uint32_t slot = 0; slot < slots; ++slot)
      total += (child_bounds[slot].size() + node_bounds[slot].size() + room[slot].capacity() +
                rows[slot].size() + blocks[slot].size()) *
                   sizeof(S) +
               (stamps[slot].size() + block_stamps[slot].size()) * sizeof(std::uint32_t);
    return total;
  }
};

/// One body over a segment.
template <class S>
struct BodySegmentBounds {
  LinearBody<S>* body = nullptr;
  EndpointBounds<S> at[2];  ///< the same at both ends for a body at rest
  bool at_rest = false, current = false;
  bool on_curves = false;  ///< boxes contain points of `hulls`, for this segment alone
  /// The body meets no other body's box over this segment; only its root's box is read.
  bool apart = false;
  S rounding = unit_rounding<S>;  ///< as in WideEnds

  WideHierarchy<S>& hierarchy() const { return body->hierarchy; }
  WideEnds<S> ends() const {
    return {{at[0].child_bounds, at[1].child_bounds}, {at[0].node_bounds, at[1].node_bounds}, rounding};
  }
  WideLinearLeaves<S> leaves() const { return body->leaves(at[0], at[1]); }
  SlabSpanLeaves<S> slab_leaves() const { return body->slab_leaves(at[0], at[1]); }
  Box<S> box_at(std::uint32_t end, std::uint32_t node) const {
    return hierarchy().box_in(at[end].child_bounds, at[end].node_bounds, node);
  }
  /// Interpolates a box between the ends at a fraction of the segment, without the margin.
  Box<double> box_between(std::uint32_t node, double fraction) const {
    const Box<S> first = box_at(0, node), last = box_at(1, node);
    Box<double> box;
    for (int axis = 0; axis < 3; ++axis) {
      const double low = double(first.lower[axis]), high = double(first.upper[axis]);
      box.lower[axis] = low + fraction * (double(last.lower[axis]) - low);
      box.upper[axis] = high + fraction * (double(last.upper[axis]) - high);
    }
    return box;
  }
  /// Returns a side, moved outwards by the largest rounding error at an end of the segment: of the side, of
  /// the line of a vertex below it, and of a position on that line (WideEnds).
  S widened_down(S side) const { return side - end_margin(side); }
  S widened_up(S side) const { return side + end_margin(side); }
  /// Interpolates a box between the ends, moved outwards like the boxes that kernels compute.
  Box<double> widened_between(std::uint32_t node, double fraction) const {
    Box<double> box = box_between(node, fraction);
    const Box<S> first = box_at(0, node), last = box_at(1, node);
    const auto margin = [this](double x0, double x1) {
      return double(rounding + 2 * unit_rounding<S>) * std::abs(x0) +
             double(rounding + 8 * unit_rounding<S>) * std::abs(x1 - x0) + double(least_margin<S>);
    };
    for (int axis = 0; axis < 3; ++axis) {
      box.lower[axis] -= margin(first.lower[axis], last.lower[axis]);
      box.upper[axis] += margin(first.upper[axis], last.upper[axis]);
    }
    return box;
  }

 private:
  /// Half a unit of rounding for the position on the line, and one and a half for those of this function.
  S end_margin(S side) const { return (rounding + 4 * unit_rounding<S>)*std::abs(side) + least_margin<S>; }
};

/// All bodies of a scene over a segment in which every vertex stays on one line.
template <class S>
struct LinearSegment {
  double begin = 0, end = 0;  ///< the end may be infinite if nothing moves
  std::vector<BodySegmentBounds<S>> sides;
  /// Indices of the scene's pairs of bodies that meet within the segment, ascending; all pairs if there are
  /// few.
  std::vector<std::uint32_t> near_pairs;

  /// Returns the position of a time in the segment, from 0 to 1.
  S fraction(double t) const {
    if (!(end > begin) || end == std::numeric_limits<double>::infinity()) return 0;
    return std::clamp(S((t - begin) / (end - begin)), S(0), S(1));
  }
};

}  // namespace kbvh
