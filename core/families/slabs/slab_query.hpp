#pragma once
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "core/families/slabs/kernels/slabs.hpp"
#include "core/families/wide/wide_query.hpp"
#include "core/families/wide/wide_tree.hpp"

namespace kbvh {

/// The blocks of one body's leaves (SlabBlock).
template <class S>
class SlabBlocks {
 public:
  /// Invalidates all blocks, because positions changed; queries recompute them on demand.
  void positions_changed() {
    if (++stamp_ != 0) return;
    std::fill(stamps_.begin(), stamps_.end(), 0);
    stamp_ = 1;
  }
  /// Returns the blocks of a hierarchy's leaves; allocates if there are more leaves than ever before.
  SlabLeaves<S> of(const WideTree<S>& tree, const S* positions);
  std::size_t bytes() const { return blocks_.size() * sizeof(S) + stamps_.size() * sizeof(std::uint32_t); }

 private:
  AlignedArray<S> blocks_;
  std::vector<std::uint32_t> stamps_;
  std::uint32_t stamp_ = 1;
};

/// Queries two hierarchies of triangles, or one with itself: boxes down to the leaves, then in each pair of
/// leaves the triangles whose boxes overlap and which meet the other leaf's slab, the space between two
/// parallel planes that contains the leaf. Pairs of triangles that share a point are never lost. Keeps its
/// buffers from frame to frame.
template <class S>
class SlabQuery {
 public:
  explicit SlabQuery(const SceneView<S>& scene) : scene_(scene) {}

  /// One body of a query. Its leaves have more than one triangle, and all its boxes are current.
  struct Side {
    WideTree<S>* hierarchy;
    std::uint32_t body;
    SlabBlocks<S>* blocks;
    const S* positions;
  };
  /// Appends the pairs. Returns the work that the budget left undone; adds the box tests made, including
  /// those of triangles against slabs, to `tests`. `rounding` as in SlabLeafPairs; smaller values are a
  /// fault.
  QueryStatus run(const Side& a, const Side& b, PairBuffer& out, std::uint64_t& tests, const Budget& budget,
                  S rounding = enough_rounding);
  /// The product of a direction and a corner, three products and two sums in S, has an error below 3.1 half
  /// units of the leaf's largest coordinate, because the direction's components add up to 1. One more is for
  /// the sum of a bound and the slack: at most half of this value.
  static constexpr S enough_rounding = 4 * std::numeric_limits<S>::epsilon();
  /// Returns the pairs of leaves compared so far, and those that a slab separated completely.
  std::uint64_t leaf_pairs() const { return leaf_pairs_seen_; }
  std::uint64_t separated() const { return separated_; }
  void clear_counts() { leaf_pairs_seen_ = separated_ = 0; }

  /// Returns whether a body consists of triangles only. O(primitives).
  static bool accepts(const Primitives& primitives);
  std::size_t bytes() const {
    return stack_.capacity() * sizeof(WidePair) +
           (leaf_pairs_.capacity() + own_leaves_.capacity()) * sizeof(LeafSlot) +
           (column_a_.capacity() + column_b_.capacity()) * sizeof(std::uint32_t);
  }

 private:
  SceneView<S> scene_;
  std::vector<WidePair> stack_;
  std::vector<LeafSlot> leaf_pairs_;
  std::vector<LeafSlot> own_leaves_;  ///< found with themselves, and not taken yet
  std::vector<std::uint32_t> column_a_, column_b_;
  std::uint64_t leaf_pairs_seen_ = 0, separated_ = 0;
};

extern template class SlabBlocks<float>;
extern template class SlabBlocks<double>;
extern template class SlabQuery<float>;
extern template class SlabQuery<double>;

}  // namespace kbvh
