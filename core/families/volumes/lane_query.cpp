#include "core/families/volumes/lane_query.hpp"

#include <algorithm>
#include <stdexcept>

#include "core/families/volumes/kernels/lane_leaves.hpp"
#include "core/families/wide/leaf_slots.hpp"

namespace kbvh {

template <class S>
LaneSearch<S>::LaneSearch(const LaneSide<S>& a, const LaneSide<S>& b, KernelSet kernels, LaneScratch& scratch,
                          const Budget& budget, std::uint64_t tests_before)
    : a_(a), b_(b), kernels_(kernels), scratch_(&scratch) {
  if (a.tree->padded_leaf_size() != b.tree->padded_leaf_size())
    throw std::invalid_argument("topologies of all bodies need one leaf size");
  scratch.leaves.resize(2 * leaf_pair_room);
  scratch.own.clear();  // left by an abandoned search
  scratch.found.resize(found_at_once);
  state_ = {scratch.stack.data(),
            0,
            scratch.stack.size(),
            scratch.leaves.data(),
            0,
            leaf_pair_room,
            tests_before + 1,
            budget.box_tests};
}

template <class S>
void LaneSearch<S>::grow() {
  if (state_.depth + max_pairs_per_step < state_.stack_room) return;
  scratch_->stack.resize(2 * scratch_->stack.size());
  state_.stack = scratch_->stack.data();
  state_.stack_room = scratch_->stack.size();
}

template <class S>
void LaneSearch<S>::take_leaves(PairBuffer& out) {
  const std::size_t count = state_.found;
  state_.found = 0;
  if (a_.body != b_.body) return append(count, out);
  append_within(LeavesOf::two, take_out_own_leaves(scratch_->leaves.data(), count, scratch_->own), out);
}

template <class S>
void LaneSearch<S>::take_own_leaves(PairBuffer& out) {
  for_own_leaves(scratch_->own, scratch_->leaves.data(), leaf_pair_room,
                 [&](std::size_t count) { append_within(LeavesOf::one, count, out); });
}

template <class S>
void LaneSearch<S>::append_within(LeavesOf leaves, std::size_t count, PairBuffer& out) {
  const std::size_t before = out.size();
  append(count, out);
  out.resize(before +
             keep_self_pairs(&a_.tree->primitives(), leaves, out.data() + before, out.size() - before));
}

template <class S>
void LaneSearch<S>::append(std::size_t count, PairBuffer& out) {
  if (count == 0) return;
  LaneLeafPairs<S> job{a_.tree->nodes(),
                       b_.tree->nodes(),
                       a_.tree->leaves(a_.placed),
                       b_.tree->leaves(b_.placed),
                       scratch_->leaves.data(),
                       0,
                       count,
                       a_.body,
                       b_.body,
                       scratch_->found.data(),
                       0,
                       found_at_once,
                       0};
  const auto kernel = lane_leaf_kernels<S>(kernels_).pairs(a_.tree->padded_leaf_size());
  while (job.next < job.count) {
    kernel(job);
    append_found({job.out, job.found}, out);
    job.found = 0;
  }
  state_.tests += job.tests;
}

template class LaneSearch<float>;
template class LaneSearch<double>;

}  // namespace kbvh
