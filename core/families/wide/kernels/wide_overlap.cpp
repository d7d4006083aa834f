#include "core/families/wide/kernels/wide_overlap.hpp"

#include "core/families/wide/kernels/leaf_fit.hpp"
#include "core/families/wide/kernels/wide_traverse.hpp"

namespace kbvh {
namespace {

/// Stored boxes, some of which are computed at their first use: the traversal pauses for this.
template <class S, std::uint32_t width>
struct LazyView : StoredView<S, width> {
  using StoredView<S, width>::StoredView;
  [[gnu::always_inline]] static bool waits(const WideTraversal& state) {
    return state.first_is_stale() || state.second_is_stale();
  }
};

/// A hierarchy with itself.
template <class S, std::uint32_t width>
struct SelfView : StoredView<S, width> {
  using StoredView<S, width>::StoredView;
  static constexpr bool within_one = true;
};

template <template <class, std::uint32_t> class View, class S, std::uint32_t width>
void traverse(WideArrays<S> a, WideArrays<S> b, WideTraversal& state) {
  View<S, width> view(a, b);
  traverse_pairs(a, b, view, state);
}

constexpr std::size_t leaf_pairs_at_once = 4;

/// Computes the rows of a leaf unless they are current.
template <class S, std::size_t padded>
[[gnu::always_inline]] inline const S* leaf_rows(const WideLeaves<S>& leaves, std::uint32_t leaf) {
  S* rows = leaves.rows + std::size_t(leaf) * 6 * padded;
  if (leaves.stamps[leaf] != leaves.stamp) {
    fit_leaf<S, padded>(leaves.lists, leaf, leaves.positions, rows);
    leaves.stamps[leaf] = leaves.stamp;
  }
  return rows;
}

/// Appends the pairs of one primitive and those primitives of a leaf whose bits are set. Always writes four
/// pairs: the number of set bits changes from call to call, so a loop over them would be mispredicted each
/// time.
[[gnu::always_inline]] inline std::size_t emit_pairs(FoundPair pair, const std::uint32_t* primitives_b,
                                                     unsigned bits, FoundPair* out) {
  alignas(64) std::uint32_t packed[16] = {};
  const unsigned count = pack_lanes(bits, primitives_b, packed);
  for (std::size_t k = 0; k < leaf_pairs_at_once; ++k)
    out[k] = {pair.body_a, pair.primitive_a, pair.body_b, packed[k]};
  for (std::size_t k = leaf_pairs_at_once; k < count; ++k)
    out[k] = {pair.body_a, pair.primitive_a, pair.body_b, packed[k]};
  return count;
}

template <class S, std::uint32_t width, std::size_t padded>
void leaf_pairs(WideLeafPairs<S>& shared) {
  WideLeafPairs<S> state = shared;
  const auto number = [](const WideArrays<S>& h, LeafSlot slot) {
    return h.nodes[slot.node()].first_leaf + slot.lane();
  };
  for (; state.next < state.count && state.found + leaf_pair_step + leaf_pairs_at_once <= state.out_room;
       ++state.next) {
    const LeafSlot slot_a = state.pairs[2 * state.next], slot_b = state.pairs[2 * state.next + 1];
    const std::uint32_t leaf_a = number(state.a, slot_a), leaf_b = number(state.b, slot_b);
    const S* rows_a = leaf_rows<S, padded>(state.leaves_a, leaf_a);
    const S* rows_b = leaf_rows<S, padded>(state.leaves_b, leaf_b);
    const WideLeafLists &lists_a = state.leaves_a.lists, &lists_b = state.leaves_b.lists;
    const std::uint32_t begin_a = lists_a.first_entry[leaf_a], begin_b = lists_b.first_entry[leaf_b];
    const std::uint32_t count_a = lists_a.end_entry[leaf_a] - begin_a;
    const std::uint32_t count_b = lists_b.end_entry[leaf_b] - begin_b;
    const SixSides<S> box_b =
        lane_box(state.b.child_bounds + slot_b.node() * std::size_t(6) * width, width, slot_b.lane());
    unsigned first = overlapping<S, padded>(rows_a, box_b);
    state.tests += count_a + std::uint64_t(unsigned(__builtin_popcount(first))) * count_b;
    for (; first != 0; first &= first - 1) {
      const std::uint32_t i = lowest(first), primitive_a = lists_a.primitives[begin_a + i];
      const unsigned second = overlapping<S, padded>(rows_b, lane_box(rows_a, padded, i));
      state.found += emit_pairs({state.body_a, primitive_a, state.body_b, 0}, lists_b.primitives + begin_b,
                                second, state.out + state.found);
    }
  }
  shared = state;
}

template <class S>
constexpr WideOverlapKernels<S> table{
    &traverse<StoredView, S, 2>,
    &traverse<StoredView, S, 4>,
    &traverse<StoredView, S, 8>,
    {{&leaf_pairs<S, 2, 4>, &leaf_pairs<S, 2, 8>, &leaf_pairs<S, 2, 16>},
     {&leaf_pairs<S, 4, 4>, &leaf_pairs<S, 4, 8>, &leaf_pairs<S, 4, 16>},
     {&leaf_pairs<S, 8, 4>, &leaf_pairs<S, 8, 8>, &leaf_pairs<S, 8, 16>}},
    &traverse<LazyView, S, 2>,
    &traverse<LazyView, S, 4>,
    &traverse<LazyView, S, 8>,
    {&traverse<SelfView, S, 2>, &traverse<SelfView, S, 4>, &traverse<SelfView, S, 8>}};

}  // namespace

namespace kernels::KBVH_KERNELS {
const WideOverlapKernels<float> wide_overlap_float = table<float>;
const WideOverlapKernels<double> wide_overlap_double = table<double>;
}  // namespace kernels::KBVH_KERNELS

}  // namespace kbvh
