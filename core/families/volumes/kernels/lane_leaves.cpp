#include "core/families/volumes/kernels/lane_leaves.hpp"

#include "core/families/wide/kernels/leaf_fit.hpp"
#include "core/families/wide/kernels/wide_traverse.hpp"

namespace kbvh {
namespace {

/// Computes the rows of a leaf, and the box around them, unless they are current.
template <class S, std::size_t padded>
[[gnu::always_inline]] inline const S* leaf_rows(const WideLeaves<S>& leaves, std::uint32_t leaf) {
  S* const rows = leaves.rows + std::size_t(leaf) * (6 * padded + 8);
  if (leaves.stamps[leaf] == leaves.stamp) return rows;
  fit_leaf<S, padded>(leaves.lists, leaf, leaves.positions, rows);
  for (std::size_t row = 0; row < 6; ++row) {
    S least = rows[row * padded];
    for (std::size_t i = 1; i < padded; ++i) least = smaller(rows[row * padded + i], least);
    rows[6 * padded + row] = least;
  }
  leaves.stamps[leaf] = leaves.stamp;
  return rows;
}

template <class S, std::size_t padded>
void leaf_pairs(LaneLeafPairs<S>& shared) {
  LaneLeafPairs<S> job = shared;
  for (; job.next < job.count && job.found + leaf_pair_step <= job.out_room; ++job.next) {
    const LeafSlot slot_a = job.pairs[2 * job.next], slot_b = job.pairs[2 * job.next + 1];
    const std::uint32_t leaf_a = job.nodes_a[slot_a.node()].first_leaf + slot_a.lane();
    const std::uint32_t leaf_b = job.nodes_b[slot_b.node()].first_leaf + slot_b.lane();
    const S *const rows_a = leaf_rows<S, padded>(job.leaves_a, leaf_a), *const rows_b = leaf_rows<S, padded>(
                                                                            job.leaves_b, leaf_b);
    const WideLeafLists &lists_a = job.leaves_a.lists, &lists_b = job.leaves_b.lists;
    const std::uint32_t begin_a = lists_a.first_entry[leaf_a], begin_b = lists_b.first_entry[leaf_b];
    const std::uint32_t count_a = lists_a.end_entry[leaf_a] - begin_a;
    const std::uint32_t count_b = lists_b.end_entry[leaf_b] - begin_b;
    unsigned first = overlapping<S, padded>(rows_a, lane_box(rows_b + 6 * padded, 1, 0));
    job.tests += count_a + std::uint64_t(unsigned(__builtin_popcount(first))) * count_b;
    for (; first != 0; first &= first - 1) {
      const std::uint32_t i = lowest(first), primitive_a = lists_a.primitives[begin_a + i];
      unsigned second = overlapping<S, padded>(rows_b, lane_box(rows_a, padded, i));
      for (; second != 0; second &= second - 1)
        job.out[job.found++] = {job.body_a, primitive_a, job.body_b,
                                lists_b.primitives[begin_b + lowest(second)]};
    }
  }
  shared = job;
}

template <class S>
constexpr LaneLeafKernels<S> table{{&leaf_pairs<S, 4>, &leaf_pairs<S, 8>, &leaf_pairs<S, 16>}};

}  // namespace

namespace kernels::KBVH_KERNELS {
const LaneLeafKernels<float> lane_leaf_float = table<float>;
const LaneLeafKernels<double> lane_leaf_double = table<double>;
}  // namespace kernels::KBVH_KERNELS

}  // namespace kbvh
