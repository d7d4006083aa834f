#include "core/families/linear/interval_join.hpp"

#include <algorithm>
#include <limits>

#include "core/families/wide/leaf_slots.hpp"
#include "core/topology/traversal.hpp"

namespace kbvh {

template <class S>
void IntervalJoin<S>::start(const LinearSegment<S>& segment, const SceneView<S>& scene,
                            std::span<const BodyPair> bodies, std::size_t leaf_pairs) {
  segment_ = &segment;
  scene_ = scene;
  bodies_.assign(bodies.begin(), bodies.end());
  found_.clear();
  leaf_pairs_room_ = leaf_pairs;
  node_tests_ = 0;
  reading_ = indexed_ = has_beginning_ = false;
  following_ = {};
  throughout_ = count_ = 0;
  traversal_ = {};
  own_leaves_.clear();
  leaf_join_ = {};
  leaf_join_.throughout = found_throughout_.view(0, false);
  leaf_join_.partly = found_partly_.view(0, true);
  done_ = bodies_.empty();
  if (done_) return sort_by_begin();
  begin_bodies();
}

/// Starts to join the next pair of bodies.
template <class S>
void IntervalJoin<S>::begin_bodies() {
  const BodyPair bodies = bodies_[found_.size()];
  traversal_ = {};
  const BodySegmentBounds<S>&a = segment_->sides[bodies.first], &b = segment_->sides[bodies.second];
  if (a.hierarchy().empty() || b.hierarchy().empty() || a.apart || b.apart) return;
  self_ = bodies.first == bodies.second;
  const std::uint32_t width = a.hierarchy().topology().width;
  const WideLinearKernels<S>& kernels = wide_linear_kernels<S>(a.hierarchy().kernels());
  traverse_ = self_ ? kernels.self(width) : kernels.join(width);
  padded_ = std::max({4u, a.hierarchy().padded_leaf_size(), b.hierarchy().padded_leaf_size()});
  join_leaves_ = kernels.leaf_join(padded_);
  neighbours_ = self_ && !with_neighbours_ ? &scene_->primitives(bodies.first) : nullptr;
  stack_.resize(std::max<std::size_t>(stack_.size(), 1024));
  leaf_pairs_.resize(std::max(leaf_pairs_.size(), 2 * leaf_pairs_room_));
  traversal_ = {stack_.data(),    0, stack_.size(),     leaf_pairs_.data(), 0,
                leaf_pairs_room_, 1, Budget{}.box_tests};
  // A root that is a leaf lies in a node's only lane; the roots are compared there.
  traversal_.stack[traversal_.depth++] = {0, 0};
  leaf_join_ = {width,
                a.hierarchy().arrays(),
                b.hierarchy().arrays(),
                a.ends(),
                b.ends(),
                a.leaves(),
                b.leaves(),
                leaf_pairs_.data(),
                0,
                0,
                leaf_join_.throughout,
                leaf_join_.partly,
                leaf_join_.tests};
  if (!with_slabs_) return;
  masks_.resize(leaf_pairs_.size() / 2);
  slabs_ = slabs_of(a, b);
  slabs_.pairs = leaf_pairs_.data();
  slabs_.masks = masks_.data();
}

/// Describes the slabs of two bodies, without pairs of leaves.
template <class S>
SlabSpanPairs<S> IntervalJoin<S>::slabs_of(const BodySegmentBounds<S>& a, const BodySegmentBounds<S>& b) {
  // For each leaf, relative to its largest coordinate: the distance of the lines from positions at the ends,
  // half a unit for positions at frames, 3.1 for products of directions, whose components add up to 1, and
  // corners; one more for the sum of bounds and slack, and the rest for the rounding of this value.
  return {a.hierarchy().arrays(),
          b.hierarchy().arrays(),
          a.slab_leaves(),
          b.slab_leaves(),
          std::max(a.rounding, b.rounding) + 8 * unit_rounding<S>,
          nullptr,
          0,
          nullptr,
          0};
}

template <class S>
void IntervalJoin<S>::end_bodies() {
  found_.push_back({leaf_join_.throughout.found, leaf_join_.partly.found});
  node_tests_ += traversal_.tests;
  traversal_ = {};
}

template <class S>
bool IntervalJoin<S>::step(std::uint64_t box_tests) {
  if (done_) return true;
  const std::uint64_t before = tests();
  for (;;) {
    while (traversal_.depth > 0) {
      const std::uint64_t made = tests() - before;
      if (made >= box_tests) return false;
      const std::uint64_t left = box_tests - made, most = Budget{}.box_tests;
      traversal_.test_limit = left < most - traversal_.tests ? traversal_.tests + left : most;
      traverse_(leaf_join_.a, leaf_join_.ends_a, leaf_join_.b, leaf_join_.ends_b, traversal_);
      take_found_leaves();
    }
    if (self_) take_own_leaves();
    end_bodies();
    if (found_.size() == bodies_.size()) break;
    begin_bodies();
  }
  done_ = true;
  sort_by_begin();
  return true;
}

/// Leaves out pairs of leaves that slabs separate; returns the number of remaining pairs.
template <class S>
std::size_t IntervalJoin<S>::filter_leaves(std::size_t count) {
  slabs_.count = count;
  slabs_.tests = 0;
  slab_span_kernels<S>(segment_->sides[bodies_[found_.size()].first].hierarchy().kernels())
      .filter(padded_)(slabs_);
  leaf_join_.tests += slabs_.tests;
  return slabs_.count;
}

/// Processes the pairs of leaves from `leaf_join_.next` on, up to `end`.
template <class S>
void IntervalJoin<S>::take_leaves(std::size_t end, LeavesOf leaves) {
  leaf_join_.count = end;
  leaf_join_.masks = nullptr;
  if (with_slabs_ && leaves == LeavesOf::two) {
    leaf_join_.count = filter_leaves(end);
    leaf_join_.masks = masks_.data();
  }
  while (leaf_join_.next < leaf_join_.count) {
    leaf_join_.throughout = found_throughout_.view(leaf_join_.throughout.found, false);
    leaf_join_.partly = found_partly_.view(leaf_join_.partly.found, true);
    join_leaves_(leaf_join_);
  }
  leaf_join_.next = end;
}

/// Turns the pairs of leaves that the traversal has found into pairs of primitives, and makes room for more.
template <class S>
void IntervalJoin<S>::take_found_leaves() {
  leaf_join_.next = 0;
  if (self_) {
    const std::size_t different = take_out_own_leaves(leaf_pairs_.data(), traversal_.found, own_leaves_);
    take_self_leaves(different, LeavesOf::two);
  } else {
    take_leaves(traversal_.found, LeavesOf::two);
  }
  traversal_.found = 0;
  if (traversal_.depth + max_pairs_per_step >= traversal_.stack_room) {
    stack_.resize(2 * stack_.size());
    traversal_.stack = stack_.data();
    traversal_.stack_room = stack_.size();
  }
}

template <class S>
void IntervalJoin<S>::take_self_leaves(std::size_t end, LeavesOf leaves) {
  const std::size_t old_throughout = leaf_join_.throughout.found, old_partly = leaf_join_.partly.found;
  take_leaves(end, leaves);
  keep_self_columns(neighbours_, leaves, leaf_join_.throughout, old_throughout);
  keep_self_columns(neighbours_, leaves, leaf_join_.partly, old_partly);
}

template <class S>
void IntervalJoin<S>::take_own_leaves() {
  for_own_leaves(own_leaves_, leaf_pairs_.data(), leaf_pairs_.size() / 2, [&](std::size_t count) {
    leaf_join_.next = 0;
    take_self_leaves(count, LeavesOf::one);
  });
}

template <class S>
void IntervalJoin<S>::sort_by_begin() {
  throughout_ = leaf_join_.throughout.found;
  const std::size_t partly = leaf_join_.partly.found;
  std::uint32_t place[FractionBuckets::count] = {};
  for (std::size_t i = 0; i < partly; ++i) ++place[FractionBuckets::of(found_partly_.begin[i])];
  std::uint32_t sum = std::uint32_t(throughout_);
  for (std::uint32_t k = 0; k < FractionBuckets::count; ++k) {
    const std::uint32_t count = place[k];
    place[k] = sum;
    sum += count;
    bucket_end_[k] = sum;
  }
  count_ = throughout_ + partly;
  if (sorted_.size() < count_) sorted_.resize(count_);
  const bool several = bodies_.size() > 1;
  if (several && bodies_of_.size() < count_) bodies_of_.resize(sorted_.size());
  std::uint32_t bodies = 0;
  for (std::size_t i = 0; i < throughout_; ++i) {
    sorted_[i] = {found_throughout_.primitive_a[i], found_throughout_.primitive_b[i], 0, 1};
    if (!several) continue;
    while (i >= found_[bodies].throughout) ++bodies;
    bodies_of_[i] = bodies;
  }
  bodies = 0;
  found_at_.resize(partly);
  for (std::size_t i = 0; i < partly; ++i) {
    const std::uint32_t to = place[FractionBuckets::of(found_partly_.begin[i])]++;
    found_at_[i] = to;
    sorted_[to] = {found_partly_.primitive_a[i], found_partly_.primitive_b[i], found_partly_.begin[i],
                   found_partly_.end[i]};
    if (!several) continue;
    while (i >= found_[bodies].partly) ++bodies;
    bodies_of_[to] = bodies;
  }
}

template <class S>
void IntervalJoin<S>::start_reading() {
  reading_ = true;
  if (alive_.size() < count_) {
    alive_.resize(count_);
    alive_places_.resize(count_);
    next_ending_.resize(count_);
    place_.resize(count_);
  }
  for (std::size_t i = 0; i < throughout_; ++i) alive_[i] = primitives_of(i);
  next_ = alive_count_ = permanent_count_ = std::uint32_t(throughout_);
  waiting_.clear();
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
  alive_[place] = primitives_of(index);
  alive_places_[place] = index;
  following_.touch(index);
}

template <class S>
void IntervalJoin<S>::end_pair(std::uint32_t index) {
  const std::uint32_t place = place_[index], last = --alive_count_;
  alive_[place] = alive_[last];
  alive_places_[place] = alive_places_[last];
  place_[alive_places_[place]] = place;
  following_.touch(index);
}

template <class S>
void IntervalJoin<S>::move_to(float fraction) {
  if (!reading_) start_reading();
  const std::uint32_t bucket = FractionBuckets::of(fraction);
  // Pairs that begin: all of earlier buckets, some of the current one.
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
  if (has_beginning_) begin_added(fraction, bucket);
  // Pairs that end: the whole lists of earlier buckets.
  for (; present_ < bucket; ++present_) {
    for (std::uint32_t index = ending_[present_]; index != none; index = next_ending_[index])
      if (!is_removed(index)) end_pair(index);
    ending_[present_] = none;
  }
  for (std::uint32_t* link = &ending_[bucket]; *link != none;) {
    const std::uint32_t index = *link;
    if (sorted_[index].end < fraction) {
      *link = next_ending_[index];
      if (!is_removed(index)) end_pair(index);
    } else {
      link = &next_ending_[index];
    }
  }
}

template <class S>
std::size_t IntervalJoin<S>::bytes() const {
  return stack_.size() * sizeof(WidePair) + leaf_pairs_.size() * sizeof(LeafSlot) +
         masks_.capacity() * sizeof(std::uint32_t) + found_throughout_.bytes() + found_partly_.bytes() +
         sorted_.capacity() * sizeof(JoinedPair) + alive_.capacity() * sizeof(PrimitivePair) +
         bodies_.capacity() * sizeof(BodyPair) + found_.capacity() * sizeof(Found) +
         own_leaves_.capacity() * sizeof(LeafSlot) + shared_.bytes() +
         (bucket_places_.capacity() + added_.capacity()) * sizeof(std::uint32_t) +
         (bodies_of_.capacity() + waiting_.capacity() + alive_places_.capacity() + next_ending_.capacity() +
          place_.capacity() + first_primitive_.capacity() + heads_.capacity() + links_.capacity() +
          removed_.capacity() + found_at_.capacity()) *
             sizeof(std::uint32_t) +
         no_lanes_.capacity() + no_entries_.capacity() * sizeof(std::uint16_t);
}

template class IntervalJoin<float>;
template class IntervalJoin<double>;

}  // namespace kbvh
