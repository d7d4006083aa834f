#include "core/families/slabs/kernels/slab_spans.hpp"

#include "core/families/slabs/kernels/leaf_block.hpp"

namespace kbvh {
namespace {

template <class S, std::size_t padded>
[[gnu::noinline]] void make_span_block(const WideLeafLists& lists, std::uint32_t leaf, const S* positions,
                                       S* block) {
  load_corners<S, padded>(lists, leaf, positions, block);
  alignas(64) S normals[3][padded];
  find_normals<S, padded>(block, normals);
  find_direction<S, padded>(normals, lists.end_entry[leaf] - lists.first_entry[leaf],
                            block + SpanBlock::rows * padded);
}

/// The corners of one leaf at both ends, and its slab.
template <class S>
struct SpanLeaf {
  const S* blocks[2];
  const SpanSlab<S>* slab;
};

template <class S, std::size_t padded>
[[gnu::noinline]] void make_slab(const SpanLeaf<S>& leaf, SpanSlab<S>& slab) {
  // The mean direction of both ends; they are normalised, and opposite directions separate nothing.
  for (std::size_t axis = 0; axis < 3; ++axis)
    slab.direction[axis] = S(0.5) * (leaf.blocks[0][SpanBlock::rows * padded + axis] +
                                     leaf.blocks[1][SpanBlock::rows * padded + axis]);
  for (std::size_t end = 0; end < 2; ++end)
    find_extent<S, padded>(leaf.blocks[end], slab.direction, slab.low[end], slab.high[end]);
  slab.largest =
      larger(largest_coordinate<S, padded>(leaf.blocks[0]), largest_coordinate<S, padded>(leaf.blocks[1]));
}

template <class S, std::size_t padded>
[[gnu::always_inline]] inline SpanLeaf<S> span_of(const SlabSpanLeaves<S>& leaves, std::uint32_t leaf) {
  const std::size_t place = std::size_t(leaf) * SpanBlock::scalars(padded);
  return {{leaves.blocks[0] + place, leaves.blocks[1] + place}, leaves.slabs + leaf};
}

template <class S, std::size_t padded>
[[gnu::noinline]] void make_span(const SlabSpanLeaves<S>& leaves, std::uint32_t leaf) {
  const std::size_t place = std::size_t(leaf) * SpanBlock::scalars(padded);
  for (std::size_t end = 0; end < 2; ++end) {
    if (leaves.stamps[end][leaf] == leaves.stamp[end]) continue;
    leaves.stamps[end][leaf] = leaves.stamp[end];
    make_span_block<S, padded>(leaves.lists, leaf, leaves.positions[end], leaves.blocks[end] + place);
  }
  make_slab<S, padded>(span_of<S, padded>(leaves, leaf), leaves.slabs[leaf]);
}

template <class S, std::size_t padded>
void make_spans(const SlabSpanLeaves<S>& leaves, const std::uint32_t* list, std::size_t count) {
  for (std::size_t i = 0; i < count; ++i) make_span<S, padded>(leaves, list[i]);
}

/// Computes the parts of a leaf that are not current.
template <class S, std::size_t padded>
[[gnu::always_inline]] inline SpanLeaf<S> span_leaf(const SlabSpanLeaves<S>& leaves, std::uint32_t leaf) {
  if (leaves.slab_stamps[leaf] != leaves.slab_stamp) {
    make_span<S, padded>(leaves, leaf);
    leaves.slab_stamps[leaf] = leaves.slab_stamp;
  }
  return span_of<S, padded>(leaves, leaf);
}

/// Returns a mask. Bit i: triangle i may leave one side of the slab.
template <class S, std::size_t padded>
[[gnu::always_inline]] inline unsigned meeting_slab(const SpanLeaf<S>& leaf, const SpanSlab<S>& slab,
                                                    S slack) {
  using V = Vector<S, block_lanes<S, padded>>;
  constexpr std::size_t lanes = block_lanes<S, padded>;
  const S low[2] = {slab.low[0] - slack, slab.low[1] - slack};
  const S high[2] = {slab.high[0] + slack, slab.high[1] + slack};
  unsigned bits = 0;
  for (std::size_t lane = 0; lane < padded; lane += lanes) {
    V l0, h0, l1, h1;
    project<S, padded, V>(leaf.blocks[0], lane, slab.direction, l0, h0);
    project<S, padded, V>(leaf.blocks[1], lane, slab.direction, l1, h1);
    const auto meets = ((h0 >= low[0]) | (h1 >= low[1])) & ((l0 <= high[0]) | (l1 <= high[1]));
    if constexpr (lanes == 1)
      bits |= unsigned(meets) << lane;
    else
      bits |= mask_bits(meets) << lane;
  }
  return bits;
}

template <class S, std::size_t padded>
void filter(SlabSpanPairs<S>& shared) {
  SlabSpanPairs<S> state = shared;
  constexpr S least = sizeof(S) == 4 ? S(0x1p-126) : S(0x1p-1022);  // what underflow loses
  const auto number = [](const WideArrays<S>& h, LeafSlot slot) {
    return h.nodes[slot.node()].first_leaf + slot.lane();
  };
  std::size_t kept = 0;
  for (std::size_t i = 0; i < state.count; ++i) {
    const LeafSlot slot_a = state.pairs[2 * i], slot_b = state.pairs[2 * i + 1];
    const SpanLeaf<S> a = span_leaf<S, padded>(state.leaves_a, number(state.a, slot_a));
    const SpanLeaf<S> b = span_leaf<S, padded>(state.leaves_b, number(state.b, slot_b));
    const S slack = state.rounding * (a.slab->largest + b.slab->largest) + least;
    const unsigned of_b = meeting_slab<S, padded>(b, *a.slab, slack);
    const unsigned of_a = meeting_slab<S, padded>(a, *b.slab, slack);
    state.pairs[2 * kept] = slot_a;
    state.pairs[2 * kept + 1] = slot_b;
    state.masks[kept] = of_a | of_b << 16;
    kept += ((of_a != 0) & (of_b != 0)) ? 1 : 0;
  }
  state.tests += 2 * state.count;
  state.count = kept;
  shared = state;
}

template <class S>
constexpr SlabSpanKernels<S> table{{&filter<S, 4>, &filter<S, 8>, &filter<S, 16>},
                                   {&make_spans<S, 4>, &make_spans<S, 8>, &make_spans<S, 16>}};

}  // namespace

namespace kernels::KBVH_KERNELS {
const SlabSpanKernels<float> slab_spans_float = table<float>;
const SlabSpanKernels<double> slab_spans_double = table<double>;
}  // namespace kernels::KBVH_KERNELS

}  // namespace kbvh
