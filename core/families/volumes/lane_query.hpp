#pragma once
#include <cstdint>
#include <vector>

#include "core/families/volumes/lane_tree.hpp"
#include "core/scene/pairs.hpp"
#include "core/scene/self_pairs.hpp"

namespace kbvh {

/// The memory of searches in trees of eight lanes; one serves all bodies.
struct LaneScratch {
  std::vector<WidePair> stack = std::vector<WidePair>(1024);
  std::vector<LeafSlot> leaves, own;  ///< own: those found with themselves
  std::vector<FoundPair> found;
  std::size_t bytes() const {
    return stack.capacity() * sizeof(WidePair) + (leaves.capacity() + own.capacity()) * sizeof(LeafSlot) +
           found.capacity() * sizeof(FoundPair);
  }
};

/// One of the two bodies of a search.
template <class S>
struct LaneSide {
  LaneTree<S>* tree;
  const S* placed;  ///< the points' positions (LaneTree::place)
  std::uint32_t body;
};

/// A search of two trees, or of one with itself, for pairs of primitives whose boxes overlap: the caller's
/// kernel finds pairs of leaves by the volumes of nodes, and the boxes of primitives decide between leaves.
template <class S>
class LaneSearch {
 public:
  LaneSearch(const LaneSide<S>& a, const LaneSide<S>& b, KernelSet kernels, LaneScratch& scratch,
             const Budget& budget, std::uint64_t tests_before);

  /// Calls step(state) until nothing is left or the budget is spent; appends the pairs. `roots_overlap` is
  /// the result of the first test. Returns the number of pairs of nodes left undone.
  template <class Step>
  std::size_t run(bool roots_overlap, Step&& step, PairBuffer& out) {
    if (roots_overlap) state_.stack[state_.depth++] = {0, 0};
    while (state_.depth > 0 && state_.tests < state_.test_limit) {
      step(state_);
      take_leaves(out);
      grow();
    }
    take_own_leaves(out);
    return state_.depth;
  }
  /// Returns the tests of nodes and of primitives' boxes, including earlier ones.
  std::uint64_t tests() const { return state_.tests; }

 private:
  void take_leaves(PairBuffer& out);
  void take_own_leaves(PairBuffer& out);
  void append(std::size_t count, PairBuffer& out);
  void append_within(LeavesOf leaves, std::size_t count, PairBuffer& out);
  void grow();

  LaneSide<S> a_, b_;
  KernelSet kernels_;
  LaneScratch* scratch_;
  WideTraversal state_;
};

extern template class LaneSearch<float>;
extern template class LaneSearch<double>;

}  // namespace kbvh
