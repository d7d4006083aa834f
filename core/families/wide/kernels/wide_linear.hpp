#pragma once
#include "core/families/wide/kernels/wide_layout.hpp"
#include "core/families/wide/kernels/wide_overlap.hpp"
#include "core/kernels/kernel_tables.hpp"

namespace kbvh {

enum class KernelSet : std::uint8_t;

/// Boxes of a wide hierarchy that are linear in time over a segment: child and node bounds as in
/// `WideArrays`, at its start and at its end. A box at a fraction in between is interpolated and then
/// inflated by the largest rounding error of each of its sides.
///
/// Let x0 and x1 be a lower side at the ends, which are the smallest stored positions there, u half an
/// epsilon, and r `rounding`. At an end, the line A of a vertex differs from its stored position P by at most
/// r |P|, and x - r |x| grows with x. So A >= x - r |x| there, and at a fraction f
///   A >= (1 - f) x0 + f x1 - r ((1 - f) |x0| + f |x1|).
/// The position B of a frame is A rounded to nearest, which is monotone: the same sum, rounded, is no larger
/// than B. So the rounding depends only on the two numbers of one side, not on other axes or other boxes.
/// Upper sides are mirror images.
///
/// Two boxes over a segment (`side_margin`): if B of one body is not above B of another one, neither are the
/// rounded sums of their sides x and y, and the gap x - y is at most (ra + u)(1 + u) |x| + (rb + u)(1 + u)
/// |y|, in the mean of both ends. With |x| <= |x - y| + |y| the coordinates of one box suffice: y moves
/// outwards by c |y|, where c = ra + rb + 2 u, plus 2 u for the rounding of the moved side and for products
/// of roundings. This neglects some u of the gap, and thus of the fraction at which it closes, which
/// `fraction_slack` covers.
///
/// A box at a fraction s (`moment_margin`): the last operation rounds to nearest, like B, and costs nothing.
/// The sum before it, x0 + s (x1 - x0), has an error of u of the result, of 2 u s |x1 - x0| for difference
/// and product, and of 3 u s |x1 - x0| for the fraction, which has three roundings in double. With r that is
/// (r + u) |x0| + (r + 6 u) |x1 - x0|, to which u and 2 u are added for the roundings of the margin.
template <class S>
struct WideEnds {
  const S* child_bounds[2];
  const S* node_bounds[2];
  /// The largest distance of a vertex's line from its stored position at an end, relative to that coordinate.
  S rounding;
};
/// Half a unit of rounding, relative to the rounded number; and the smallest normal number, which bounds the
/// loss by underflow.
template <class S>
inline constexpr S unit_rounding = sizeof(S) == 4 ? S(0x1p-24) : S(0x1p-53);
template <class S>
inline constexpr S least_margin = sizeof(S) == 4 ? S(0x1p-126) : S(0x1p-1022);

/// Boxes at one fraction of the segment, computed from the ends when the traversal first visits a node.
template <class S>
struct WideMoment {
  WideArrays<S> hierarchy;  ///< child_bounds and node_bounds are written
  WideEnds<S> ends;
  std::uint8_t* stale;  ///< [node]: not 0 until its boxes are computed
  S fraction;
};

/// The lanes to which a traversal is restricted, per node of each hierarchy: bit i: something in or below
/// lane i is selected. A pair is visited if either side is selected.
struct WideSelection {
  const std::uint8_t *a, *b;
};

/// Two primitives whose boxes overlap at some time of a segment, with the fractions at which the overlap
/// begins and ends. Closed; rounded outwards.
struct JoinedPair {
  std::uint32_t primitive_a, primitive_b;
  float begin, end;
};
static_assert(sizeof(JoinedPair) == 16);

/// Leaves for a join: like `WideLeaves`, with rows at both ends of the segment.
template <class S>
struct WideLinearLeaves {
  WideLeafLists lists;
  /// By end; both the same for a body at rest.
  S* rows[2];                ///< [leaf][6][padded leaf size]
  std::uint32_t* stamps[2];  ///< [leaf]: stamp of the positions of its rows
  std::uint32_t stamp[2];    ///< stamp of these positions
  const S* positions[2];
};

/// Output columns for pairs of primitives. `begin` and `end` are null for pairs that overlap throughout.
struct JoinColumns {
  std::uint32_t *primitive_a, *primitive_b;
  float *begin, *end;
  std::size_t found, room;

  /// Returns whether there is space for a pair of leaves: its possible pairs, the pairs waiting in a
  /// register, and one register, because whole registers are written.
  bool has_room() const { return found + leaf_pair_step + 32 <= room; }
};

/// Turns pairs of leaves into pairs of primitives whose linear boxes overlap at some time.
template <class S>
struct WideLeafJoin {
  std::uint32_t width;  ///< of both hierarchies
  WideArrays<S> a, b;
  WideEnds<S> ends_a, ends_b;
  WideLinearLeaves<S> leaves_a, leaves_b;
  const LeafSlot* pairs;  ///< first, second, ...
  std::size_t next, count;
  JoinColumns throughout;  ///< pairs that overlap from the start of the segment to its end
  JoinColumns partly;      ///< the others
  std::uint64_t tests;
  /// [pair of leaves] bit i: primitive i of the first leaf counts; bit 16 + i: primitive i of the second.
  /// Null: all count.
  const std::uint32_t* masks = nullptr;
  /// [leaf]: bit i: entry i of the leaf is selected. For joins of selected pairs only.
  const std::uint16_t *selected_a = nullptr, *selected_b = nullptr;
};

template <class S>
struct WideLinearKernels {
  /// Like WideOverlapKernels::Traverse, with the boxes of one moment.
  using At = void (*)(WideMoment<S> a, WideMoment<S> b, WideTraversal& state);
  /// Does the same for boxes that overlap at any time of the segment.
  using Join = void (*)(WideArrays<S> a, WideEnds<S> ends_a, WideArrays<S> b, WideEnds<S> ends_b,
                        WideTraversal& state);
  /// Does the same for pairs with a selected side.
  using JoinSelected = void (*)(WideArrays<S> a, WideEnds<S> ends_a, WideArrays<S> b, WideEnds<S> ends_b,
                                WideSelection selection, WideTraversal& state);
  /// Continues until all pairs of leaves are done or the next one might exceed the free space
  /// (`JoinColumns::has_room`).
  using LeafJoin = void (*)(WideLeafJoin<S>& state);
  /// Computes the boxes of one node at a fraction.
  using Make = void (*)(const WideMoment<S>& moment, std::uint32_t node);
  At at_width[3];                                          ///< [log2(width) - 1]
  Join join_width[3];                                      ///< [log2(width) - 1]
  LeafJoin leaf_join_padded[3];                            ///< [padded leaf size 4, 8, 16]
  Make make_width[3];                                      ///< [log2(width) - 1]
  Join self_width[3];                                      ///< [log2(width) - 1]; a hierarchy with itself
  JoinSelected selected_width[3], selected_self_width[3];  ///< for pairs with a selected side
  LeafJoin leaf_join_selected_padded[3];                   ///< for pairs with a selected side

  static constexpr std::size_t index(std::uint32_t width) { return width == 2 ? 0 : width == 4 ? 1 : 2; }
  At at(std::uint32_t width) const { return at_width[index(width)]; }
  Join join(std::uint32_t width) const { return join_width[index(width)]; }
  Join self(std::uint32_t width) const { return self_width[index(width)]; }
  JoinSelected selected(std::uint32_t width) const { return selected_width[index(width)]; }
  JoinSelected selected_self(std::uint32_t width) const { return selected_self_width[index(width)]; }
  LeafJoin leaf_join(std::uint32_t padded) const { return leaf_join_padded[index(padded / 2)]; }
  LeafJoin leaf_join_selected(std::uint32_t padded) const {
    return leaf_join_selected_padded[index(padded / 2)];
  }
  Make make(std::uint32_t width) const { return make_width[index(width)]; }
};
KBVH_DECLARE_KERNELS(WideLinearKernels<float>, wide_linear_float)
KBVH_DECLARE_KERNELS(WideLinearKernels<double>, wide_linear_double)

/// Returns the kernels of one instruction set.
template <class S>
const WideLinearKernels<S>& wide_linear_kernels(KernelSet set);
template <>
const WideLinearKernels<float>& wide_linear_kernels(KernelSet set);
template <>
const WideLinearKernels<double>& wide_linear_kernels(KernelSet set);

}  // namespace kbvh
