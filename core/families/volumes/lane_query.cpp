#include "core/families/volumes/lane_query.hpp"

#include <algorithm>
#include <stdexcept>

#include "core/families/volumes/kernels/lane_leaves.hpp"
#include "core/families/wide/leaf_slots.hpp"
#include "core/scene/self_pairs.hpp"

namespace kbvh {
namespace {

constexpr std::size_t found_room = 2048;

}  // namespace

template <class S>
LaneSearch<S>::LaneSearch(const LaneSide<S>& a, const LaneSide<S>& b, KernelSet kernels, LaneScratch& scratch,
                          const Budget& budget, std::uint64_t tests_before)
    : a_(a), b_(b), kernels_(kernels), scratch_(&scratch) {
  if (a.tree->padded_leaf_size() != b.tree->padded_leaf_size())
    throw std::invalid_argument("topologies of all bodies need one leaf size");
  scratch.leaves.resize(2 * leaf_pair_room);
  scratch.found.resize(found_room);
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
  if (a_.body != b_.body) return append(0, count, out);
  scratch_->own.clear();
  const std::size_t different = take_out_own_leaves(scratch_->leaves.data(), count, scratch_->own);
  for (std::size_t i = different; i < count; ++i)
    scratch_->leaves[2 * i] = scratch_->leaves[2 * i + 1] = scratch_->own[i - different];
  const auto within = [&](LeavesOf leaves, std::size_t begin, std::size_t end) {
    const std::size_t before = out.size();
    append(begin, end, out);
    out.resize(before +
               keep_self_pairs(&a_.tree->primitives(), leaves, out.data() + before, out.size() - before));
  };
  within(LeavesOf::two, 0, different);
  within(LeavesOf::one, different, count);
}

template <class S>
void LaneSearch<S>::append(std::size_t begin, std::size_t end, PairBuffer& out) {
  if (begin == end) return;
  LaneLeafPairs<S> job{a_.tree->nodes(),
                       b_.tree->nodes(),
                       a_.tree->leaves(a_.placed),
                       b_.tree->leaves(b_.placed),
                       scratch_->leaves.data(),
                       begin,
                       end,
                       a_.body,
                       b_.body,
                       scratch_->found.data(),
                       0,
                       found_room,
                       0};
  const auto kernel = lane_leaf_kernels<S>(kernels_).pairs(a_.tree->padded_leaf_size());
  while (job.next < job.count) {
    kernel(job);
    const std::size_t before = out.size();
    out.resize(before + job.found);
    for (std::size_t i = 0; i < job.found; ++i)
      out[before + i] = {job.out[i].body_a, job.out[i].primitive_a, job.out[i].body_b,
                         job.out[i].primitive_b};
    job.found = 0;
  }
  box_tests_ += job.tests;
}

template class LaneSearch<float>;
template class LaneSearch<double>;

}  // namespace kbvh
