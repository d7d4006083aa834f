#include "core/families/wide/kernels/wide_linear.hpp"

#include "core/families/wide/kernels/leaf_fit.hpp"
#include "core/families/wide/kernels/wide_traverse.hpp"

namespace kbvh {
namespace {

// ---- What rounding can do (WideEnds) ----------------------------------------------------------------------

template <class V>
[[gnu::always_inline]] inline V magnitude(V x) {
  return larger(x, -x);
}

/// Returns the share of a side's coordinate by which it moves outwards to be compared with the other body's
/// sides.
template <class S>
[[gnu::always_inline]] inline S both_roundings(const WideEnds<S>& a, const WideEnds<S>& b) {
  return a.rounding + b.rounding + 4 * unit_rounding<S>;
}
template <class S>
[[gnu::always_inline]] inline S side_margin(S side, S rounding) {
  return rounding * magnitude(side) + least_margin<S>;
}

/// The margin of a side at a fraction, from its coordinate at the start and its way from there to the end.
template <class S>
struct MomentMargin {
  S of_first, of_way;
  explicit MomentMargin(S rounding)
      : of_first(rounding + 2 * unit_rounding<S>), of_way(rounding + 8 * unit_rounding<S>) {}
  [[gnu::always_inline]] S operator()(S first, S way) const {
    return of_first * magnitude(first) + of_way * magnitude(way) + least_margin<S>;
  }
};

// ---- One moment -------------------------------------------------------------------------------------------

template <class S, std::uint32_t width>
void make(const WideMoment<S>& moment, std::uint32_t node) {
  constexpr std::size_t scalars = 6 * width;
  const MomentMargin<S> margin(moment.ends.rounding);
  const S s = moment.fraction;
  const S* first = moment.ends.child_bounds[0] + node * scalars;
  const S* last = moment.ends.child_bounds[1] + node * scalars;
  S* rows = moment.hierarchy.child_bounds + node * scalars;
  // Upper bounds are stored negated: smaller is further out in every row. Empty lanes become NaN, which does
  // not overlap anything either.
  for (std::size_t i = 0; i < scalars; ++i) {
    const S way = last[i] - first[i];
    rows[i] = first[i] + s * way - margin(first[i], way);
  }
  const S* own_first = moment.ends.node_bounds[0] + std::size_t(8) * node;
  const S* own_last = moment.ends.node_bounds[1] + std::size_t(8) * node;
  S* node_bounds = moment.hierarchy.node_bounds + std::size_t(8) * node;
  for (std::size_t i = 0; i < 8; ++i) {
    const S way = own_last[i] - own_first[i], outwards = margin(own_first[i], way);
    node_bounds[i] = own_first[i] + s * way + (i < 4 ? -outwards : outwards);
  }
}

/// Stored boxes that are computed at the first visit.
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

/// A box at both ends, in the form in which rows of the other side are compared: upper bounds and negated
/// lower bounds, both inflated by the largest rounding errors of both sides.
template <class S>
struct Reach {
  S bound[2][6];
};

template <class S>
[[gnu::always_inline]] inline Reach<S> reach_of(const SixSides<S>& first, const SixSides<S>& last,
                                                S rounding) {
  Reach<S> reach;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    reach.bound[0][axis] = first.upper[axis] + side_margin(first.upper[axis], rounding);
    reach.bound[0][axis + 3] = side_margin(first.lower[axis], rounding) - first.lower[axis];
    reach.bound[1][axis] = last.upper[axis] + side_margin(last.upper[axis], rounding);
    reach.bound[1][axis + 3] = side_margin(last.lower[axis], rounding) - last.lower[axis];
  }
  return reach;
}

/// The gaps between a register of boxes and one box at both ends: positive where a side separates them.
template <class S, class V>
struct Gaps {
  V first[6], last[6];
};

/// Computes the interval in which no side separates the boxes, for lanes in which every side closes at one
/// end or both.
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

/// An upper bound of the rounding of a fraction, both in `together` and in frames.
constexpr float fraction_slack = 0x1p-20f;

/// Returns the bits of the lanes in which no side separates the boxes at the start, or none at the end.
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

template <class S, std::size_t width>
constexpr std::size_t register_lanes = [] {
  constexpr std::size_t fit = native_lanes<S> < width ? native_lanes<S> : width;
  return fit * sizeof(S) < 16 ? std::size_t(1) : fit;  // there are no shorter registers
}();

/// Returns a mask. Bit i: lane i of the rows overlaps the box at some time.
template <class S, std::size_t width>
[[gnu::always_inline]] inline unsigned meeting(const S* first, const S* last, const Reach<S>& reach) {
  constexpr std::size_t lanes = register_lanes<S, width>;
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
    if ((hit & ~together_at_an_end(gaps)) != 0) {
      V from, to;
      together<S, V>(gaps, from, to);
      hit &= ~mask_bits(from > to + 2 * S(fraction_slack));
    }
    bits |= hit << i;
  }
  return bits;
}

/// Boxes that are linear in time.
template <class S, std::uint32_t width, bool self>
struct SegmentView {
  static constexpr bool within_one = self, selects = false;
  WideEnds<S> a, b;
  S rounding;
  static constexpr std::size_t row_scalars = 6 * width;

  [[gnu::always_inline]] SegmentView(const WideEnds<S>& first, const WideEnds<S>& second)
      : a(first), b(second), rounding(both_roundings(first, second)) {}
  [[gnu::always_inline]] static bool waits(const WideTraversal&) { return false; }
  [[gnu::always_inline]] static void enter(std::uint32_t, std::uint32_t) {}
  [[gnu::always_inline]] Reach<S> own_b(std::uint32_t node) const {
    return reach_of(own_box(b.node_bounds[0] + std::size_t(8) * node),
                    own_box(b.node_bounds[1] + std::size_t(8) * node), rounding);
  }
  [[gnu::always_inline]] Reach<S> lane_of(const WideEnds<S>& ends, std::uint32_t node,
                                          std::uint32_t lane) const {
    return reach_of(lane_box(ends.child_bounds[0] + node * row_scalars, width, lane),
                    lane_box(ends.child_bounds[1] + node * row_scalars, width, lane), rounding);
  }
  [[gnu::always_inline]] Reach<S> lane_a(std::uint32_t node, std::uint32_t lane) const {
    return lane_of(a, node, lane);
  }
  [[gnu::always_inline]] Reach<S> lane_b(std::uint32_t node, std::uint32_t lane) const {
    return lane_of(b, node, lane);
  }
  [[gnu::always_inline]] static unsigned meeting_of(const WideEnds<S>& ends, std::uint32_t node,
                                                    const Reach<S>& box) {
    return meeting<S, width>(ends.child_bounds[0] + node * row_scalars,
                             ends.child_bounds[1] + node * row_scalars, box);
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

/// Boxes that are linear in time; visits only pairs with a selected side.
template <class S, std::uint32_t width, bool self>
struct SelectedView : SegmentView<S, width, self> {
  static constexpr bool selects = true;
  WideSelection selection;

  [[gnu::always_inline]] SelectedView(const WideEnds<S>& first, const WideEnds<S>& second,
                                      const WideSelection& lanes)
      : SegmentView<S, width, self>(first, second), selection(lanes) {}
  [[gnu::always_inline]] unsigned selected_a(std::uint32_t node) const { return selection.a[node]; }
  [[gnu::always_inline]] unsigned selected_b(std::uint32_t node) const { return selection.b[node]; }
};

template <class S, std::uint32_t width, bool self>
void join_selected(WideArrays<S> a, WideEnds<S> ends_a, WideArrays<S> b, WideEnds<S> ends_b,
                   WideSelection selection, WideTraversal& state) {
  SelectedView<S, width, self> view(ends_a, ends_b, selection);
  traverse_pairs(a, b, view, state);
}

/// The number of leaf pairs whose rows are computed before they are compared.
constexpr std::size_t rows_ahead = 32;

/// Computes missing rows of leaves, several at a time, so that their memory accesses overlap with
/// computation.
template <class S, std::size_t padded>
class RowMaker {
 public:
  [[gnu::always_inline]] void want(const WideLinearLeaves<S>& leaves, std::uint32_t leaf) {
    for (int end = 0; end < 2; ++end) {
      std::uint32_t& stamp = leaves.stamps[end][leaf];
      if (stamp == leaves.stamp[end]) continue;
      stamp = leaves.stamp[end];
      wanted_[count_++] = {&leaves, leaf, end};
      const std::uint32_t corner = leaves.lists.first_corner[leaves.lists.first_entry[leaf]];
      for (std::size_t i = 0; i < 3 * padded; i += 16) __builtin_prefetch(leaves.lists.corners + corner + i);
      if (count_ == room) make();
    }
  }
  void make() {
    for (std::size_t w = 0; w < count_; ++w) {
      const Wanted& wanted = wanted_[w];
      const WideLeafLists& lists = wanted.leaves->lists;
      for (std::uint32_t entry = lists.first_entry[wanted.leaf]; entry < lists.end_entry[wanted.leaf];
           ++entry)
        __builtin_prefetch(wanted.leaves->positions[wanted.end] + lists.corners[lists.first_corner[entry]]);
    }
    for (std::size_t w = 0; w < count_; ++w) {
      const auto [leaves, leaf, end] = wanted_[w];
      fit_leaf<S, padded>(leaves->lists, leaf, leaves->positions[end],
                          leaves->rows[end] + std::size_t(leaf) * 6 * padded);
    }
    count_ = 0;
  }

 private:
  struct Wanted {
    const WideLinearLeaves<S>* leaves;
    std::uint32_t leaf;
    int end;
  };
  static constexpr std::size_t room = 16;
  Wanted wanted_[room];
  std::size_t count_ = 0;
};

/// One leaf of a pair: its rows at both ends, and its primitives.
template <class S>
struct LeafRows {
  const S *first, *last;
  const std::uint32_t* primitives;
  std::uint32_t count;
};

/// The data that primitives of a leaf are compared with, like `Reach`.
template <class S, std::size_t padded>
struct LeafReach {
  alignas(64) S bound[2][6][padded];  ///< by end, side and primitive

  [[gnu::always_inline]] void make(const LeafRows<S>& leaf, S rounding) {
    for (std::size_t side = 0; side < 6; ++side) {
      const std::size_t opposite = (side < 3 ? side + 3 : side - 3) * padded;
      for (std::size_t i = 0; i < padded; ++i) {
        const S first = leaf.first[opposite + i], last = leaf.last[opposite + i];
        bound[0][side][i] = side_margin(first, rounding) - first;
        bound[1][side][i] = side_margin(last, rounding) - last;
      }
    }
  }
};

/// Lanes of a leaf that may overlap primitive i of another leaf at some time, and those that do so from start
/// to end.
struct LaneBits {
  unsigned hit, throughout;
};
template <class S, std::size_t padded>
[[gnu::always_inline]] inline LaneBits compare(const LeafRows<S>& leaf, const LeafReach<S, padded>& reach,
                                               std::size_t i) {
  constexpr std::size_t lanes = register_lanes<S, padded>;
  using V = Vector<S, lanes>;
  LaneBits bits{0, 0};
  for (std::size_t lane = 0; lane < padded; lane += lanes) {
    V apart, open;
    for (std::size_t k = 0; k < 6; ++k) {
      const V d0 = load_lanes<V>(leaf.first + k * padded + lane) - reach.bound[0][k][i];
      const V d1 = load_lanes<V>(leaf.last + k * padded + lane) - reach.bound[1][k][i];
      apart = k == 0 ? smaller(d0, d1) : larger(apart, smaller(d0, d1));
      open = k == 0 ? larger(d0, d1) : larger(open, larger(d0, d1));
    }
    const V zero = V{} + S(0);
    const unsigned hit = mask_bits(apart <= zero);
    bits.hit |= hit << lane;
    bits.throughout |= (hit & mask_bits(open <= zero)) << lane;
  }
  return bits;
}

/// Pairs that may overlap in a part of the segment, a register of them at a time: the divisions cost more
/// than all other work, so no lane of a division should be idle.
template <class S>
struct PartlyBatch {
  static constexpr std::uint32_t room = 16;
  alignas(64) S first[6][room] = {}, last[6][room] = {};  ///< gaps
  alignas(64) std::uint32_t primitive_a[room] = {}, primitive_b[room] = {};
  std::uint32_t count = 0;

  /// Appends the pairs that do overlap, with the start and end of the overlap, rounded outwards.
  [[gnu::noinline]] void flush(JoinColumns& to) {
    constexpr std::size_t lanes = register_lanes<S, room>;
    using V = Vector<S, lanes>;
    alignas(64) S froms[room], tos[room];
    alignas(64) float begin[room], end[room];
    unsigned bits = 0;
    for (std::size_t lane = 0; lane < room; lane += lanes) {
      Gaps<S, V> gaps;
      for (std::size_t k = 0; k < 6; ++k) {
        gaps.first[k] = load_lanes<V>(first[k] + lane);
        gaps.last[k] = load_lanes<V>(last[k] + lane);
      }
      V from, until;
      together<S, V>(gaps, from, until);
      bits |= mask_bits(from <= until + 2 * S(fraction_slack)) << lane;
      store_lanes(froms + lane, from);
      store_lanes(tos + lane, until);
    }
    for (std::size_t lane = 0; lane < room; ++lane) {
      const float from = float(froms[lane]) - fraction_slack, until = float(tos[lane]) + fraction_slack;
      begin[lane] = from > 0 ? from : 0;
      end[lane] = until < 1 ? until : 1;
    }
    bits &= (1U << count) - 1;
    pack_lanes(bits, primitive_a, to.primitive_a + to.found);
    pack_lanes(bits, primitive_b, to.primitive_b + to.found);
    pack_lanes(bits, begin, to.begin + to.found);
    to.found += pack_lanes(bits, end, to.end + to.found);
    count = 0;
  }
};

/// Processes the pairs of the primitives of two leaves; visits only primitives with a bit. Branches on the
/// overlap would cost as much as the comparisons, so only the ends of loops branch.
template <class S, std::size_t padded>
[[gnu::always_inline]] inline void leaf_pairs(const LeafRows<S>& outer, unsigned bits,
                                              const LeafRows<S>& inner, unsigned inner_bits, S rounding,
                                              bool swapped, WideLeafJoin<S>& state, PartlyBatch<S>& batch) {
  LeafReach<S, padded> reach;
  reach.make(outer, rounding);
  JoinColumns& all = state.throughout;
  std::uint32_t* const column_outer = swapped ? all.primitive_b : all.primitive_a;
  std::uint32_t* const column_inner = swapped ? all.primitive_a : all.primitive_b;
  alignas(64) static constexpr std::uint32_t numbers[16] = {0, 1, 2,  3,  4,  5,  6,  7,
                                                            8, 9, 10, 11, 12, 13, 14, 15};
  alignas(64) std::uint32_t part_outer[padded * padded + 16], part_inner[padded * padded + 16];
  std::uint32_t parts = 0;
  const auto fill = [](std::uint32_t* to, std::uint32_t value) {
    for (std::size_t i = 0; i < 16; ++i) to[i] = value;
  };
  for (; bits != 0; bits &= bits - 1) {
    const std::uint32_t i = lowest(bits);
    LaneBits found = compare<S, padded>(inner, reach, i);
    found.hit &= inner_bits;
    found.throughout &= inner_bits;
    fill(column_outer + all.found, outer.primitives[i]);
    all.found += pack_lanes(found.throughout, inner.primitives, column_inner + all.found);
    fill(part_outer + parts, i);
    parts += pack_lanes(found.hit & ~found.throughout, numbers, part_inner + parts);
  }
  for (std::uint32_t p = 0; p < parts; ++p) {
    const std::uint32_t i = part_outer[p], j = part_inner[p], place = batch.count++;
    for (std::size_t k = 0; k < 6; ++k) {
      batch.first[k][place] = inner.first[k * padded + j] - reach.bound[0][k][i];
      batch.last[k][place] = inner.last[k * padded + j] - reach.bound[1][k][i];
    }
    batch.primitive_a[place] = swapped ? inner.primitives[j] : outer.primitives[i];
    batch.primitive_b[place] = swapped ? outer.primitives[i] : inner.primitives[j];
    if (batch.count == batch.room) batch.flush(state.partly);
  }
}

// The width is not a template parameter: it determines only the place of leaf boxes, and each copy of this
// function is large.
template <class S, std::size_t padded, bool selected>
void leaf_join(WideLeafJoin<S>& shared) {
  WideLeafJoin<S> state = shared;
  const S rounding = both_roundings(state.ends_a, state.ends_b);
  const auto number = [](const WideArrays<S>& h, LeafSlot slot) {
    return h.nodes[slot.node()].first_leaf + slot.lane();
  };
  const auto rows_of = [](const WideLinearLeaves<S>& leaves, std::uint32_t leaf) {
    const std::size_t place = std::size_t(leaf) * 6 * padded;
    const std::uint32_t begin = leaves.lists.first_entry[leaf], end = leaves.lists.end_entry[leaf];
    return LeafRows<S>{leaves.rows[0] + place, leaves.rows[1] + place, leaves.lists.primitives + begin,
                       end - begin};
  };
  const auto box_of = [rounding, width = state.width](const WideEnds<S>& ends, LeafSlot slot) {
    const std::size_t place = slot.node() * std::size_t(6) * width;
    return reach_of(lane_box(ends.child_bounds[0] + place, width, slot.lane()),
                    lane_box(ends.child_bounds[1] + place, width, slot.lane()), rounding);
  };
  PartlyBatch<S> batch;
  std::size_t made = state.next;
  for (; state.next < state.count && state.throughout.has_room() && state.partly.has_room(); ++state.next) {
    if (state.next == made) {
      RowMaker<S, padded> maker;
      for (; made < state.count && made < state.next + rows_ahead; ++made) {
        maker.want(state.leaves_a, number(state.a, state.pairs[2 * made]));
        maker.want(state.leaves_b, number(state.b, state.pairs[2 * made + 1]));
      }
      maker.make();
    }
    const LeafSlot slot_a = state.pairs[2 * state.next], slot_b = state.pairs[2 * state.next + 1];
    const LeafRows<S> a = rows_of(state.leaves_a, number(state.a, slot_a));
    const LeafRows<S> b = rows_of(state.leaves_b, number(state.b, slot_b));
    const std::uint32_t mask = state.masks != nullptr ? state.masks[state.next] : ~std::uint32_t(0);
    const unsigned near_a = meeting<S, padded>(a.first, a.last, box_of(state.ends_b, slot_b)) & mask;
    const unsigned near_b = meeting<S, padded>(b.first, b.last, box_of(state.ends_a, slot_a)) & mask >> 16;
    const auto count_a = unsigned(__builtin_popcount(near_a)), count_b = unsigned(__builtin_popcount(near_b));
    state.tests += a.count + b.count;
    if (count_a == 0 || count_b == 0) continue;
    if constexpr (selected) {
      // Compares selected primitives of a with all of b, then the others of a with the selected ones of b.
      const unsigned selected_a = state.selected_a[number(state.a, slot_a)];
      const unsigned first = near_a & selected_a, rest = near_a & ~selected_a;
      const unsigned second = rest == 0 ? 0 : near_b & state.selected_b[number(state.b, slot_b)];
      state.tests += std::uint64_t(unsigned(__builtin_popcount(first))) * b.count +
                     std::uint64_t(unsigned(__builtin_popcount(second))) * a.count;
      if (first != 0) leaf_pairs<S, padded>(a, first, b, near_b, rounding, false, state, batch);
      if (second != 0) leaf_pairs<S, padded>(b, second, a, rest, rounding, true, state, batch);
    } else if (count_a <= count_b) {
      state.tests += std::uint64_t(count_a) * b.count;
      leaf_pairs<S, padded>(a, near_a, b, near_b, rounding, false, state, batch);
    } else {
      state.tests += std::uint64_t(count_b) * a.count;
      leaf_pairs<S, padded>(b, near_b, a, near_a, rounding, true, state, batch);
    }
  }
  if (batch.count > 0) batch.flush(state.partly);
  shared = state;
}

template <class S>
constexpr WideLinearKernels<S> table{
    {&at<S, 2>, &at<S, 4>, &at<S, 8>},
    {&join<S, 2, false>, &join<S, 4, false>, &join<S, 8, false>},
    {&leaf_join<S, 4, false>, &leaf_join<S, 8, false>, &leaf_join<S, 16, false>},
    {&make<S, 2>, &make<S, 4>, &make<S, 8>},
    {&join<S, 2, true>, &join<S, 4, true>, &join<S, 8, true>},
    {&join_selected<S, 2, false>, &join_selected<S, 4, false>, &join_selected<S, 8, false>},
    {&join_selected<S, 2, true>, &join_selected<S, 4, true>, &join_selected<S, 8, true>},
    {&leaf_join<S, 4, true>, &leaf_join<S, 8, true>, &leaf_join<S, 16, true>}};

}  // namespace

namespace kernels::KBVH_KERNELS {
const WideLinearKernels<float> wide_linear_float = table<float>;
const WideLinearKernels<double> wide_linear_double = table<double>;
}  // namespace kernels::KBVH_KERNELS

}  // namespace kbvh
