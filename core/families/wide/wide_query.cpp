#include "core/families/wide/wide_query.hpp"

#include <algorithm>

#include "core/base/assert.hpp"
#include "core/families/wide/kernels/wide_overlap.hpp"
#include "core/families/wide/leaf_slots.hpp"
#include "core/scene/self_pairs.hpp"

namespace kbvh {

template <class S>
QueryStatus WideQuery<S>::run(const Side& a, const Side& b, PairBuffer& out, std::uint64_t& tests,
                              const Budget& budget) {
  KBVH_ASSERT((a.moment == nullptr) == (b.moment == nullptr));
  if (a.hierarchy->empty() || b.hierarchy->empty()) return {};
  for (const WideMoment<S>* moment : {a.moment, b.moment})
    if (moment != nullptr && moment->stale[0] != 0) {
      wide_linear_kernels<S>(a.hierarchy->kernels()).make(a.hierarchy->width())(*moment, 0);
      moment->stale[0] = 0;
    }
  WideTraversal state = fresh_traversal(budget);
  push_roots(a, b, state);
  while (state.depth > 0 && state.tests < state.test_limit) {
    traverse(a, b, state);
    take_leaves(a, b, state, out, tests);
    grow(state);
  }
  take_own_leaves(a, b, out, tests);
  tests += state.tests;
  return {state.depth};
}

template <class S>
void WideQuery<S>::run_leaves(const Side& a, const Side& b, std::span<const LeafSlot> pairs, PairBuffer& out,
                              std::uint64_t& tests) {
  WideTraversal state = fresh_traversal({});
  while (!pairs.empty()) {
    const auto some = pairs.first(std::min(pairs.size(), leaf_pairs_.size()));
    std::copy(some.begin(), some.end(), leaf_pairs_.begin());
    state.found = some.size() / 2;
    take_leaves(a, b, state, out, tests);
    pairs = pairs.subspan(some.size());
  }
  take_own_leaves(a, b, out, tests);
}

template <class S>
void WideQuery<S>::traverse(const Side& a, const Side& b, WideTraversal& state) const {
  const std::uint32_t width = a.hierarchy->width();
  const KernelSet set = a.hierarchy->kernels();
  if (a.moment != nullptr) return wide_linear_kernels<S>(set).at(width)(*a.moment, *b.moment, state);
  const auto& kernels = wide_overlap_kernels<S>(set);
  const auto kernel = a.body == b.body ? kernels.self(width) : kernels.traverse(width);
  kernel(a.hierarchy->arrays(), b.hierarchy->arrays(), state);
}

template <class S>
WideTraversal WideQuery<S>::fresh_traversal(const Budget& budget) {
  own_leaves_.clear();  // left by an abandoned query
  stack_.resize(std::max<std::size_t>(stack_.size(), 1024));
  leaf_pairs_.resize(2 * leaf_pair_room);
  return {stack_.data(), 0, stack_.size(), leaf_pairs_.data(), 0, leaf_pair_room, 1, budget.box_tests};
}

template <class S>
void WideQuery<S>::push_roots(const Side& a, const Side& b, WideTraversal& state) {
  if (!a.hierarchy->suits(*b.hierarchy))
    throw std::invalid_argument("a query needs hierarchies of one width and leaf size");
  if (overlap(a.hierarchy->root_box(), b.hierarchy->root_box())) state.stack[state.depth++] = {0, 0};
}

template <class S>
void WideQuery<S>::grow(WideTraversal& state) {
  if (state.depth + max_pairs_per_step < state.stack_room) return;
  stack_.resize(2 * stack_.size());
  state.stack = stack_.data();
  state.stack_room = stack_.size();
}

template <class S>
void WideQuery<S>::start_lazy(const Side& a, const Side& b, const Budget& budget) {
  lazy_ = fresh_traversal(budget);
  lazy_.stale_a = a.stale;
  lazy_.stale_b = b.stale;
  if (a.hierarchy->empty() || b.hierarchy->empty())
    lazy_.tests = 0;
  else
    push_roots(a, b, lazy_);
}

template <class S>
typename WideQuery<S>::Wanted WideQuery<S>::step(const Side& a, const Side& b, PairBuffer& out,
                                                 std::uint64_t& tests) {
  const auto kernel = wide_overlap_kernels<S>(a.hierarchy->kernels()).lazy(a.hierarchy->width());
  while (lazy_.depth > 0 && lazy_.tests < lazy_.test_limit) {
    kernel(a.hierarchy->arrays(), b.hierarchy->arrays(), lazy_);
    if (lazy_.depth > 0 && lazy_.tests < lazy_.test_limit) {
      Wanted wanted;
      if (lazy_.first_is_stale()) wanted.first = lazy_.stack[lazy_.depth - 1].first;
      if (lazy_.second_is_stale()) wanted.second = lazy_.stack[lazy_.depth - 1].second;
      if (wanted) return wanted;
    }
    take_leaves(a, b, lazy_, out, tests);
    grow(lazy_);
  }
  // Processes the pairs found just before a pause, if no other work followed.
  if (lazy_.found != 0) take_leaves(a, b, lazy_, out, tests);
  take_own_leaves(a, b, out, tests);
  tests += lazy_.tests;
  return {};
}

template <class S>
void WideQuery<S>::fetch_leaves(const Side& side, std::size_t which, std::size_t count) {
  if (side.positions != nullptr || !motion_) return;
  WideTree<S>& h = *side.hierarchy;
  // Fetches all missing positions at once: calls for a few vertices each cost more than the vertices
  // themselves.
  if (h.padded_leaf_size() == 1 || motion_->all_current(side.body)) return;
  to_fetch_.clear();
  // Leaves with this many corners need most positions: listing the others would cost more than evaluating
  // all.
  const std::size_t most = std::max<std::size_t>(256, scene_->vertex_count(side.body) / 4);
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint32_t leaf = h.leaf_number(leaf_pairs_[2 * i + which]);
    if (!h.to_be_fetched(leaf)) continue;
    for (const std::uint32_t primitive : h.leaf_primitives(leaf)) {
      const auto vertices = scene_->primitives(side.body)[primitive];
      to_fetch_.insert(to_fetch_.end(), vertices.begin(), vertices.end());
    }
    if (to_fetch_.size() > most) return motion_->fetch_all(side.body);
  }
  motion_->fetch(side.body, to_fetch_);
}

template <class S>
void WideQuery<S>::take_leaves(const Side& a, const Side& b, WideTraversal& state, PairBuffer& out,
                               std::uint64_t& tests) {
  const std::size_t count = state.found;
  state.found = 0;
  fetch_leaves(a, 0, count);
  fetch_leaves(b, 1, count);
  if (a.body != b.body) return append_pairs(a, b, 0, count, out, tests);
  const std::size_t different = take_out_own_leaves(leaf_pairs_.data(), count, own_leaves_);
  append_self_pairs(a, b, LeavesOf::two, different, out, tests);
}

template <class S>
void WideQuery<S>::take_own_leaves(const Side& a, const Side& b, PairBuffer& out, std::uint64_t& tests) {
  for_own_leaves(own_leaves_, leaf_pairs_.data(), leaf_pair_room,
                 [&](std::size_t count) { append_self_pairs(a, b, LeavesOf::one, count, out, tests); });
}

template <class S>
void WideQuery<S>::append_self_pairs(const Side& a, const Side& b, LeavesOf leaves, std::size_t count,
                                     PairBuffer& out, std::uint64_t& tests) {
  const Primitives* neighbours = a.positions == nullptr && scene_ ? &scene_->primitives(a.body) : nullptr;
  const std::size_t before = out.size();
  append_pairs(a, b, 0, count, out, tests);
  out.resize(before + keep_self_pairs(neighbours, leaves, out.data() + before, out.size() - before));
}

template <class S>
void append_leaf_pairs(const WideSide<S>& side_a, const S* positions_a, const WideSide<S>& side_b,
                       const S* positions_b, const LeafSlot* leaves, std::size_t begin, std::size_t end,
                       std::vector<FoundPair>& chunk, PairBuffer& out, std::uint64_t& tests) {
  WideTree<S>&a = *side_a.hierarchy, &b = *side_b.hierarchy;
  if (a.padded_leaf_size() == 1) {
    for (std::size_t i = begin; i < end; ++i)
      out.push_back({side_a.body, a.leaf_primitives(a.leaf_number(leaves[2 * i]))[0], side_b.body,
                     b.leaf_primitives(b.leaf_number(leaves[2 * i + 1]))[0]});
    return;
  }
  chunk.resize(found_at_once);
  WideLeafPairs<S> state{
      a.arrays(), b.arrays(),  a.leaves(positions_a), b.leaves(positions_b), leaves, begin,
      end,        side_a.body, side_b.body,           chunk.data(),          0,      found_at_once,
      0};
  const auto kernel = wide_overlap_kernels<S>(a.kernels()).pairs(a.width(), a.padded_leaf_size());
  while (state.next < state.count) {
    kernel(state);
    append_found({chunk.data(), state.found}, out);
    state.found = 0;
  }
  tests += state.tests;
}

template void append_leaf_pairs(const WideSide<float>&, const float*, const WideSide<float>&, const float*,
                                const LeafSlot*, std::size_t, std::size_t, std::vector<FoundPair>&,
                                PairBuffer&, std::uint64_t&);
template void append_leaf_pairs(const WideSide<double>&, const double*, const WideSide<double>&,
                                const double*, const LeafSlot*, std::size_t, std::size_t,
                                std::vector<FoundPair>&, PairBuffer&, std::uint64_t&);
template class WideQuery<float>;
template class WideQuery<double>;

}  // namespace kbvh
