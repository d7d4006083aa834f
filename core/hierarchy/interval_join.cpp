#include "core/hierarchy/interval_join.hpp"

#include <algorithm>

#include "core/hierarchy/self_pairs.hpp"

namespace kbvh {

namespace {
/// Leaf pairs that are collected before they are turned into pairs of primitives: few enough to stay in the
/// cache.
constexpr std::size_t leaf_pair_room = 2048;
/// Room for pairs of primitives that is made at least.
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
  const bool self = body_a == body_b;
  std::size_t found = 0;
  if (bounds.side(body_a).apart || bounds.side(body_b).apart)  // rows are made anew when they meet again
    leaves_[0].at_rest = leaves_[1].at_rest = false;
  auto &a = bounds.side(body_a), &b = bounds.side(body_b);
  if (!a.hierarchy.empty() && !b.hierarchy.empty() && !a.apart && !b.apart) {
    const std::uint32_t width = a.hierarchy.topology().width;
    const WideLinearKernels<S>& kernels = wide_linear_kernels<S>(a.hierarchy.kernels());
    stack_.resize(std::max<std::size_t>(stack_.size(), 1024));
    leaf_pairs_.resize(2 * leaf_pair_room);
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
                              nullptr,
                              0,
                              0,
                              0};
    const auto pairs_of_leaves = kernels.leaf_join(
        width, std::max(4u, std::max(a.hierarchy.padded_leaf_size(), b.hierarchy.padded_leaf_size())));
    const auto take_leaves = [&](std::size_t end) {
      leaf_join.count = end;
      while (leaf_join.next < leaf_join.count) {
        if (found_.size() < leaf_join.found + chunk_room) found_.resize(2 * leaf_join.found + chunk_room);
        leaf_join.out = found_.data();
        leaf_join.out_room = found_.size();
        pairs_of_leaves(leaf_join);
      }
    };
    const auto take_self_leaves = [&](std::size_t end, LeavesOf leaves) {
      const std::size_t before = leaf_join.found;
      take_leaves(end);
      const Primitives* neighbours = with_neighbours_ ? nullptr : &bounds.scene().primitives(body_a);
      leaf_join.found =
          before + keep_self_pairs(neighbours, leaves, found_.data() + before, leaf_join.found - before);
    };
    const auto traverse = self ? kernels.self(width) : kernels.join(width);
    while (state.depth > 0) {
      traverse(leaf_join.a, leaf_join.ends_a, leaf_join.b, leaf_join.ends_b, state);
      leaf_join.next = 0;
      if (self) {
        take_self_leaves(different_leaves_first(leaf_pairs_.data(), state.found), LeavesOf::two);
        take_self_leaves(state.found, LeavesOf::one);
      } else {
        take_leaves(state.found);
      }
      state.found = 0;
      if (state.depth + wide_step >= state.stack_room) {
        stack_.resize(2 * stack_.size());
        state.stack = stack_.data();
        state.stack_room = stack_.size();
      }
    }
    tests += state.tests + leaf_join.tests;
    found = leaf_join.found;
  }
  sort_by_begin({found_.data(), found});
}

template <class S>
void IntervalJoin<S>::sort_by_begin(std::span<const JoinedPair> found) {
  const auto bucket = [](const JoinedPair& pair) { return FractionBuckets::of(pair.begin); };
  std::uint32_t place[FractionBuckets::count] = {};
  for (const JoinedPair& pair : found) ++place[bucket(pair)];
  std::uint32_t sum = 0;
  for (std::uint32_t k = 0; k < FractionBuckets::count; ++k) {
    const std::uint32_t count = place[k];
    place[k] = sum;
    sum += count;
    bucket_end_[k] = sum;
  }
  sorted_.resize(found.size());
  for (const JoinedPair& pair : found) sorted_[place[bucket(pair)]++] = pair;
  next_ = 0;
  waiting_.clear();
  alive_count_ = 0;
  if (alive_.size() < sorted_.size()) {
    alive_.resize(sorted_.size());
    alive_places_.resize(sorted_.size());
  }
  next_ending_.resize(sorted_.size());
  place_.resize(sorted_.size());
  std::fill(std::begin(ending_), std::end(ending_), none);
  present_ = 0;
}

template <class S>
void IntervalJoin<S>::begin_pair(std::uint32_t index) {
  const JoinedPair pair = sorted_[index];
  const std::uint32_t bucket = FractionBuckets::of(pair.end), place = alive_count_++;
  next_ending_[index] = ending_[bucket];
  ending_[bucket] = index;
  place_[index] = place;
  alive_[place] = {body_a_, pair.primitive_a, body_b_, pair.primitive_b};
  alive_places_[place] = index;
}

template <class S>
void IntervalJoin<S>::end_pair(std::uint32_t index) {
  const std::uint32_t place = place_[index], last = --alive_count_;
  alive_[place] = alive_[last];
  alive_places_[place] = alive_places_[last];
  place_[alive_places_[place]] = place;
}

template <class S>
void IntervalJoin<S>::read(float fraction, PairBuffer& out) {
  const std::uint32_t bucket = FractionBuckets::of(fraction);
  // What begins: all of earlier buckets, some of the present one.
  std::size_t kept = 0;
  const auto begin_or_wait = [&](std::uint32_t index) {
    const JoinedPair& pair = sorted_[index];
    if (pair.begin > fraction)
      waiting_[kept++] = index;
    else if (pair.end >= fraction)
      begin_pair(index);
  };
  const std::size_t before = waiting_.size();
  waiting_.resize(before + (bucket_end_[bucket] - next_));
  for (std::size_t i = 0; i < before; ++i) begin_or_wait(waiting_[i]);
  for (; next_ < bucket_end_[bucket]; ++next_) begin_or_wait(next_);
  waiting_.resize(kept);
  // What ends: the lists of earlier buckets as a whole.
  for (; present_ < bucket; ++present_) {
    for (std::uint32_t index = ending_[present_]; index != none; index = next_ending_[index]) end_pair(index);
    ending_[present_] = none;
  }
  for (std::uint32_t* link = &ending_[bucket]; *link != none;) {
    const std::uint32_t index = *link;
    if (sorted_[index].end < fraction) {
      *link = next_ending_[index];
      end_pair(index);
    } else {
      link = &next_ending_[index];
    }
  }
  out.insert(out.end(), alive_.begin(), alive_.begin() + std::ptrdiff_t(alive_count_));
}

template <class S>
std::size_t IntervalJoin<S>::bytes() const {
  std::size_t total = 0;
  for (const Leaves& own : leaves_)
    total +=
        (own.rows[0].size() + own.rows[1].size()) * sizeof(S) + own.stamps.size() * sizeof(std::uint32_t);
  return total + stack_.size() * sizeof(WidePair) + leaf_pairs_.size() * sizeof(LeafSlot) +
         (found_.capacity() + sorted_.capacity()) * sizeof(JoinedPair) +
         alive_.capacity() * sizeof(PrimitivePair) +
         (waiting_.capacity() + alive_places_.capacity() + next_ending_.capacity() + place_.capacity()) *
             sizeof(std::uint32_t);
}

template class IntervalJoin<float>;
template class IntervalJoin<double>;

}  // namespace kbvh
