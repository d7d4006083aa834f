#include "core/families/drift/near_pairs.hpp"

#include <algorithm>
#include <limits>

#include "core/families/wide/leaf_slots.hpp"

namespace kbvh {

namespace {
/// The smallest allocation for pairs of primitives.
constexpr std::size_t chunk_room = 2048;
}  // namespace

template <class S>
NearLeaves<S> NearPairs<S>::leaves(const NearSide<S>& side) {
  NearLeafRows<S>& rows = *side.rows;
  const std::size_t count = side.hierarchy->leaf_count();
  if (rows.stamps_.size() != count) {
    rows.stamps_.assign(count, 0);
    rows.rows_.resize(count * lane_scalars(std::max(4u, side.hierarchy->padded_leaf_size())));
    rows.stamp_ = 1;
  }
  NearLeaves<S> result{side.hierarchy->leaf_lists(),
                       rows.rows_.data(),
                       rows.stamps_.data(),
                       rows.stamp_,
                       side.positions,
                       {},
                       side.rounding};
  std::copy_n(side.margin, 6, result.margin);
  return result;
}

template <class S>
void NearPairs<S>::build(const NearSide<S>& a, const NearSide<S>& b, std::uint32_t body_a,
                         std::uint32_t body_b, const S (&reach)[6], NearWork<S>& work, std::uint64_t& tests) {
  WideHierarchy<S>&hierarchy_a = *a.hierarchy, &hierarchy_b = *b.hierarchy;
  const std::uint32_t width = hierarchy_a.topology().width;
  kernels_ = hierarchy_a.kernels();
  work.stack.resize(std::max<std::size_t>(work.stack.size(), 1024));
  work.leaf_pairs.resize(2 * leaf_pair_room);
  constexpr auto no_limit = std::numeric_limits<std::uint64_t>::max();
  WideTraversal state{work.stack.data(), 0, work.stack.size(), work.leaf_pairs.data(), 0,
                      leaf_pair_room,    1, no_limit};
  if (overlap(hierarchy_a.box(0), hierarchy_b.box(0))) state.stack[state.depth++] = {0, 0};
  LeafNear<S> near{hierarchy_a.arrays(),
                   hierarchy_b.arrays(),
                   leaves(a),
                   leaves(b),
                   {},
                   work.leaf_pairs.data(),
                   0,
                   0,
                   nullptr,
                   0,
                   0,
                   0};
  for (std::size_t k = 0; k < 6; ++k) near.inverse_reach[k] = 1 / reach[k];
  const bool self = body_a == body_b;
  const auto& overlaps = wide_overlap_kernels<S>(hierarchy_a.kernels());
  const auto traverse = self ? overlaps.self(width) : overlaps.traverse(width);
  const auto pairs_of_leaves =
      near_kernels<S>(hierarchy_a.kernels())
          .near(width,
                std::max(4u, std::max(hierarchy_a.padded_leaf_size(), hierarchy_b.padded_leaf_size())));
  // Turns the first pairs of leaves into pairs of primitives.
  const auto take = [&](std::size_t count, LeavesOf leaves) {
    const std::size_t before = near.found;
    near.next = 0;
    near.count = count;
    while (near.next < near.count) {
      if (work.found.size() < near.found + chunk_room) work.found.resize(2 * near.found + chunk_room);
      near.out = work.found.data();
      near.out_room = work.found.size();
      pairs_of_leaves(near);
    }
    if (self)
      near.found =
          before + keep_self_pairs(a.neighbours, leaves, work.found.data() + before, near.found - before);
  };
  work.own_leaves.clear();
  while (state.depth > 0) {
    traverse(near.a, near.b, state);
    take(self ? take_out_own_leaves(work.leaf_pairs.data(), state.found, work.own_leaves) : state.found,
         LeavesOf::two);
    state.found = 0;
    if (state.depth + max_pairs_per_step >= state.stack_room) {
      work.stack.resize(2 * work.stack.size());
      state.stack = work.stack.data();
      state.stack_room = work.stack.size();
    }
  }
  for_own_leaves(work.own_leaves, work.leaf_pairs.data(), leaf_pair_room,
                 [&](std::size_t count) { take(count, LeavesOf::one); });
  tests += state.tests + near.tests;
  sort({work.found.data(), near.found}, body_a, body_b);
}

template <class S>
void NearPairs<S>::sort(std::span<const NearPair> found, std::uint32_t body_a, std::uint32_t body_b) {
  std::uint32_t place[buckets] = {};
  for (const NearPair& pair : found) ++place[bucket(pair.ratio)];
  std::uint32_t sum = 0;
  for (std::uint32_t k = 0; k < buckets; ++k) {
    const std::uint32_t count = place[k];
    place[k] = sum;
    sum += count;
    bucket_end_[k] = sum;
  }
  pairs_.resize(found.size());
  for (const NearPair& pair : found)
    pairs_[place[bucket(pair.ratio)]++] = {body_a, pair.primitive_a, body_b, pair.primitive_b};
}

template <class S>
void NearPairs<S>::append(const FoundPair* pairs, std::size_t count, PairBuffer& out) {
  const std::size_t before = out.size();
  out.resize(before + count);
  for (std::size_t i = 0; i < count; ++i)
    out[before + i] = {pairs[i].body_a, pairs[i].primitive_a, pairs[i].body_b, pairs[i].primitive_b};
}

template <class S>
void NearPairs<S>::read(double fraction, PairBuffer& out) const {
  append(pairs_.data(), bucket_end_[bucket(float(fraction))], out);
}

template <class S>
std::size_t NearPairs<S>::read_meeting(double fraction, const PrimitivesNow<S>& a, const PrimitivesNow<S>& b,
                                       NearWork<S>& work, PairBuffer& out) const {
  const std::size_t end = bucket_end_[bucket(float(fraction))];
  const NearKernels<S>& kernels = near_kernels<S>(kernels_);
  work.chunk.resize(chunk_room);
  for (std::size_t first = 0; first < end; first += chunk_room) {
    const std::size_t count = std::min(chunk_room, end - first);
    append(work.chunk.data(), kernels.meeting(pairs_.data() + first, count, a, b, work.chunk.data()), out);
  }
  return end;
}

template <class S>
void NearPairs<S>::clear() {
  pairs_.clear();
  std::fill(std::begin(bucket_end_), std::end(bucket_end_), 0);
}

template <class S>
std::size_t NearPairs<S>::bytes() const {
  return sizeof(*this) + pairs_.capacity() * sizeof(FoundPair);
}

template class NearPairs<float>;
template class NearPairs<double>;

}  // namespace kbvh
