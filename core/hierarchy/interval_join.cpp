#include "core/hierarchy/interval_join.hpp"

#include <algorithm>

namespace kbvh {

namespace {
/// Leaf pairs that are collected before they are turned into pairs of primitives: few enough to stay in the
/// cache.
constexpr std::size_t leaf_pair_room = 2048;
constexpr std::size_t chunk_room = 2048;
}  // namespace

template <class S>
WideLinearLeaves<S> IntervalJoin<S>::leaves(typename LinearBounds<S>::Side& side, std::uint32_t which) {
  Leaves& own = leaves_[which];
  const std::size_t size =
      side.hierarchy.leaf_count() * lane_scalars(std::max(4u, side.hierarchy.padded_leaf_size()));
  // Rows of a body that stays at rest where it was are those of the last segment.
  const bool same = own.at_rest && side.at_rest && own.positions[0] == side.positions[0] && own.stamp != 0;
  if (own.stamps.size() != side.hierarchy.leaf_count()) {
    own.stamps.assign(side.hierarchy.leaf_count(), 0);
    own.stamp = 1;
  } else if (!same && ++own.stamp == 0) {
    std::fill(own.stamps.begin(), own.stamps.end(), 0);
    own.stamp = 1;
  }
  own.at_rest = side.at_rest;
  for (std::uint32_t end = 0; end < (side.at_rest ? 1u : 2u); ++end) own.rows[end].resize(size);
  for (std::uint32_t end = 0; end < 2; ++end) own.positions[end] = side.positions[end];
  return {side.hierarchy.leaf_lists(),
          {own.rows[0].data(), own.rows[side.at_rest ? 0 : 1].data()},
          own.stamps.data(),
          own.stamp,
          {own.positions[0], own.positions[1]}};
}

template <class S>
void IntervalJoin<S>::join(LinearBounds<S>& bounds, std::uint32_t body_a, std::uint32_t body_b,
                           std::uint64_t& tests) {
  body_a_ = body_a;
  body_b_ = body_b;
  found_.clear();
  auto &a = bounds.side(body_a), &b = bounds.side(body_b);
  if (!a.hierarchy.empty() && !b.hierarchy.empty()) {
    const std::uint32_t width = a.hierarchy.topology().width;
    const WideLinearKernels<S>& kernels = wide_linear_kernels<S>(a.hierarchy.kernels());
    stack_.resize(std::max<std::size_t>(stack_.size(), 1024));
    leaf_pairs_.resize(2 * leaf_pair_room);
    chunk_.resize(chunk_room);
    const auto no_limit = Budget{}.box_tests;
    WideTraversal state{stack_.data(), 0, stack_.size(), leaf_pairs_.data(), 0, leaf_pair_room, 1, no_limit};
    // A root that is a leaf lies in a node's only lane, so that the roots are compared with each other there.
    state.stack[state.depth++] = {0, 0};
    WideLeafJoin<S> leaf_join{a.hierarchy.arrays(),
                              b.hierarchy.arrays(),
                              a.ends(),
                              b.ends(),
                              leaves(a, 0),
                              leaves(b, 1),
                              leaf_pairs_.data(),
                              0,
                              0,
                              chunk_.data(),
                              0,
                              chunk_room,
                              0};
    const auto pairs_of_leaves = kernels.leaf_join(
        width, std::max(4u, std::max(a.hierarchy.padded_leaf_size(), b.hierarchy.padded_leaf_size())));
    while (state.depth > 0) {
      kernels.join(width)(leaf_join.a, leaf_join.ends_a, leaf_join.b, leaf_join.ends_b, state);
      leaf_join.next = 0;
      leaf_join.count = state.found;
      while (leaf_join.next < leaf_join.count) {
        pairs_of_leaves(leaf_join);
        found_.insert(found_.end(), chunk_.begin(), chunk_.begin() + std::ptrdiff_t(leaf_join.found));
        leaf_join.found = 0;
      }
      state.found = 0;
      if (state.depth + wide_step >= state.stack_room) {
        stack_.resize(2 * stack_.size());
        state.stack = stack_.data();
        state.stack_room = stack_.size();
      }
    }
    tests += state.tests + leaf_join.tests;
  }
  sort_by_begin();
}

template <class S>
void IntervalJoin<S>::sort_by_begin() {
  const auto bucket = [](const JoinedPair& pair) {
    return std::min(buckets - 1, std::uint32_t(pair.begin * float(buckets)));
  };
  std::uint32_t place[buckets] = {};
  for (const JoinedPair& pair : found_) ++place[bucket(pair)];
  std::uint32_t sum = 0;
  for (std::uint32_t k = 0; k < buckets; ++k) {
    const std::uint32_t count = place[k];
    place[k] = sum;
    sum += count;
    bucket_end_[k] = sum;
  }
  sorted_.resize(found_.size());
  for (const JoinedPair& pair : found_) sorted_[place[bucket(pair)]++] = pair;
  next_ = 0;
  waiting_.clear();
}

template <class S>
void IntervalJoin<S>::read(float fraction, PairBuffer& out) {
  const std::uint32_t open = bucket_end_[std::min(buckets - 1, std::uint32_t(fraction * float(buckets)))];
  const std::size_t before = out.size(), old = waiting_.size();
  const std::size_t room = old + (open - next_);
  waiting_.resize(room);
  for (std::uint32_t i = next_; i < open; ++i) waiting_[old + (i - next_)] = i;
  next_ = open;
  out.resize(before + room);
  std::size_t found = 0, kept = 0;
  PrimitivePair* const pairs = out.data() + before;
  for (std::size_t i = 0; i < room; ++i) {
    const std::uint32_t index = waiting_[i];
    const JoinedPair pair = sorted_[index];
    pairs[found] = {body_a_, pair.primitive_a, body_b_, pair.primitive_b};
    waiting_[kept] = index;
    const bool ended = pair.end < fraction;
    found += !ended && pair.begin <= fraction ? 1 : 0;
    kept += ended ? 0 : 1;
  }
  waiting_.resize(kept);
  out.resize(before + found);
}

template <class S>
std::size_t IntervalJoin<S>::bytes() const {
  std::size_t total = 0;
  for (const Leaves& own : leaves_)
    total +=
        (own.rows[0].size() + own.rows[1].size()) * sizeof(S) + own.stamps.size() * sizeof(std::uint32_t);
  return total + stack_.size() * sizeof(WidePair) + leaf_pairs_.size() * sizeof(LeafSlot) +
         (chunk_.size() + found_.capacity() + sorted_.capacity()) * sizeof(JoinedPair) +
         waiting_.capacity() * sizeof(std::uint32_t);
}

template class IntervalJoin<float>;
template class IntervalJoin<double>;

}  // namespace kbvh
