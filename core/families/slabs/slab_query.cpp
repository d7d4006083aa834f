#include "core/families/slabs/slab_query.hpp"

#include <algorithm>
#include <limits>
#include <stdexcept>

#include "core/base/assert.hpp"
#include "core/families/wide/leaf_slots.hpp"
#include "core/scene/self_pairs.hpp"

namespace kbvh {

namespace {
constexpr std::size_t column_room = 4096;
}  // namespace

template <class S>
SlabLeaves<S> SlabBlocks<S>::of(const WideTree<S>& tree, const S* positions) {
  const std::size_t leaves = tree.leaf_count();
  if (stamps_.size() != leaves) {
    stamps_.assign(leaves, 0);
    stamp_ = 1;
    blocks_.resize(leaves * SlabBlock::scalars(tree.padded_leaf_size()));
  }
  return {tree.leaf_lists(), blocks_.data(), stamps_.data(), stamp_, positions};
}

template <class S>
QueryStatus SlabQuery<S>::run(const Side& a, const Side& b, PairBuffer& out, std::uint64_t& tests,
                              const Budget& budget, S rounding) {
  if (a.hierarchy->empty() || b.hierarchy->empty()) return {};
  if (!a.hierarchy->suits(*b.hierarchy))
    throw std::invalid_argument("a query needs hierarchies of one width and leaf size");
  const std::uint32_t width = a.hierarchy->width(), padded = a.hierarchy->padded_leaf_size();
  KBVH_ASSERT(padded > 1);
  stack_.resize(std::max<std::size_t>(stack_.size(), 1024));
  leaf_pairs_.resize(2 * leaf_pair_room);
  column_a_.resize(column_room);
  column_b_.resize(column_room);
  WideTraversal state{stack_.data(),  0, stack_.size(),   leaf_pairs_.data(), 0,
                      leaf_pair_room, 1, budget.box_tests};
  if (overlap(a.hierarchy->root_box(), b.hierarchy->root_box())) state.stack[state.depth++] = {0, 0};
  const bool self = a.body == b.body;
  SlabLeafPairs<S> leaves{a.hierarchy->arrays(),
                          b.hierarchy->arrays(),
                          a.blocks->of(*a.hierarchy, a.positions),
                          b.blocks->of(*b.hierarchy, b.positions),
                          rounding,
                          leaf_pairs_.data(),
                          0,
                          0,
                          column_a_.data(),
                          column_b_.data(),
                          0,
                          column_room,
                          0,
                          0};
  const auto& overlaps = wide_overlap_kernels<S>(a.hierarchy->kernels());
  const auto traverse = self ? overlaps.self(width) : overlaps.traverse(width);
  const auto pairs = slab_kernels<S>(a.hierarchy->kernels()).pairs(width, padded);
  const Primitives* const neighbours = self ? &scene_.primitives(a.body) : nullptr;
  const auto take = [&](std::size_t end, LeavesOf from) {
    leaves.count = end;
    while (leaves.next < leaves.count) {
      leaves.found = 0;
      pairs(leaves);
      std::size_t size = out.size();
      out.resize(size + leaves.found);
      for (std::size_t i = 0; i < leaves.found; ++i)
        out[size + i] = {a.body, column_a_[i], b.body, column_b_[i]};
      if (self) out.resize(size + keep_self_pairs(neighbours, from, out.data() + size, out.size() - size));
    }
  };
  while (state.depth > 0 && state.tests < state.test_limit) {
    traverse(leaves.a, leaves.b, state);
    leaf_pairs_seen_ += state.found;
    leaves.next = 0;
    take(self ? take_out_own_leaves(leaf_pairs_.data(), state.found, own_leaves_) : state.found,
         LeavesOf::two);
    state.found = 0;
    if (state.depth + max_pairs_per_step >= state.stack_room) {
      stack_.resize(2 * stack_.size());
      state.stack = stack_.data();
      state.stack_room = stack_.size();
    }
  }
  for_own_leaves(own_leaves_, leaf_pairs_.data(), leaf_pair_room, [&](std::size_t count) {
    leaves.next = 0;
    take(count, LeavesOf::one);
  });
  tests += state.tests + leaves.tests;
  separated_ += leaves.separated;
  return {state.depth};
}

template <class S>
bool SlabQuery<S>::accepts(const Primitives& primitives) {
  if (primitives.kind != PrimitiveKind::polygons) return false;
  for (std::uint32_t p = 0; p < primitives.count(); ++p)
    if (primitives.offsets[p + 1] - primitives.offsets[p] != 3) return false;
  return true;
}

template class SlabBlocks<float>;
template class SlabBlocks<double>;
template class SlabQuery<float>;
template class SlabQuery<double>;

}  // namespace kbvh
