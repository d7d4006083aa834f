#include "core/families/slabs/kernels/slabs.hpp"

#include "core/families/slabs/kernels/leaf_block.hpp"
#include "core/families/wide/kernels/wide_traverse.hpp"

namespace kbvh {
namespace {

/// Writes the rows of the triangles' own planes.
template <class S, std::size_t padded>
[[gnu::always_inline]] inline void find_planes(const S (&normals)[3][padded], S* block) {
  using V = Vector<S, block_lanes<S, padded>>;
  constexpr std::size_t lanes = block_lanes<S, padded>;
  const S* const corners = block + SlabBlock::corner_row * padded;
  for (std::size_t lane = 0; lane < padded; lane += lanes) {
    V n[3], low, high;
    V size = V{} + S(0);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      n[axis] = load_lanes<V>(normals[axis] + lane);
      store_lanes(block + (SlabBlock::normal_row + axis) * padded + lane, n[axis]);
      size += larger(n[axis], -n[axis]);
    }
    for (std::size_t c = 0; c < 3; ++c) {
      const V d = load_lanes<V>(corners + 3 * c * padded + lane) * n[0] +
                  load_lanes<V>(corners + (3 * c + 1) * padded + lane) * n[1] +
                  load_lanes<V>(corners + (3 * c + 2) * padded + lane) * n[2];
      low = c == 0 ? d : smaller(d, low);
      high = c == 0 ? d : larger(d, high);
    }
    store_lanes(block + SlabBlock::low_row * padded + lane, low);
    store_lanes(block + SlabBlock::high_row * padded + lane, high);
    store_lanes(block + SlabBlock::size_row * padded + lane, size);
  }
}

template <class S, std::size_t padded>
[[gnu::noinline]] void make_block(const WideLeafLists& lists, std::uint32_t leaf, const S* positions,
                                  S* block) {
  S *const corners = block + SlabBlock::corner_row * padded, *const tail = block + SlabBlock::rows * padded;
  alignas(64) S normals[3][padded];
  load_corners<S, padded>(lists, leaf, positions, corners);
  box_corners<S, padded>(lists, leaf, block);
  find_normals<S, padded>(corners, normals);
  find_direction<S, padded>(normals, lists.end_entry[leaf] - lists.first_entry[leaf], tail);
  find_planes<S, padded>(normals, block);
  const S direction[3] = {tail[0], tail[1], tail[2]};
  find_extent<S, padded>(corners, direction, tail[3], tail[4]);
  tail[5] = largest_coordinate<S, padded>(corners);
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

/// Returns the slab around one triangle. If products could overflow, it contains everything.
template <class S, std::size_t padded>
[[gnu::always_inline]] inline Slab<S> plane_of(const S* block, std::size_t i, S slack) {
  constexpr S most = sizeof(S) == 4 ? S(0x1p96) : S(0x1p960),
              tiny = sizeof(S) == 4 ? S(0x1p-126) : S(0x1p-1022);
  const S* const row = block + i;
  const S scaled = row[SlabBlock::size_row * padded] * slack;
  const S own = scaled < most ? scaled + tiny : S(__builtin_inf());
  return {{row[SlabBlock::normal_row * padded], row[(SlabBlock::normal_row + 1) * padded],
           row[(SlabBlock::normal_row + 2) * padded]},
          row[SlabBlock::low_row * padded] - own,
          row[SlabBlock::high_row * padded] + own};
}

template <class S, std::uint32_t width, std::size_t padded>
void slab_pairs(SlabLeafPairs<S>& shared) {
  SlabLeafPairs<S> state = shared;
  constexpr S least = sizeof(S) == 4 ? S(0x1p-126) : S(0x1p-1022);  // what underflow loses
  const auto number = [](const WideArrays<S>& h, LeafSlot slot) {
    return h.nodes[slot.node()].first_leaf + slot.lane();
  };
  const WideLeafLists &lists_a = state.leaves_a.lists, &lists_b = state.leaves_b.lists;
  for (; state.next < state.count && state.found + slab_pair_step <= state.room; ++state.next) {
    const LeafSlot slot_a = state.pairs[2 * state.next], slot_b = state.pairs[2 * state.next + 1];
    const std::uint32_t leaf_a = number(state.a, slot_a), leaf_b = number(state.b, slot_b);
    const S* const block_a = block_of<S, padded>(state.leaves_a, leaf_a);
    const S* const block_b = block_of<S, padded>(state.leaves_b, leaf_b);
    const S* const corners_a = block_a + SlabBlock::corner_row * padded;
    const S* const corners_b = block_b + SlabBlock::corner_row * padded;
    const std::uint32_t begin_a = lists_a.first_entry[leaf_a], begin_b = lists_b.first_entry[leaf_b];
    const std::uint32_t count_a = lists_a.end_entry[leaf_a] - begin_a;
    const std::uint32_t count_b = lists_b.end_entry[leaf_b] - begin_b;
    state.tests += count_a + count_b;
    constexpr std::size_t largest = SlabBlock::rows * padded + 5;
    const S slack = state.rounding * (block_a[largest] + block_b[largest]) + least;
    const unsigned of_b = meeting_slab<S, padded>(corners_b, slab_of<S, padded>(block_a, slack));
    const unsigned of_a = meeting_slab<S, padded>(corners_a, slab_of<S, padded>(block_b, slack));
    const SixSides<S> box_b =
        lane_box(state.b.child_bounds + slot_b.node() * std::size_t(6) * width, width, slot_b.lane());
    unsigned first = of_b == 0 ? 0 : overlapping<S, padded>(block_a, box_b) & of_a;
    if (first == 0) {
      ++state.separated;
      continue;
    }
    state.tests += count_a + std::uint64_t(unsigned(__builtin_popcount(first))) * count_b;
    alignas(64) std::uint32_t entries_b[16];
    for (std::size_t i = 0; i < 16; ++i)  // memory may end after a leaf's last entry
      entries_b[i] = lists_b.primitives[begin_b + (i < count_b ? i : 0)];
    for (; first != 0; first &= first - 1) {
      const std::uint32_t i = lowest(first), primitive_a = lists_a.primitives[begin_a + i];
      unsigned second = overlapping<S, padded>(block_b, lane_box(block_a, padded, i)) & of_b;
      second &= meeting_slab<S, padded>(corners_b, plane_of<S, padded>(block_a, i, slack));
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
