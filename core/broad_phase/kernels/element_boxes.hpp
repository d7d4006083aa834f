#pragma once
#include <cstddef>
#include <cstdint>

#include "core/families/wide/kernels/wide_layout.hpp"
#include "core/kernels/kernel_tables.hpp"

namespace kbvh {

enum class KernelSet : std::uint8_t;

/// Positions in the caller's memory: coordinate j of vertex v is data[v * row_step + j * column_step].
template <class S>
struct StridedPoints {
  const S* data;
  std::ptrdiff_t row_step, column_step;
};

/// The boxes of vertices, or a comparison with boxes that they had before.
template <class S>
struct VertexBoxesJob {
  StridedPoints<S> begin, end;    ///< the same twice, unless the vertices move on a segment
  const std::uint32_t* vertices;  ///< [k]: the k-th vertex of the job; null: k
  std::uint32_t count;
  S grown;                       ///< boxes grow by this on each side, rounded outward
  const S* grown_each;           ///< [vertex]: by this instead; null: all by `grown`
  S *begin_points, *end_points;  ///< [vertex][4]: written, the fourth number 0; the second may be null
  S* boxes;                      ///< [vertex][8]: written; lower x, y, z, unused, upper x, y, z, unused
  const S* allowed;  ///< [vertex][8]: boxes that must not be left; null: `boxes` are written instead
  // Written:
  bool inside;  ///< no box leaves its allowed one
  S room;       ///< smallest distance of a side from its allowed one, inwards; rounded to nearest
};

/// The boxes of elements of one number of corners, each around those of its vertices, for a build.
template <class S>
struct ElementBoxesJob {
  const S* vertex_boxes;         ///< [vertex][8]
  const std::uint32_t* corners;  ///< [element][corners_each]
  std::uint32_t corners_each;    ///< 1, 2 or 3
  const std::uint32_t* living;   ///< [k]: the k-th element of the job; null: k
  std::uint32_t count;           ///< not 0
  S* boxes;                      ///< [element][8]
  S* centres;                    ///< [axis][stride]: lower + upper of the k-th element
  std::size_t stride;            ///< a multiple of 4, at least `count`
  S* extent;                     ///< [8]: the smallest centre x, y, z, unused, and the largest
};

/// The boxes of leaves and of the elements in them, for a refit.
template <class S>
struct ElementLeafBoxesJob {
  const S* vertex_boxes;         ///< [vertex][8]
  const std::uint32_t* corners;  ///< [leaf][corners_each][padded]; lanes without an element repeat one
  std::uint32_t corners_each;    ///< 1, 2 or 3
  std::uint32_t padded;          ///< 8 or 16
  const std::uint32_t *first_entry, *end_entry;  ///< [leaf]
  std::uint32_t begin, end;                      ///< the leaves
  S* rows;                                       ///< [leaf][6][padded]: lower x, y, z, -upper x, y, z
  S* leaf_boxes;                                 ///< [leaf][8]
};

/// The nodes of an 8-wide tree above leaves whose boxes changed. Parents have smaller numbers than children.
template <class S>
struct DirtyNodesJob {
  WideArrays<S> tree;
  const S* leaf_boxes;           ///< [leaf][8]
  const std::uint32_t* parents;  ///< [node]
  std::uint64_t* dirty;          ///< a bit for each node; all are 0 afterwards
  std::size_t words;
  std::uint64_t remade;  ///< written: the number of nodes whose boxes were computed
};

template <class S>
struct ElementBoxKernels {
  void (*vertices)(VertexBoxesJob<S>& job);
  void (*elements)(const ElementBoxesJob<S>& job);
  void (*leaves)(const ElementLeafBoxesJob<S>& job);
  /// Computes the children's boxes of marked nodes, and of each parent whose child's box changed.
  void (*nodes)(DirtyNodesJob<S>& job);
};
KBVH_DECLARE_KERNELS(ElementBoxKernels<float>, element_boxes_float)
KBVH_DECLARE_KERNELS(ElementBoxKernels<double>, element_boxes_double)

/// Returns the kernels of one instruction set.
template <class S>
const ElementBoxKernels<S>& element_box_kernels(KernelSet set);
template <>
const ElementBoxKernels<float>& element_box_kernels(KernelSet set);
template <>
const ElementBoxKernels<double>& element_box_kernels(KernelSet set);

}  // namespace kbvh
