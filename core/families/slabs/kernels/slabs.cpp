#include "core/families/slabs/kernels/slabs.hpp"

#include "core/families/slabs/kernels/leaf_block.hpp"
#include "core/families/wide/kernels/wide_traverse.hpp"

namespace kbvh {
namespace {

template <class S, std::size_t padded>
[[gnu::noinline]] void make_block(const WideLeafLists& lists, std::uint32_t leaf, const S* positions,
                                  S* block) {
  load_corners<S, padded>(lists, leaf, positions, block);
  box_corners<S, padded>(lists, leaf, block);
  find_direction<S, padded>(block);
  S* const tail = block + SlabBlock::rows * padded;
  const S direction[3] = {tail[0], tail[1], tail[2]};
  find_extent<S, padded>(block, direction, tail[3], tail[4]);
}

/// Computes the block of a leaf unless it is current.
template <class S, std::size_t padded>
[[gnu::always_inline]] inline const S* block_of(const SlabLeaves<S>& leaves, std::uint32_t leaf) {
  S* const block = leaves.blocks + std::size_t(leaf) * SlabBlock::scalars(padded);
  if (leaves.stamps[leaf] != leaves.stamp) {
    make_block<S, padded>(leaves.lists, leaf, leaves.positions, block);
    leaves.stamps[leaf] = leaves.stamp;
  }
  return block;
}

template <class S, std::size_t padded>
[[gnu::always_inline]] inline Slab<S> slab_of(const S* block, S slack) {
  const S* const tail = block + SlabBlock::rows * padded;
  return {{tail[0], tail[1], tail[2]}, tail[3] - slack, tail[4] + slack};
}

template <class S, std::uint32_t width, std::size_t padded>
void slab_pairs(SlabLeafPairs<S>& shared) {
  SlabLeafPairs<S> state = shared;
  const auto number = [](const WideArrays<S>& h, LeafSlot slot) {
    return h.nodes[slot.node()].first_leaf + slot.lane();
  };
  const WideLeafLists &lists_a = state.leaves_a.lists, &lists_b = state.leaves_b.lists;
  for (; state.next < state.count && state.found + slab_pair_step <= state.room; ++state.next) {
    const LeafSlot slot_a = state.pairs[2 * state.next], slot_b = state.pairs[2 * state.next + 1];
    const std::uint32_t leaf_a = number(state.a, slot_a), leaf_b = number(state.b, slot_b);
    const S* const block_a = block_of<S, padded>(state.leaves_a, leaf_a);
    const S* const block_b = block_of<S, padded>(state.leaves_b, leaf_b);
    const std::uint32_t begin_a = lists_a.first_entry[leaf_a], begin_b = lists_b.first_entry[leaf_b];
    const std::uint32_t count_a = lists_a.end_entry[leaf_a] - begin_a;
    const std::uint32_t count_b = lists_b.end_entry[leaf_b] - begin_b;
    state.tests += count_a + count_b;
    const unsigned of_b = meeting_slab<S, padded>(block_b, slab_of<S, padded>(block_a, state.slack));
    const unsigned of_a = meeting_slab<S, padded>(block_a, slab_of<S, padded>(block_b, state.slack));
    const SixSides<S> box_b =
        lane_box(state.b.child_bounds + slot_b.node() * std::size_t(6) * width, width, slot_b.lane());
    unsigned first = of_b == 0 ? 0 : overlapping<S, padded>(block_a, box_b) & of_a;
    if (first == 0) {
      ++state.separated;
      continue;
    }
    state.tests += count_a + std::uint64_t(unsigned(__builtin_popcount(first))) * count_b;
    alignas(64) std::uint32_t entries_b[16];
    for (std::size_t i = 0; i < 16; ++i)  // behind a leaf's last entry there may be no memory
      entries_b[i] = lists_b.primitives[begin_b + (i < count_b ? i : 0)];
    for (; first != 0; first &= first - 1) {
      const std::uint32_t i = lowest(first), primitive_a = lists_a.primitives[begin_a + i];
      const unsigned second = overlapping<S, padded>(block_b, lane_box(block_a, padded, i)) & of_b;
      for (std::size_t k = 0; k < padded; ++k) state.primitives_a[state.found + k] = primitive_a;
      state.found += pack_lanes(second, entries_b, state.primitives_b + state.found);
    }
  }
  shared = state;
}

template <class S>
constexpr SlabKernels<S> table{{{&slab_pairs<S, 2, 4>, &slab_pairs<S, 2, 8>, &slab_pairs<S, 2, 16>},
                                {&slab_pairs<S, 4, 4>, &slab_pairs<S, 4, 8>, &slab_pairs<S, 4, 16>},
                                {&slab_pairs<S, 8, 4>, &slab_pairs<S, 8, 8>, &slab_pairs<S, 8, 16>}}};

}  // namespace

namespace kernels::KBVH_KERNELS {
const SlabKernels<float> slabs_float = table<float>;
const SlabKernels<double> slabs_double = table<double>;
}  // namespace kernels::KBVH_KERNELS

}  // namespace kbvh
