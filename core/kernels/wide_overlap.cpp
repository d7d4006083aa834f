#include "core/kernels/wide_overlap.hpp"

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
[[gnu::always_inline]] inline SixSides<S> own_box(const S* own) {
  return {{own[0], own[1], own[2]}, {own[4], own[5], own[6]}};
}

/// Bit i: lane i of the rows overlaps the box. Empty lanes overlap nothing.
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

/// Child `lane` as a traversal names it.
[[gnu::always_inline]] inline std::uint32_t child(const WideNode& node, std::uint32_t index,
                                                  std::uint32_t lane) {
  return lane < node.leaf_count ? WidePair::leaf_bit | LeafSlot::of(index, lane)
                                : node.first_child + lane - node.leaf_count;
}

/// Two leaves go to the output, everything else to the stack; without a branch, for nobody can predict it.
[[gnu::always_inline]] inline void emit(WideTraversal& state, std::uint32_t first, std::uint32_t second) {
  const bool leaves = (first & second & WidePair::leaf_bit) != 0;
  state.stack[state.depth] = {first, second};
  state.out[2 * state.found] = {first & ~WidePair::leaf_bit};
  state.out[2 * state.found + 1] = {second & ~WidePair::leaf_bit};
  state.depth += leaves ? 0 : 1;
  state.found += leaves ? 1 : 0;
}

enum class Boxes { current, lazy };

template <class S, std::uint32_t width, Boxes boxes>
void traverse(WideArrays<S> a, WideArrays<S> b, WideTraversal& shared) {
  constexpr std::size_t node_rows = 6 * width;
  WideTraversal state = shared;
  while (state.depth > 0 && state.tests < state.test_limit && state.depth + wide_step < state.stack_room &&
         state.found + wide_step < state.out_room) {
    if constexpr (boxes == Boxes::lazy)
      if (state.first_is_stale() || state.second_is_stale()) break;
    const WidePair pair = state.stack[--state.depth];
    if (((pair.first | pair.second) & WidePair::leaf_bit) == 0) {
      const WideNode node_a = a.nodes[pair.first], node_b = b.nodes[pair.second];
      const S* rows_a = a.lanes + pair.first * node_rows;
      const S* rows_b = b.lanes + pair.second * node_rows;
      unsigned first = overlapping<S, width>(rows_a, own_box(b.own + std::size_t(8) * pair.second));
      state.tests += node_a.count + std::uint64_t(unsigned(__builtin_popcount(first))) * node_b.count;
      for (; first != 0; first &= first - 1) {
        const std::uint32_t i = lowest(first), child_a = child(node_a, pair.first, i);
        unsigned second = overlapping<S, width>(rows_b, lane_box(rows_a, width, i));
        for (; second != 0; second &= second - 1)
          emit(state, child_a, child(node_b, pair.second, lowest(second)));
      }
    } else if ((pair.first & WidePair::leaf_bit) != 0) {
      const LeafSlot leaf{pair.first & ~WidePair::leaf_bit};
      const WideNode node = b.nodes[pair.second];
      unsigned hit = overlapping<S, width>(b.lanes + pair.second * node_rows,
                                           lane_box(a.lanes + leaf.node() * node_rows, width, leaf.lane()));
      state.tests += node.count;
      for (; hit != 0; hit &= hit - 1) emit(state, pair.first, child(node, pair.second, lowest(hit)));
    } else {
      const LeafSlot leaf{pair.second & ~WidePair::leaf_bit};
      const WideNode node = a.nodes[pair.first];
      unsigned hit = overlapping<S, width>(a.lanes + pair.first * node_rows,
                                           lane_box(b.lanes + leaf.node() * node_rows, width, leaf.lane()));
      state.tests += node.count;
      for (; hit != 0; hit &= hit - 1) emit(state, child(node, pair.first, lowest(hit)), pair.second);
    }
  }
  shared = state;
}

/// Makes the rows of a leaf: its primitives' boxes, four at a time.
template <class S, std::size_t padded>
[[gnu::noinline]] void fit_leaf(const WideLeaves<S>& leaves, std::uint32_t leaf) {
  using P = Points<S, 1>;
  using Pack = typename P::Pack;
  const std::uint32_t begin = leaves.first_entry[leaf], end = leaves.first_entry[leaf + 1];
  S* rows = leaves.rows + std::size_t(leaf) * 6 * padded;
  for (std::uint32_t quad = 0; quad < padded; quad += 4) {
    Pack lower[4], upper[4];
    for (std::uint32_t j = 0; j < 4; ++j) {
      // Beyond the last one, the last again; those lanes are emptied below.
      const std::uint32_t entry = begin + quad + j < end ? begin + quad + j : end - 1;
      std::uint32_t corner = leaves.first_corner[entry];
      const std::uint32_t last = leaves.first_corner[entry + 1];
      lower[j] = upper[j] = P::load(leaves.positions + leaves.corners[corner], leaves.positions);
      for (++corner; corner < last; ++corner) {
        const Pack p = P::load(leaves.positions + leaves.corners[corner], leaves.positions);
        lower[j] = smaller(lower[j], p);
        upper[j] = larger(upper[j], p);
      }
    }
    P::template store_rows<false>(lower, rows + quad, padded, 4);
    P::template store_rows<true>(upper, rows + 3 * padded + quad, padded, 4);
  }
  for (std::size_t row = 0; row < 6; ++row)
    for (std::size_t i = end - begin; i < padded; ++i) rows[row * padded + i] = S(__builtin_inf());
  leaves.stamps[leaf] = leaves.stamp;
}

template <class S, std::uint32_t width, std::size_t padded>
void leaf_pairs(WideLeafPairs<S>& shared) {
  WideLeafPairs<S> state = shared;
  const auto number = [](const WideArrays<S>& h, LeafSlot slot) {
    return h.nodes[slot.node()].first_leaf + slot.lane();
  };
  for (; state.next < state.count && state.found + leaf_pair_step <= state.out_room; ++state.next) {
    const LeafSlot slot_a = state.pairs[2 * state.next], slot_b = state.pairs[2 * state.next + 1];
    const std::uint32_t leaf_a = number(state.a, slot_a), leaf_b = number(state.b, slot_b);
    if (state.leaves_a.stamps[leaf_a] != state.leaves_a.stamp) fit_leaf<S, padded>(state.leaves_a, leaf_a);
    if (state.leaves_b.stamps[leaf_b] != state.leaves_b.stamp) fit_leaf<S, padded>(state.leaves_b, leaf_b);
    const S* rows_a = state.leaves_a.rows + std::size_t(leaf_a) * 6 * padded;
    const S* rows_b = state.leaves_b.rows + std::size_t(leaf_b) * 6 * padded;
    const std::uint32_t begin_a = state.leaves_a.first_entry[leaf_a],
                        begin_b = state.leaves_b.first_entry[leaf_b];
    const std::uint32_t count_a = state.leaves_a.first_entry[leaf_a + 1] - begin_a;
    const std::uint32_t count_b = state.leaves_b.first_entry[leaf_b + 1] - begin_b;
    const SixSides<S> box_b =
        lane_box(state.b.lanes + slot_b.node() * std::size_t(6) * width, width, slot_b.lane());
    unsigned first = overlapping<S, padded>(rows_a, box_b);
    state.tests += count_a + std::uint64_t(unsigned(__builtin_popcount(first))) * count_b;
    for (; first != 0; first &= first - 1) {
      const std::uint32_t i = lowest(first), primitive_a = state.leaves_a.primitives[begin_a + i];
      unsigned second = overlapping<S, padded>(rows_b, lane_box(rows_a, padded, i));
      for (; second != 0; second &= second - 1) {
        state.out[state.found++] = {state.body_a, primitive_a, state.body_b,
                                    state.leaves_b.primitives[begin_b + lowest(second)]};
      }
    }
  }
  shared = state;
}

template <class S>
constexpr WideOverlapKernels<S> table{&traverse<S, 2, Boxes::current>,
                                      &traverse<S, 4, Boxes::current>,
                                      &traverse<S, 8, Boxes::current>,
                                      {{&leaf_pairs<S, 2, 4>, &leaf_pairs<S, 2, 8>, &leaf_pairs<S, 2, 16>},
                                       {&leaf_pairs<S, 4, 4>, &leaf_pairs<S, 4, 8>, &leaf_pairs<S, 4, 16>},
                                       {&leaf_pairs<S, 8, 4>, &leaf_pairs<S, 8, 8>, &leaf_pairs<S, 8, 16>}},
                                      &traverse<S, 2, Boxes::lazy>,
                                      &traverse<S, 4, Boxes::lazy>,
                                      &traverse<S, 8, Boxes::lazy>};

}  // namespace

namespace kernels::KBVH_KERNELS {
const WideOverlapKernels<float> wide_overlap_float = table<float>;
const WideOverlapKernels<double> wide_overlap_double = table<double>;
}  // namespace kernels::KBVH_KERNELS

}  // namespace kbvh
