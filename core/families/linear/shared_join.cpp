#include "core/families/linear/shared_join.hpp"

#include <algorithm>

#include "core/families/wide/kernels/leaf_rows.hpp"
#include "core/families/wide/leaf_slots.hpp"

namespace kbvh {

namespace {
/// The smallest allocation for pairs of primitives.
constexpr std::size_t chunk_room = 2048;
}  // namespace

JoinColumns JoinedColumns::view(std::size_t found, bool timed) {
  if (primitive_a.size() < found + chunk_room) {
    const std::size_t room = 2 * found + chunk_room;
    for (auto* column : {&primitive_a, &primitive_b}) column->resize(room);
    if (timed)
      for (auto* column : {&begin, &end}) column->resize(room);
  }
  return {primitive_a.data(),
          primitive_b.data(),
          timed ? begin.data() : nullptr,
          timed ? end.data() : nullptr,
          found,
          primitive_a.size()};
}

std::size_t JoinedColumns::bytes() const {
  return (primitive_a.capacity() + primitive_b.capacity()) * sizeof(std::uint32_t) +
         (begin.capacity() + end.capacity()) * sizeof(float);
}

void keep_self_columns(const Primitives* neighbours, LeavesOf leaves, JoinColumns& pairs, std::size_t from) {
  std::size_t kept = from;
  for (std::size_t i = from; i < pairs.found; ++i) {
    std::uint32_t a = pairs.primitive_a[i], b = pairs.primitive_b[i];
    if (!keep_self_pair(neighbours, leaves, a, b)) continue;
    pairs.primitive_a[kept] = a;
    pairs.primitive_b[kept] = b;
    if (pairs.begin != nullptr) {
      pairs.begin[kept] = pairs.begin[i];
      pairs.end[kept] = pairs.end[i];
    }
    ++kept;
  }
  pairs.found = kept;
}

template <class S>
void SharedJoin<S>::start() {
  bodies_.clear();
  front_.start();
}

template <class S>
void SharedJoin<S>::add(const WideLeafJoin<S>& bodies, KernelSet kernels, std::uint32_t padded, bool self,
                        const Primitives* neighbours) {
  front_.add(std::uint32_t(bodies_.size()));
  bodies_.push_back({bodies, kernels, padded, self, neighbours});
}

template <class S>
void SharedJoin<S>::run(Workers& workers, JoinedColumns& throughout, JoinedColumns& partly,
                        std::vector<Ends>& ends, std::uint64_t& tests) {
  runners_.resize(workers.threads());
  for (Runner& room : runners_) {
    for (std::size_t kind = 0; kind < kinds; ++kind)
      room.throughout_count[kind] = room.partly_count[kind] = 0;
    room.tests = 0;
  }
  tests += front_.traverse(
      workers,
      [this](std::uint32_t i, WideTraversal& state) {
        const Bodies& bodies = bodies_[i];
        const WideLinearKernels<S>& kernels = wide_linear_kernels<S>(bodies.kernels);
        const WideLeafJoin<S>& join = bodies.join;
        (bodies.self ? kernels.self(join.width) : kernels.join(join.width))(join.a, join.ends_a, join.b,
                                                                            join.ends_b, state);
      },
      [this](const Batch& batch, std::uint32_t runner) { claim_leaves(batch, runners_[runner]); });
  const auto batches = front_.batches();
  results_.resize(batches.size());
  workers.for_each(batches.size(),
                   [this](std::size_t batch, std::uint32_t runner) { join_leaves(batch, runner); });
  std::size_t most[kinds] = {}, most_partly[kinds] = {};
  for (const Runner& room : runners_) {
    tests += room.tests;
    for (std::size_t kind = 0; kind < kinds; ++kind) {
      most[kind] += room.throughout_count[kind];
      most_partly[kind] += room.partly_count[kind];
    }
  }
  // Another segment may give all work to one thread; no memory is then allocated.
  for (Runner& room : runners_) {
    for (std::size_t kind = 0; kind < kinds; ++kind) {
      room.throughout[kind].view(most[kind], false);
      room.partly[kind].view(most_partly[kind], true);
    }
    room.claimed.reserve(leaf_pair_room);
    room.masks.reserve(SharedFront::batch_pairs);
    for (auto* list : {&room.leaves, &room.own, &room.own_pairs})
      list->reserve(SharedFront::most_batch_slots);
  }

  std::size_t all = 0, parts = 0, batch = 0;
  ends.clear();
  for (std::uint32_t i = 0; i < bodies_.size(); ++i) {
    const std::size_t first = batch;
    for (std::size_t kind = 0; kind < kinds; ++kind)
      for (batch = first; batch < batches.size() && batches[batch].traversal == i; ++batch) {
        Range &one = results_[batch].throughout[kind], &other = results_[batch].partly[kind];
        one.to = all;
        other.to = parts;
        all += one.end - one.begin;
        parts += other.end - other.begin;
      }
    ends.push_back({all, parts});
  }
  const JoinColumns to = throughout.view(all, false), to_partly = partly.view(parts, true);
  workers.for_each(results_.size(), [&](std::size_t i, std::uint32_t) {
    const Result& result = results_[i];
    const Runner& room = runners_[result.runner];
    const auto copy = [](const auto& from, const Range& range, auto* target) {
      std::copy(from.begin() + std::ptrdiff_t(range.begin), from.begin() + std::ptrdiff_t(range.end),
                target + range.to);
    };
    for (std::size_t kind = 0; kind < kinds; ++kind) {
      copy(room.throughout[kind].primitive_a, result.throughout[kind], to.primitive_a);
      copy(room.throughout[kind].primitive_b, result.throughout[kind], to.primitive_b);
      copy(room.partly[kind].primitive_a, result.partly[kind], to_partly.primitive_a);
      copy(room.partly[kind].primitive_b, result.partly[kind], to_partly.primitive_b);
      copy(room.partly[kind].begin, result.partly[kind], to_partly.begin);
      copy(room.partly[kind].end, result.partly[kind], to_partly.end);
    }
  });
}

/// Computes, at both ends, the rows of leaves that no thread has reached since the positions changed.
template <class S>
void SharedJoin<S>::claim_leaves(const Batch& batch, Runner& room) {
  const Bodies& bodies = bodies_[batch.traversal];
  for (std::size_t which = 0; which < 2; ++which) {
    const WideLinearLeaves<S>& leaves = which == 0 ? bodies.join.leaves_a : bodies.join.leaves_b;
    const WideNode* nodes = which == 0 ? bodies.join.a.nodes : bodies.join.b.nodes;
    for (int end = 0; end < 2; ++end) {
      room.claimed.clear();
      for (std::size_t i = which; i < batch.pairs.size(); i += 2) {
        const std::uint32_t leaf = nodes[batch.pairs[i].node()].first_leaf + batch.pairs[i].lane();
        if (claim_leaf(leaves.stamps[end][leaf], leaves.stamp[end])) room.claimed.push_back(leaf);
      }
      const WideLeaves<S> at_end{leaves.lists, leaves.rows[end], leaves.stamps[end], leaves.stamp[end],
                                 leaves.positions[end]};
      leaf_rows_kernels<S>(bodies.kernels)
          .fit(bodies.padded)(at_end, room.claimed.data(), room.claimed.size());
    }
    if (!bodies.with_slabs) continue;
    const SlabSpanLeaves<S>& spans = which == 0 ? bodies.slabs.leaves_a : bodies.slabs.leaves_b;
    room.claimed.clear();
    for (std::size_t i = which; i < batch.pairs.size(); i += 2) {
      const std::uint32_t leaf = nodes[batch.pairs[i].node()].first_leaf + batch.pairs[i].lane();
      if (claim_leaf(spans.slab_stamps[leaf], spans.slab_stamp)) room.claimed.push_back(leaf);
    }
    slab_span_kernels<S>(bodies.kernels).make(bodies.padded)(spans, room.claimed.data(), room.claimed.size());
  }
}

template <class S>
void SharedJoin<S>::join_leaves(std::size_t which, std::uint32_t runner) {
  const Batch& batch = front_.batches()[which];
  const Bodies& bodies = bodies_[batch.traversal];
  Runner& room = runners_[runner];
  Result& result = results_[which];
  result.runner = runner;
  const std::size_t count = batch.pairs.size() / 2;
  if (!bodies.self && !bodies.with_slabs) {
    join_some(bodies, batch.pairs.data(), count, room, of_two, nullptr, result);
    join_some(bodies, nullptr, 0, room, of_one, nullptr, result);
    return;
  }
  room.leaves.assign(batch.pairs.begin(), batch.pairs.end());
  room.own.clear();
  room.own_pairs.clear();
  std::size_t different = bodies.self ? take_out_own_leaves(room.leaves.data(), count, room.own) : count;
  for (const LeafSlot leaf : room.own) room.own_pairs.insert(room.own_pairs.end(), 2, leaf);
  if (bodies.with_slabs) different = filter_leaves(bodies, different, room);
  join_some(bodies, room.leaves.data(), different, room, of_two,
            bodies.with_slabs ? room.masks.data() : nullptr, result);
  join_some(bodies, room.own_pairs.data(), room.own.size(), room, of_one, nullptr, result);
}

/// Leaves out pairs of leaves of `room.leaves` that slabs separate; returns the number of remaining pairs.
template <class S>
std::size_t SharedJoin<S>::filter_leaves(const Bodies& bodies, std::size_t count, Runner& room) {
  if (room.masks.size() < count) room.masks.resize(count);
  SlabSpanPairs<S> slabs = bodies.slabs;
  slabs.pairs = room.leaves.data();
  slabs.count = count;
  slabs.masks = room.masks.data();
  slabs.tests = 0;
  slab_span_kernels<S>(bodies.kernels).filter(bodies.padded)(slabs);
  room.tests += slabs.tests;
  return slabs.count;
}

template <class S>
void SharedJoin<S>::join_some(const Bodies& bodies, const LeafSlot* leaves, std::size_t count, Runner& room,
                              Kind kind, const std::uint32_t* masks, Result& result) {
  const std::size_t begin = room.throughout_count[kind], begin_partly = room.partly_count[kind];
  WideLeafJoin<S> join = bodies.join;
  join.pairs = leaves;
  join.masks = masks;
  join.next = 0;
  join.count = count;
  join.tests = 0;
  join.throughout.found = begin;
  join.partly.found = begin_partly;
  const auto kernel = wide_linear_kernels<S>(bodies.kernels).leaf_join(bodies.padded);
  while (join.next < join.count) {
    join.throughout = room.throughout[kind].view(join.throughout.found, false);
    join.partly = room.partly[kind].view(join.partly.found, true);
    kernel(join);
  }
  room.tests += join.tests;
  if (bodies.self && count > 0) {
    const LeavesOf from = kind == of_two ? LeavesOf::two : LeavesOf::one;
    keep_self_columns(bodies.neighbours, from, join.throughout, begin);
    keep_self_columns(bodies.neighbours, from, join.partly, begin_partly);
  }
  room.throughout_count[kind] = join.throughout.found;
  room.partly_count[kind] = join.partly.found;
  result.throughout[kind] = {begin, join.throughout.found, 0};
  result.partly[kind] = {begin_partly, join.partly.found, 0};
}

template <class S>
std::size_t SharedJoin<S>::bytes() const {
  std::size_t total =
      front_.bytes() + bodies_.capacity() * sizeof(Bodies) + results_.capacity() * sizeof(Result);
  for (const Runner& room : runners_) {
    total += sizeof room + (room.claimed.capacity() + room.masks.capacity()) * sizeof(std::uint32_t) +
             (room.leaves.capacity() + room.own.capacity() + room.own_pairs.capacity()) * sizeof(LeafSlot);
    for (std::size_t kind = 0; kind < kinds; ++kind)
      total += room.throughout[kind].bytes() + room.partly[kind].bytes();
  }
  return total;
}

template class SharedJoin<float>;
template class SharedJoin<double>;

}  // namespace kbvh
