#include "core/families/sweep/kernels/sweep.hpp"

#include "core/families/wide/kernels/wide_traverse.hpp"

namespace kbvh {
namespace {

constexpr std::size_t block_scalars = 6 * sweep_block;

template <class S>
[[gnu::always_inline]] inline bool meet(const SixSides<S>& a, const SixSides<S>& b) {
  bool all = true;
  for (int axis = 0; axis < 3; ++axis)
    all &= (a.lower[axis] <= b.upper[axis]) & (b.lower[axis] <= a.upper[axis]);
  return all;
}

template <class S, bool within_one>
void sweep(SweepJob<S>& shared) {
  SweepJob<S> job = shared;
  const SweepSide<S>&a = job.a, &b = job.b;
  const std::uint32_t blocks = (b.count + sweep_block - 1) / sweep_block;
  const SixSides<S> all_of_b = own_box(b.box);
  for (; job.next < a.count; ++job.next, job.block = SweepJob<S>::no_block) {
    const std::uint32_t own_block = job.next / sweep_block, lane = job.next % sweep_block;
    const SixSides<S> box = lane_box(a.rows + own_block * block_scalars, sweep_block, lane);
    if (job.block == SweepJob<S>::no_block) {
      if (!within_one && !meet(box, all_of_b)) continue;
      // Lower sides ascend, so boxes that end before this one begins are not needed again.
      while (!within_one && b.reach[job.first_block] < box.lower[job.axis]) ++job.first_block;
      job.block = within_one ? own_block : job.first_block;
    }
    for (; job.block < blocks; ++job.block) {
      if (job.found + sweep_block > job.out_room) {
        shared = job;
        return;
      }
      const S* const rows = b.rows + job.block * block_scalars;
      if (rows[job.axis * sweep_block] > box.upper[job.axis]) break;
      unsigned hit = overlapping<S, sweep_block>(rows, box);
      if (within_one && job.block == own_block) hit &= ~1U << lane;
      job.tests += sweep_block;
      for (; hit != 0; hit &= hit - 1)
        job.out[job.found++] = {a.body, a.primitives[job.next], b.body,
                                b.primitives[job.block * sweep_block + lowest(hit)]};
    }
  }
  shared = job;
}

template <class S>
constexpr SweepKernels<S> table{&sweep<S, false>, &sweep<S, true>};

}  // namespace

namespace kernels::KBVH_KERNELS {
const SweepKernels<float> sweep_float = table<float>;
const SweepKernels<double> sweep_double = table<double>;
}  // namespace kernels::KBVH_KERNELS

}  // namespace kbvh
