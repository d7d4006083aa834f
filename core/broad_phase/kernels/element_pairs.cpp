#include "core/broad_phase/kernels/element_pairs.hpp"

#include "core/families/wide/kernels/wide_traverse.hpp"

namespace kbvh {
namespace {

/// Returns a mask. Bit i: lane i of the rows [corners][padded] has one of the vertices.
template <std::uint32_t corners_a, std::uint32_t corners_b, std::size_t padded>
[[gnu::always_inline]] inline unsigned incident(const std::uint32_t (&a)[corners_a], const std::uint32_t* b) {
  constexpr std::size_t native = native_lanes<std::uint32_t>;
  constexpr std::size_t lanes = native < padded ? native : padded;
  using V = Vector<std::uint32_t, lanes>;
  unsigned bits = 0;
  for (std::size_t i = 0; i < padded; i += lanes) {
    if constexpr (lanes == 1) {
      bool same = false;
      for (std::uint32_t row = 0; row < corners_b; ++row)
        for (std::uint32_t c = 0; c < corners_a; ++c) same |= b[row * padded + i] == a[c];
      bits |= unsigned(same) << i;
    } else {
      auto same = load_lanes<V>(b + i) == a[0];
      for (std::uint32_t row = 0; row < corners_b; ++row) {
        const V vertices = load_lanes<V>(b + row * padded + i);
        for (std::uint32_t c = row == 0 ? 1 : 0; c < corners_a; ++c) same |= vertices == a[c];
      }
      bits |= mask_bits(same) << i;
    }
  }
  return bits;
}

/// Appends the pairs of an element and those of a leaf whose bits are set. Writes four pairs in any case: how
/// many bits are set changes from call to call, and a loop over them would be mispredicted each time.
template <bool within_one>
[[gnu::always_inline]] inline std::size_t append(std::uint32_t id, const std::uint32_t* others, unsigned bits,
                                                 std::uint32_t* out) {
  constexpr std::size_t at_once = 4;
  alignas(64) std::uint32_t packed[16] = {};
  const std::size_t count = pack_lanes(bits, others, packed);
  const auto write = [&](std::size_t k) {
    const std::uint32_t other = packed[k];
    out[2 * k] = within_one && other < id ? other : id;
    out[2 * k + 1] = within_one && other < id ? id : other;
  };
  for (std::size_t k = 0; k < at_once; ++k) write(k);
  for (std::size_t k = at_once; k < count; ++k) write(k);
  return count;
}

template <class S, std::uint32_t corners_a, std::uint32_t corners_b, bool within_one, std::size_t padded>
void pairs(ElementPairsJob<S>& shared) {
  ElementPairsJob<S> job = shared;
  constexpr std::uint32_t width = 8;
  const auto number = [](const WideArrays<S>& h, LeafSlot slot) {
    return h.nodes[slot.node()].first_leaf + slot.lane();
  };
  for (; job.next < job.count && job.found + element_pairs_step <= job.out_room; ++job.next) {
    const LeafSlot slot_a = job.pairs[2 * job.next], slot_b = job.pairs[2 * job.next + 1];
    const std::uint32_t leaf_a = number(job.a.tree, slot_a), leaf_b = number(job.b.tree, slot_b);
    const S* const rows_a = job.a.rows + std::size_t(leaf_a) * 6 * padded;
    const S* const rows_b = job.b.rows + std::size_t(leaf_b) * 6 * padded;
    const std::uint32_t* const vertices_a = job.a.corners + std::size_t(leaf_a) * corners_a * padded;
    const std::uint32_t* const vertices_b = job.b.corners + std::size_t(leaf_b) * corners_b * padded;
    const std::uint32_t begin_a = job.a.first_entry[leaf_a], begin_b = job.b.first_entry[leaf_b];
    const std::uint32_t count_a = job.a.end_entry[leaf_a] - begin_a;
    const std::uint32_t count_b = job.b.end_entry[leaf_b] - begin_b;
    const bool same_leaf = within_one && leaf_a == leaf_b;
    const SixSides<S> box_b =
        lane_box(job.b.tree.child_bounds + slot_b.node() * lane_scalars(width), width, slot_b.lane());
    unsigned first = overlapping<S, padded>(rows_a, box_b);
    job.tests += count_a + std::uint64_t(unsigned(__builtin_popcount(first))) * count_b;
    for (; first != 0; first &= first - 1) {
      const std::uint32_t i = lowest(first);
      unsigned second = overlapping<S, padded>(rows_b, lane_box(rows_a, padded, i));
      if (same_leaf) second &= ~1U << i;  // the other half mirrors this one
      std::uint32_t own[corners_a];
      for (std::uint32_t c = 0; c < corners_a; ++c) own[c] = vertices_a[c * padded + i];
      second &= ~incident<corners_a, corners_b, padded>(own, vertices_b);
      job.found +=
          append<within_one>(job.a.ids[begin_a + i], job.b.ids + begin_b, second, job.out + 2 * job.found);
    }
  }
  shared = job;
}

template <class S>
constexpr ElementPairKernels<S> table{
    {{&pairs<S, 1, 1, true, 8>, &pairs<S, 2, 1, false, 8>, &pairs<S, 2, 2, true, 8>,
      &pairs<S, 3, 1, false, 8>, &pairs<S, 2, 3, false, 8>, &pairs<S, 3, 3, true, 8>},
     {&pairs<S, 1, 1, true, 16>, &pairs<S, 2, 1, false, 16>, &pairs<S, 2, 2, true, 16>,
      &pairs<S, 3, 1, false, 16>, &pairs<S, 2, 3, false, 16>, &pairs<S, 3, 3, true, 16>}}};

}  // namespace

namespace kernels::KBVH_KERNELS {
const ElementPairKernels<float> element_pairs_float = table<float>;
const ElementPairKernels<double> element_pairs_double = table<double>;
}  // namespace kernels::KBVH_KERNELS

}  // namespace kbvh
