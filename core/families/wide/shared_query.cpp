#include "core/families/wide/shared_query.hpp"

#include <algorithm>

#include "core/base/assert.hpp"
#include "core/families/wide/kernels/leaf_rows.hpp"
#include "core/families/wide/leaf_slots.hpp"
#include "core/geometry/box.hpp"
#include "core/scene/self_pairs.hpp"

namespace kbvh {

template <class S>
void SharedQuery<S>::run(Workers& workers, PairBuffer& out, std::uint64_t& tests) {
  runners_.resize(workers.threads());
  for (Runner& room : runners_) {
    room.found.clear();
    room.found_own.clear();
    room.tests = 0;
  }
  front_.start();
  for (std::size_t i = 0; i < pairs_.size(); ++i) {
    const Side &a = pairs_[i].a, &b = pairs_[i].b;
    KBVH_ASSERT(a.moment == nullptr && a.stale == nullptr && b.moment == nullptr && b.stale == nullptr);
    if (a.hierarchy->empty() || b.hierarchy->empty()) continue;
    if (!a.hierarchy->suits(*b.hierarchy))
      throw std::invalid_argument("a query needs hierarchies of one width and leaf size");
    ++tests;
    if (overlap(a.hierarchy->root_box(), b.hierarchy->root_box())) front_.add(std::uint32_t(i));
  }
  tests += front_.traverse(
      workers,
      [this](std::uint32_t i, WideTraversal& state) {
        const Bodies& bodies = pairs_[i];
        const auto& kernels = wide_overlap_kernels<S>(bodies.a.hierarchy->kernels());
        const std::uint32_t width = bodies.a.hierarchy->width();
        (bodies.self() ? kernels.self(width) : kernels.traverse(width))(bodies.a.hierarchy->arrays(),
                                                                        bodies.b.hierarchy->arrays(), state);
      },
      [this](const Batch& batch, std::uint32_t runner) { claim_leaves(batch, runners_[runner]); });
  const auto batches = front_.batches();
  results_.resize(batches.size());
  workers.for_each(batches.size(),
                   [this](std::size_t batch, std::uint32_t runner) { compare(batch, runner); });
  std::size_t all = 0, all_own = 0;
  for (const Runner& room : runners_) {
    tests += room.tests;
    all += room.found.size();
    all_own += room.found_own.size();
  }
  // Another frame may give all work to one thread; no memory is then allocated.
  for (Runner& room : runners_) {
    room.found.reserve(all);
    room.found_own.reserve(all_own);
    room.claimed.reserve(leaf_pair_room);
    room.chunk.reserve(found_at_once);
    for (auto* list : {&room.leaves, &room.own, &room.own_pairs})
      list->reserve(SharedFront::most_batch_slots);
  }
  copy_found(workers, out);
}

/// Appends the pairs that the batches found, in order; for a body with itself, pairs of two leaves come
/// first.
template <class S>
void SharedQuery<S>::copy_found(Workers& workers, PairBuffer& out) {
  const auto batches = front_.batches();
  std::size_t to = out.size();
  for (std::size_t first = 0, last = 0; first < batches.size(); first = last) {
    for (; last < batches.size() && batches[last].traversal == batches[first].traversal; ++last) {
      results_[last].to = to;
      to += results_[last].end - results_[last].begin;
    }
    for (std::size_t i = first; i < last; ++i) {
      results_[i].to_own = to;
      to += results_[i].end_own - results_[i].begin_own;
    }
  }
  out.resize(to);
  const Parts cut{results_.size(), copied_at_once};
  workers.for_each(cut.parts(), [&](std::size_t part, std::uint32_t) {
    const auto copy = [&out](const PairBuffer& from, std::size_t begin, std::size_t end, std::size_t place) {
      std::copy(from.begin() + std::ptrdiff_t(begin), from.begin() + std::ptrdiff_t(end),
                out.begin() + std::ptrdiff_t(place));
    };
    for (std::size_t i = cut.begin(part); i < cut.end(part); ++i) {
      const Result& result = results_[i];
      copy(runners_[result.runner].found, result.begin, result.end, result.to);
      copy(runners_[result.runner].found_own, result.begin_own, result.end_own, result.to_own);
    }
  });
}

/// Computes the boxes of primitives in leaves that no thread has reached since the positions changed.
template <class S>
void SharedQuery<S>::claim_leaves(const Batch& batch, Runner& room) {
  const Bodies& bodies = pairs_[batch.traversal];
  const std::uint32_t padded = bodies.a.hierarchy->padded_leaf_size();
  if (padded == 1) return;
  for (std::size_t which = 0; which < 2; ++which) {
    const Side& side = which == 0 ? bodies.a : bodies.b;
    const WideLeaves<S> leaves = side.hierarchy->leaves(positions(side));
    room.claimed.clear();
    for (std::size_t i = which; i < batch.pairs.size(); i += 2) {
      const std::uint32_t leaf = side.hierarchy->leaf_number(batch.pairs[i]);
      if (claim_leaf(leaves.stamps[leaf], leaves.stamp)) room.claimed.push_back(leaf);
    }
    leaf_rows_kernels<S>(side.hierarchy->kernels())
        .fit(padded)(leaves, room.claimed.data(), room.claimed.size());
  }
}

template <class S>
void SharedQuery<S>::compare(std::size_t which, std::uint32_t runner) {
  const Batch& batch = front_.batches()[which];
  const Bodies& bodies = pairs_[batch.traversal];
  Runner& room = runners_[runner];
  Result& result = results_[which];
  const std::size_t begin = room.found.size(), begin_own = room.found_own.size();
  if (!bodies.self()) {
    append(bodies, batch.pairs.data(), batch.pairs.size() / 2, room, room.found);
  } else {
    room.leaves.assign(batch.pairs.begin(), batch.pairs.end());
    room.own.clear();
    room.own_pairs.clear();
    const std::size_t count = room.leaves.size() / 2;
    const std::size_t different = take_out_own_leaves(room.leaves.data(), count, room.own);
    for (const LeafSlot leaf : room.own) room.own_pairs.insert(room.own_pairs.end(), 2, leaf);
    const Primitives* neighbours =
        bodies.a.positions == nullptr ? &scene_.primitives(bodies.a.body) : nullptr;
    const auto keep = [neighbours](LeavesOf leaves, PairBuffer& found, std::size_t from) {
      found.resize(from + keep_self_pairs(neighbours, leaves, found.data() + from, found.size() - from));
    };
    append(bodies, room.leaves.data(), different, room, room.found);
    keep(LeavesOf::two, room.found, begin);
    append(bodies, room.own_pairs.data(), room.own.size(), room, room.found_own);
    keep(LeavesOf::one, room.found_own, begin_own);
  }
  result = {runner, begin, room.found.size(), begin_own, room.found_own.size(), 0, 0};
}

template <class S>
std::size_t SharedQuery<S>::bytes() const {
  std::size_t total =
      front_.bytes() + pairs_.capacity() * sizeof(Bodies) + results_.capacity() * sizeof(Result);
  for (const Runner& room : runners_)
    total += sizeof room + room.claimed.capacity() * sizeof(std::uint32_t) +
             (room.leaves.capacity() + room.own.capacity() + room.own_pairs.capacity()) * sizeof(LeafSlot) +
             room.chunk.capacity() * sizeof(FoundPair) +
             (room.found.capacity() + room.found_own.capacity()) * sizeof(PrimitivePair);
  return total;
}

template class SharedQuery<float>;
template class SharedQuery<double>;

}  // namespace kbvh
