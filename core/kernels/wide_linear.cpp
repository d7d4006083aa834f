#include "core/kernels/wide_linear.hpp"

#include "core/kernels/leaf_fit.hpp"
#include "core/kernels/wide_traverse.hpp"

namespace kbvh {
namespace {

// ---- One moment -------------------------------------------------------------------------------------------

template <class S, std::uint32_t width>
void make(const WideMoment<S>& moment, std::uint32_t node) {
  constexpr std::size_t scalars = 6 * width;
  const S margin = moment.ends.margin, s = moment.fraction;
  const S* first = moment.ends.lanes[0] + node * scalars;
  const S* last = moment.ends.lanes[1] + node * scalars;
  S* rows = moment.hierarchy.lanes + node * scalars;
  // Upper bounds are stored with their sign turned: less is larger for every row. Empty lanes become NaN,
  // which overlaps nothing either.
  for (std::size_t i = 0; i < scalars; ++i) rows[i] = first[i] + s * (last[i] - first[i]) - margin;
  const S* own_first = moment.ends.own[0] + std::size_t(8) * node;
  const S* own_last = moment.ends.own[1] + std::size_t(8) * node;
  S* own = moment.hierarchy.own + std::size_t(8) * node;
  for (std::size_t i = 0; i < 8; ++i)
    own[i] = own_first[i] + s * (own_last[i] - own_first[i]) + (i < 4 ? -margin : margin);
}

/// Stored boxes that are made on the first visit.
template <class S, std::uint32_t width>
struct MomentView : StoredView<S, width> {
  const WideMoment<S>&a, &b;
  [[gnu::always_inline]] MomentView(const WideMoment<S>& first, const WideMoment<S>& second)
      : StoredView<S, width>(first.hierarchy, second.hierarchy), a(first), b(second) {}
  [[gnu::always_inline]] static void refresh(const WideMoment<S>& moment, std::uint32_t node) {
    if ((node & WidePair::leaf_bit) != 0 || moment.stale[node] == 0) return;
    make<S, width>(moment, node);
    moment.stale[node] = 0;
  }
  [[gnu::always_inline]] void enter(std::uint32_t first, std::uint32_t second) const {
    refresh(a, first);
    refresh(b, second);
  }
};

template <class S, std::uint32_t width>
void at(WideMoment<S> a, WideMoment<S> b, WideTraversal& state) {
  MomentView<S, width> view(a, b);
  traverse_pairs(a.hierarchy, b.hierarchy, view, state);
}

// ---- A whole segment --------------------------------------------------------------------------------------

/// A box at both ends, as what the rows of the other side are compared with: upper bounds, and lower ones
/// with their sign turned, both larger by the margin.
template <class S>
struct Reach {
  S bound[2][6];
};

template <class S>
[[gnu::always_inline]] inline Reach<S> reach_of(const SixSides<S>& first, const SixSides<S>& last, S margin) {
  Reach<S> reach;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    reach.bound[0][axis] = first.upper[axis] + margin;
    reach.bound[0][axis + 3] = margin - first.lower[axis];
    reach.bound[1][axis] = last.upper[axis] + margin;
    reach.bound[1][axis + 3] = margin - last.lower[axis];
  }
  return reach;
}

/// Gaps of a register of boxes to one box at both ends: positive where a side keeps them apart.
template <class S, class V>
struct Gaps {
  V first[6], last[6];
};

/// From when to when no side keeps them apart, of lanes in which every side closes at one end at least.
template <class S, class V>
[[gnu::always_inline]] inline void together(const Gaps<S, V>& gaps, V& begin, V& end) {
  begin = V{} + S(0);
  end = V{} + S(1);
  for (std::size_t k = 0; k < 6; ++k) {
    const V zero = V{} + S(0);
    const V crossing = gaps.first[k] / (gaps.first[k] - gaps.last[k]);
    const V later = larger(begin, crossing), sooner = smaller(end, crossing);
    begin = gaps.first[k] > zero ? later : begin;
    end = gaps.last[k] > zero ? sooner : end;
  }
}

/// More than all rounding of a fraction, of `together` and of frames alike.
constexpr float fraction_slack = 0x1p-20f;

/// Bits of the lanes that no side keeps apart at the begin, or none at the end.
template <class S, class V>
[[gnu::always_inline]] inline unsigned together_at_an_end(const Gaps<S, V>& gaps) {
  V first = gaps.first[0], last = gaps.last[0];
  for (std::size_t k = 1; k < 6; ++k) {
    first = larger(first, gaps.first[k]);
    last = larger(last, gaps.last[k]);
  }
  const V zero = V{} + S(0);
  return mask_bits(first <= zero) | mask_bits(last <= zero);
}

/// Bit i: lane i of the rows overlaps the box at some time. With `times`, their fractions go to begin and
/// end.
template <class S, std::size_t width, bool times>
[[gnu::always_inline]] inline unsigned meeting(const S* first, const S* last, const Reach<S>& reach, S* begin,
                                               S* end) {
  constexpr std::size_t fit = native_lanes<S> < width ? native_lanes<S> : width;
  constexpr std::size_t lanes = fit * sizeof(S) < 16 ? 1 : fit;  // there are no shorter registers
  using V = Vector<S, lanes>;
  unsigned bits = 0;
  for (std::size_t i = 0; i < width; i += lanes) {
    Gaps<S, V> gaps;
    V apart;
    for (std::size_t k = 0; k < 6; ++k) {
      const V d0 = load_lanes<V>(first + k * width + i) - reach.bound[0][k];
      const V d1 = load_lanes<V>(last + k * width + i) - reach.bound[1][k];
      gaps.first[k] = d0;
      gaps.last[k] = d1;
      apart = k == 0 ? smaller(d0, d1) : larger(apart, smaller(d0, d1));
    }
    const V zero = V{} + S(0);
    unsigned hit = mask_bits(apart <= zero);
    if (times ? hit != 0 : (hit & ~together_at_an_end(gaps)) != 0) {
      V from, to;
      together<S, V>(gaps, from, to);
      hit &= ~mask_bits(from > to + 2 * S(fraction_slack));
      if constexpr (times) {
        store_lanes(begin + i, from);
        store_lanes(end + i, to);
      }
    }
    bits |= hit << i;
  }
  return bits;
}

/// Boxes that are linear in time.
template <class S, std::uint32_t width, bool self>
struct SegmentView {
  static constexpr bool within_one = self;
  WideEnds<S> a, b;
  S margin;
  static constexpr std::size_t row_scalars = 6 * width;

  [[gnu::always_inline]] SegmentView(const WideEnds<S>& first, const WideEnds<S>& second)
      : a(first), b(second), margin(first.margin + second.margin) {}
  [[gnu::always_inline]] static bool waits(const WideTraversal&) { return false; }
  [[gnu::always_inline]] static void enter(std::uint32_t, std::uint32_t) {}
  [[gnu::always_inline]] Reach<S> own_b(std::uint32_t node) const {
    return reach_of(own_box(b.own[0] + std::size_t(8) * node), own_box(b.own[1] + std::size_t(8) * node),
                    margin);
  }
  [[gnu::always_inline]] Reach<S> lane_of(const WideEnds<S>& ends, std::uint32_t node,
                                          std::uint32_t lane) const {
    return reach_of(lane_box(ends.lanes[0] + node * row_scalars, width, lane),
                    lane_box(ends.lanes[1] + node * row_scalars, width, lane), margin);
  }
  [[gnu::always_inline]] Reach<S> lane_a(std::uint32_t node, std::uint32_t lane) const {
    return lane_of(a, node, lane);
  }
  [[gnu::always_inline]] Reach<S> lane_b(std::uint32_t node, std::uint32_t lane) const {
    return lane_of(b, node, lane);
  }
  [[gnu::always_inline]] static unsigned meeting_of(const WideEnds<S>& ends, std::uint32_t node,
                                                    const Reach<S>& box) {
    return meeting<S, width, false>(ends.lanes[0] + node * row_scalars, ends.lanes[1] + node * row_scalars,
                                    box, nullptr, nullptr);
  }
  [[gnu::always_inline]] unsigned meeting_a(std::uint32_t node, const Reach<S>& box) const {
    return meeting_of(a, node, box);
  }
  [[gnu::always_inline]] unsigned meeting_b(std::uint32_t node, const Reach<S>& box) const {
    return meeting_of(b, node, box);
  }
};

template <class S, std::uint32_t width, bool self>
void join(WideArrays<S> a, WideEnds<S> ends_a, WideArrays<S> b, WideEnds<S> ends_b, WideTraversal& state) {
  SegmentView<S, width, self> view(ends_a, ends_b);
  traverse_pairs(a, b, view, state);
}

/// Makes the rows of a leaf at both ends, unless they are those of this segment.
template <class S, std::size_t padded>
[[gnu::always_inline]] inline void make_rows(const WideLinearLeaves<S>& leaves, std::uint32_t leaf) {
  if (leaves.stamps[leaf] == leaves.stamp) return;
  const std::size_t place = std::size_t(leaf) * 6 * padded;
  fit_leaf<S, padded>(leaves.lists, leaf, leaves.positions[0], leaves.rows[0] + place);
  if (leaves.rows[0] != leaves.rows[1])
    fit_leaf<S, padded>(leaves.lists, leaf, leaves.positions[1], leaves.rows[1] + place);
  leaves.stamps[leaf] = leaves.stamp;
}

template <class S, std::uint32_t width, std::size_t padded>
void leaf_join(WideLeafJoin<S>& shared) {
  WideLeafJoin<S> state = shared;
  const S margin = state.ends_a.margin + state.ends_b.margin;
  const WideLeafLists &lists_a = state.leaves_a.lists, &lists_b = state.leaves_b.lists;
  const auto number = [](const WideArrays<S>& h, LeafSlot slot) {
    return h.nodes[slot.node()].first_leaf + slot.lane();
  };
  alignas(64) S begin[padded], end[padded];
  for (; state.next < state.count && state.found + leaf_pair_step <= state.out_room; ++state.next) {
    const LeafSlot slot_a = state.pairs[2 * state.next], slot_b = state.pairs[2 * state.next + 1];
    const std::uint32_t leaf_a = number(state.a, slot_a), leaf_b = number(state.b, slot_b);
    make_rows<S, padded>(state.leaves_a, leaf_a);
    make_rows<S, padded>(state.leaves_b, leaf_b);
    const std::size_t place_a = std::size_t(leaf_a) * 6 * padded, place_b = std::size_t(leaf_b) * 6 * padded;
    const S *first_a = state.leaves_a.rows[0] + place_a, *last_a = state.leaves_a.rows[1] + place_a;
    const S *first_b = state.leaves_b.rows[0] + place_b, *last_b = state.leaves_b.rows[1] + place_b;
    const std::uint32_t begin_a = lists_a.first_entry[leaf_a], begin_b = lists_b.first_entry[leaf_b];
    const std::uint32_t count_a = lists_a.first_entry[leaf_a + 1] - begin_a;
    const std::uint32_t count_b = lists_b.first_entry[leaf_b + 1] - begin_b;
    const std::size_t rows_b = slot_b.node() * std::size_t(6) * width;
    const Reach<S> box_b = reach_of(lane_box(state.ends_b.lanes[0] + rows_b, width, slot_b.lane()),
                                    lane_box(state.ends_b.lanes[1] + rows_b, width, slot_b.lane()), margin);
    unsigned first = meeting<S, padded, false>(first_a, last_a, box_b, nullptr, nullptr);
    state.tests += count_a + std::uint64_t(unsigned(__builtin_popcount(first))) * count_b;
    for (; first != 0; first &= first - 1) {
      const std::uint32_t i = lowest(first), primitive_a = lists_a.primitives[begin_a + i];
      const Reach<S> box_a = reach_of(lane_box(first_a, padded, i), lane_box(last_a, padded, i), margin);
      unsigned second = meeting<S, padded, true>(first_b, last_b, box_a, begin, end);
      for (; second != 0; second &= second - 1) {
        const std::uint32_t j = lowest(second);
        const float from = float(begin[j]) - fraction_slack, to = float(end[j]) + fraction_slack;
        state.out[state.found++] = {primitive_a, lists_b.primitives[begin_b + j], from > 0 ? from : 0,
                                    to < 1 ? to : 1};
      }
    }
  }
  shared = state;
}

template <class S>
constexpr WideLinearKernels<S> table{{&at<S, 2>, &at<S, 4>, &at<S, 8>},
                                     {&join<S, 2, false>, &join<S, 4, false>, &join<S, 8, false>},
                                     {{&leaf_join<S, 2, 4>, &leaf_join<S, 2, 8>, &leaf_join<S, 2, 16>},
                                      {&leaf_join<S, 4, 4>, &leaf_join<S, 4, 8>, &leaf_join<S, 4, 16>},
                                      {&leaf_join<S, 8, 4>, &leaf_join<S, 8, 8>, &leaf_join<S, 8, 16>}},
                                     {&make<S, 2>, &make<S, 4>, &make<S, 8>},
                                     {&join<S, 2, true>, &join<S, 4, true>, &join<S, 8, true>}};

}  // namespace

namespace kernels::KBVH_KERNELS {
const WideLinearKernels<float> wide_linear_float = table<float>;
const WideLinearKernels<double> wide_linear_double = table<double>;
}  // namespace kernels::KBVH_KERNELS

}  // namespace kbvh
