#pragma once
#include "core/families/wide/kernels/wide_layout.hpp"
#include "core/kernels/kernel_tables.hpp"

namespace kbvh {

enum class KernelSet : std::uint8_t;

/// A check of a hierarchy whose leaf boxes were inflated by a margin: which boxes still contain their
/// vertices, with how much room, and which must be recomputed.
template <class S>
struct MarginCheck {
  WideArrays<S> hierarchy;
  std::uint32_t node_count;
  const S* positions;    ///< [vertex][3], with one readable number after the last vertex
  std::uint8_t* remade;  ///< [node]: written; 1 if the node's own box was changed
  S margin;              ///< leaf boxes are inflated by this on every side, rounded to nearest
  /// The leaves of a node stay unchanged if the room of all their sides is within these limits: their
  /// vertices moved by at most the difference to the margin. If keep_from is infinite, none stay.
  S keep_from, keep_to;
  /// The smallest room of all leaves after the check: the smallest distance of any side of a stored box from
  /// the vertices in it. Rounded to nearest.
  S room;
  S room_before;  ///< the smallest room before the check; negative if a vertex had left its box
  std::uint64_t leaf_boxes, inner_boxes;  ///< number of recomputed boxes
};

template <class S>
struct WideInflateKernels {
  /// Updates boxes, leaves first, and changes only boxes that must change. O(nodes + vertices of leaves).
  using CheckMargins = void (*)(MarginCheck<S>& check);
  CheckMargins width2, width4, width8;
  CheckMargins of(std::uint32_t width) const { return width == 2 ? width2 : width == 4 ? width4 : width8; }
};
KBVH_DECLARE_KERNELS(WideInflateKernels<float>, wide_inflate_float)
KBVH_DECLARE_KERNELS(WideInflateKernels<double>, wide_inflate_double)

/// Returns the kernels of one instruction set.
template <class S>
const WideInflateKernels<S>& wide_inflate_kernels(KernelSet set);
template <>
const WideInflateKernels<float>& wide_inflate_kernels(KernelSet set);
template <>
const WideInflateKernels<double>& wide_inflate_kernels(KernelSet set);

}  // namespace kbvh
