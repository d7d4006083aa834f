#pragma once
// Internal to kernels: the simultaneous traversal of two wide hierarchies, for any view of their
// boxes: stored, computed at the visit, or linear in time.
#include "core/families/wide/kernels/wide_overlap.hpp"
#include "core/kernels/quads.hpp"

namespace kbvh {
namespace {

/// A box in plain numbers.
template <class S>
struct SixSides {
  S lower[3], upper[3];
};

template <class S>
[[gnu::always_inline]] inline SixSides<S> lane_box(const S* rows, std::size_t stride, std::uint32_t lane) {
  SixSides<S> box;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    box.lower[axis] = rows[axis * stride + lane];
    box.upper[axis] = -rows[(axis + 3) * stride + lane];
  }
  return box;
}
template <class S>
[[gnu::always_inline]] inline SixSides<S> own_box(const S* node_bounds) {
  return {{node_bounds[0], node_bounds[1], node_bounds[2]}, {node_bounds[4], node_bounds[5], node_bounds[6]}};
}

/// Returns a mask. Bit i: lane i of the rows overlaps the box. Empty lanes overlap nothing.
template <class S, std::size_t width>
[[gnu::always_inline]] inline unsigned overlapping(const S* rows, const SixSides<S>& box) {
  constexpr std::size_t fit = native_lanes<S> < width ? native_lanes<S> : width;
  constexpr std::size_t lanes = fit * sizeof(S) < 16 ? 1 : fit;  // there are no shorter registers
  using V = Vector<S, lanes>;
  unsigned bits = 0;
  for (std::size_t i = 0; i < width; i += lanes) {
    const V x = load_lanes<V>(rows + i), nx = load_lanes<V>(rows + 3 * width + i);
    const V y = load_lanes<V>(rows + width + i), ny = load_lanes<V>(rows + 4 * width + i);
    const V z = load_lanes<V>(rows + 2 * width + i), nz = load_lanes<V>(rows + 5 * width + i);
    const auto meets = (x <= box.upper[0]) & (nx <= -box.lower[0]) & (y <= box.upper[1]) &
                       (ny <= -box.lower[1]) & (z <= box.upper[2]) & (nz <= -box.lower[2]);
    if constexpr (lanes == 1)
      bits |= unsigned(meets) << i;
    else
      bits |= mask_bits(meets) << i;
  }
  return bits;
}

[[gnu::always_inline]] inline std::uint32_t lowest(unsigned bits) {
  return std::uint32_t(__builtin_ctz(bits));
}

/// Returns how the traversal refers to child `lane`.
[[gnu::always_inline]] inline std::uint32_t child(const WideNode& node, std::uint32_t index,
                                                  std::uint32_t lane) {
  return lane < node.leaf_count ? WidePair::leaf_bit | LeafSlot::of(index, lane)
                                : node.first_child + lane - node.leaf_count;
}

/// Writes a pair of two leaves to the output, any other pair to the stack; branchless, because the branch
/// would be unpredictable.
[[gnu::always_inline]] inline void emit(WideTraversal& state, std::uint32_t first, std::uint32_t second) {
  const bool leaves = (first & second & WidePair::leaf_bit) != 0;
  state.stack[state.depth] = {first, second};
  state.out[2 * state.found] = {first & ~WidePair::leaf_bit};
  state.out[2 * state.found + 1] = {second & ~WidePair::leaf_bit};
  state.depth += leaves ? 0 : 1;
  state.found += leaves ? 1 : 0;
}

/// Compares the children of all pairs on the stack until it is empty, the limit of tests is reached, a step
/// might exceed the free space, or the view waits for boxes. A view has
///   bool waits(const WideTraversal&)       the pair on top lacks boxes
///   void enter(std::uint32_t a, std::uint32_t b)   their children will be read; a leaf has bit 31 set
///   Box own_b(node), lane_a(node, lane), lane_b(node, lane)
///   unsigned meeting_a(node, Box), meeting_b(node, Box)   bit i: lane i of the node meets the box
///   bool within_one   both hierarchies are the same: each two different leaves are found once, and each leaf
///     with itself
///   bool selects      only pairs with a selected side are visited; then also
///   unsigned selected_a(node), selected_b(node)    bit i: lane i of the node is selected
template <class S, class View>
[[gnu::always_inline]] inline void traverse_pairs(const WideArrays<S>& a, const WideArrays<S>& b, View& view,
                                                  WideTraversal& shared) {
  WideTraversal state = shared;
  while (state.depth > 0 && state.tests < state.test_limit &&
         state.depth + max_pairs_per_step < state.stack_room &&
         state.found + max_pairs_per_step < state.out_room) {
    if (view.waits(state)) break;
    const WidePair pair = state.stack[--state.depth];
    view.enter(pair.first, pair.second);
    if (((pair.first | pair.second) & WidePair::leaf_bit) == 0) {
      const WideNode node_a = a.nodes[pair.first], node_b = b.nodes[pair.second];
      unsigned first = view.meeting_a(pair.first, view.own_b(pair.second));
      if constexpr (View::selects)
        if (view.selected_b(pair.second) == 0) first &= view.selected_a(pair.first);
      state.tests += node_a.count + std::uint64_t(unsigned(__builtin_popcount(first))) * node_b.count;
      for (; first != 0; first &= first - 1) {
        const std::uint32_t i = lowest(first), child_a = child(node_a, pair.first, i);
        unsigned second = view.meeting_b(pair.second, view.lane_a(pair.first, i));
        if constexpr (View::selects)
          if ((view.selected_a(pair.first) >> i & 1) == 0) second &= view.selected_b(pair.second);
        // For a node paired with itself, the other half mirrors this one.
        if (View::within_one && pair.first == pair.second) second &= ~0U << i;
        for (; second != 0; second &= second - 1)
          emit(state, child_a, child(node_b, pair.second, lowest(second)));
      }
    } else if ((pair.first & WidePair::leaf_bit) != 0) {
      const LeafSlot leaf{pair.first & ~WidePair::leaf_bit};
      const WideNode node = b.nodes[pair.second];
      unsigned hit = view.meeting_b(pair.second, view.lane_a(leaf.node(), leaf.lane()));
      if constexpr (View::selects)
        if ((view.selected_a(leaf.node()) >> leaf.lane() & 1) == 0) hit &= view.selected_b(pair.second);
      state.tests += node.count;
      for (; hit != 0; hit &= hit - 1) emit(state, pair.first, child(node, pair.second, lowest(hit)));
    } else {
      const LeafSlot leaf{pair.second & ~WidePair::leaf_bit};
      const WideNode node = a.nodes[pair.first];
      unsigned hit = view.meeting_a(pair.first, view.lane_b(leaf.node(), leaf.lane()));
      if constexpr (View::selects)
        if ((view.selected_b(leaf.node()) >> leaf.lane() & 1) == 0) hit &= view.selected_a(pair.first);
      state.tests += node.count;
      for (; hit != 0; hit &= hit - 1) emit(state, child(node, pair.first, lowest(hit)), pair.second);
    }
  }
  shared = state;
}

/// Boxes stored in the rows.
template <class S, std::uint32_t width>
struct StoredView {
  static constexpr bool within_one = false, selects = false;
  const S *lanes_a, *lanes_b, *all_own_b;
  static constexpr std::size_t row_scalars = 6 * width;

  [[gnu::always_inline]] StoredView(const WideArrays<S>& a, const WideArrays<S>& b)
      : lanes_a(a.child_bounds), lanes_b(b.child_bounds), all_own_b(b.node_bounds) {}
  [[gnu::always_inline]] static bool waits(const WideTraversal&) { return false; }
  [[gnu::always_inline]] static void enter(std::uint32_t, std::uint32_t) {}
  [[gnu::always_inline]] SixSides<S> own_b(std::uint32_t node) const {
    return own_box(all_own_b + std::size_t(8) * node);
  }
  [[gnu::always_inline]] SixSides<S> lane_a(std::uint32_t node, std::uint32_t lane) const {
    return lane_box(lanes_a + node * row_scalars, width, lane);
  }
  [[gnu::always_inline]] SixSides<S> lane_b(std::uint32_t node, std::uint32_t lane) const {
    return lane_box(lanes_b + node * row_scalars, width, lane);
  }
  [[gnu::always_inline]] unsigned meeting_a(std::uint32_t node, const SixSides<S>& box) const {
    return overlapping<S, width>(lanes_a + node * row_scalars, box);
  }
  [[gnu::always_inline]] unsigned meeting_b(std::uint32_t node, const SixSides<S>& box) const {
    return overlapping<S, width>(lanes_b + node * row_scalars, box);
  }
};

}  // namespace
}  // namespace kbvh
