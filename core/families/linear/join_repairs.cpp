// Repairs of an interval join where plans changed within its segment.

#include <algorithm>
#include <utility>

#include "core/families/linear/interval_join.hpp"

namespace kbvh {

/// Lists all pairs by their primitives.
template <class S>
void IntervalJoin<S>::index_pairs() {
  indexed_ = true;
  first_primitive_.clear();
  std::uint32_t primitives = 0;
  for (std::uint32_t body = 0; body < scene_->body_count(); ++body) {
    first_primitive_.push_back(primitives);
    primitives += std::uint32_t(scene_->primitives(body).count());
  }
  heads_.assign(primitives, none);
  if (links_.size() < 2 * count_) links_.resize(2 * count_);
  for (std::uint32_t i = 0; i < count_; ++i) link(i);
  std::fill(std::begin(beginning_), std::end(beginning_), none);
  beginning_from_ = 0;
}

template <class S>
void IntervalJoin<S>::link(std::uint32_t index) {
  const PrimitivePair pair = primitives_of(index);
  std::uint32_t& head_a = heads_[first_primitive_[pair.body_a] + pair.primitive_a];
  links_[2 * std::size_t(index)] = head_a;
  head_a = 2 * index;
  std::uint32_t& head_b = heads_[first_primitive_[pair.body_b] + pair.primitive_b];
  links_[2 * std::size_t(index) + 1] = head_b;
  head_b = 2 * index + 1;
}

template <class S>
void IntervalJoin<S>::remove(std::uint32_t index, Reader reader) {
  if (is_removed(index)) return;  // with its other primitive
  if (reader == Reader::join && overlaps(index)) end_pair(index);
  sorted_[index].end = -1;
  removed_.push_back(index);
}

template <class S>
void IntervalJoin<S>::remove_changed(std::span<const ChangedParts> changed, Reader reader) {
  for (std::uint32_t body = 0; body < changed.size(); ++body)
    for (const std::uint32_t primitive : changed[body].primitives()) {
      std::uint32_t& head = heads_[first_primitive_[body] + primitive];
      for (std::uint32_t entry = head; entry != none; entry = links_[entry]) remove(entry / 2, reader);
      head = none;
    }
}

/// Joins the changed primitives of the next pair of bodies.
template <class S>
void IntervalJoin<S>::join_changed(const ChangedParts& a, const ChangedParts& b) {
  begin_bodies();
  if (traversal_.depth == 0) return;
  const BodyPair bodies = bodies_[found_.size()];
  const WideHierarchy<S>&first = segment_->sides[bodies.first].hierarchy(),
        &second = segment_->sides[bodies.second].hierarchy();
  no_lanes_.resize(std::max<std::size_t>({no_lanes_.size(), first.node_count(), second.node_count()}), 0);
  no_entries_.resize(std::max<std::size_t>({no_entries_.size(), first.leaf_count(), second.leaf_count()}), 0);
  const WideSelection selection{a.empty() ? no_lanes_.data() : a.lanes(),
                                b.empty() ? no_lanes_.data() : b.lanes()};
  leaf_join_.selected_a = a.empty() ? no_entries_.data() : a.entries();
  leaf_join_.selected_b = b.empty() ? no_entries_.data() : b.entries();
  const WideLinearKernels<S>& kernels = wide_linear_kernels<S>(first.kernels());
  join_leaves_ =
      kernels.leaf_join_selected(std::max({4u, first.padded_leaf_size(), second.padded_leaf_size()}));
  const auto traverse = self_ ? kernels.selected_self(first.width()) : kernels.selected(first.width());
  while (traversal_.depth > 0) {
    traverse(leaf_join_.a, leaf_join_.ends_a, leaf_join_.b, leaf_join_.ends_b, selection, traversal_);
    take_found_leaves();
  }
  if (self_) take_own_leaves();
}

/// Makes room for pairs up to the given number.
template <class S>
void IntervalJoin<S>::make_room(std::size_t pairs) {
  following_.extend(pairs);
  if (sorted_.size() < pairs) sorted_.resize(2 * pairs);
  if (bodies_.size() > 1 && bodies_of_.size() < pairs) bodies_of_.resize(sorted_.size());
  if (links_.size() < 2 * pairs) links_.resize(2 * sorted_.size());
  if (!reading_ || alive_.size() >= pairs) return;
  alive_.resize(sorted_.size());
  for (auto* column : {&alive_places_, &next_ending_, &place_}) column->resize(sorted_.size());
}

template <class S>
void IntervalJoin<S>::add(const JoinedPair& pair, std::uint32_t bodies, float fraction, Reader reader) {
  if (pair.end < fraction) return;
  const auto index = std::uint32_t(count_++);
  sorted_[index] = pair;
  sorted_[index].begin = std::max(pair.begin, fraction);
  if (bodies_.size() > 1) bodies_of_[index] = bodies;
  link(index);
  if (reader == Reader::filter) return;
  place_[index] = none;
  if (pair.begin <= fraction) return begin_pair(index);
  std::uint32_t& first = beginning_[FractionBuckets::of(pair.begin)];
  next_ending_[index] = first;
  first = index;
  has_beginning_ = true;
}

/// Begins added pairs that are due.
template <class S>
void IntervalJoin<S>::begin_added(float fraction, std::uint32_t bucket) {
  for (std::uint32_t k = beginning_from_; k <= bucket; ++k)
    for (std::uint32_t* link = &beginning_[k]; *link != none;) {
      const std::uint32_t index = *link;
      if (sorted_[index].begin > fraction && !is_removed(index)) {
        link = &next_ending_[index];
        continue;
      }
      *link = next_ending_[index];
      if (sorted_[index].end >= fraction) begin_pair(index);
    }
  beginning_from_ = bucket;
}

template <class S>
std::uint64_t IntervalJoin<S>::repair(std::span<const ChangedParts> changed, float fraction, Reader reader) {
  removed_.clear();
  first_added_ = std::uint32_t(count_);
  const auto is_changed = [&](const BodyPair& pair) {
    return !changed[pair.first].empty() || !changed[pair.second].empty();
  };
  if (std::none_of(bodies_.begin(), bodies_.end(), is_changed)) return 0;
  if (reader == Reader::join) {
    if (!reading_) start_reading();
    for (; permanent_count_ > 0; --permanent_count_)
      place_[permanent_count_ - 1] = alive_places_[permanent_count_ - 1] = permanent_count_ - 1;
  }
  if (!indexed_) index_pairs();
  remove_changed(changed, reader);
  const std::uint64_t before = tests();
  leaf_join_.throughout.found = leaf_join_.partly.found = 0;
  found_.clear();
  const bool slabs = std::exchange(with_slabs_, false);  // slabs of changed leaves are no longer valid
  while (found_.size() < bodies_.size()) {
    traversal_ = {};
    const BodyPair& pair = bodies_[found_.size()];
    if (is_changed(pair)) join_changed(changed[pair.first], changed[pair.second]);
    end_bodies();
  }
  with_slabs_ = slabs;
  make_room(count_ + leaf_join_.throughout.found + leaf_join_.partly.found);
  std::uint32_t bodies = 0;
  for (std::size_t i = 0; i < leaf_join_.throughout.found; ++i) {
    while (i >= found_[bodies].throughout) ++bodies;
    add({found_throughout_.primitive_a[i], found_throughout_.primitive_b[i], 0, 1}, bodies, fraction, reader);
  }
  bodies = 0;
  for (std::size_t i = 0; i < leaf_join_.partly.found; ++i) {
    while (i >= found_[bodies].partly) ++bodies;
    add({found_partly_.primitive_a[i], found_partly_.primitive_b[i], found_partly_.begin[i],
         found_partly_.end[i]},
        bodies, fraction, reader);
  }
  return tests() - before;
}

// The header declares the instances of the whole class, so every member must be instantiated where it is
// defined.
template void IntervalJoin<float>::index_pairs();
template void IntervalJoin<float>::link(std::uint32_t);
template void IntervalJoin<float>::remove(std::uint32_t, Reader);
template void IntervalJoin<float>::remove_changed(std::span<const ChangedParts>, Reader);
template void IntervalJoin<float>::join_changed(const ChangedParts&, const ChangedParts&);
template void IntervalJoin<float>::make_room(std::size_t);
template void IntervalJoin<float>::add(const JoinedPair&, std::uint32_t, float, Reader);
template void IntervalJoin<float>::begin_added(float, std::uint32_t);
template std::uint64_t IntervalJoin<float>::repair(std::span<const ChangedParts>, float, Reader);
template void IntervalJoin<double>::index_pairs();
template void IntervalJoin<double>::link(std::uint32_t);
template void IntervalJoin<double>::remove(std::uint32_t, Reader);
template void IntervalJoin<double>::remove_changed(std::span<const ChangedParts>, Reader);
template void IntervalJoin<double>::join_changed(const ChangedParts&, const ChangedParts&);
template void IntervalJoin<double>::make_room(std::size_t);
template void IntervalJoin<double>::add(const JoinedPair&, std::uint32_t, float, Reader);
template void IntervalJoin<double>::begin_added(float, std::uint32_t);
template std::uint64_t IntervalJoin<double>::repair(std::span<const ChangedParts>, float, Reader);

}  // namespace kbvh
