#pragma once
#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "core/families/drift/kernels/near_pairs.hpp"
#include "core/families/wide/wide_hierarchy.hpp"
#include "core/scene/pairs.hpp"
#include "core/scene/self_pairs.hpp"

namespace kbvh {

/// Rows of the leaves of one body that a search visited; all pairs with this body share them.
template <class S>
class NearLeafRows {
 public:
  /// Invalidates all rows, because the positions changed.
  void positions_changed() {
    if (++stamp_ != 0) return;
    std::fill(stamps_.begin(), stamps_.end(), 0);
    stamp_ = 1;
  }
  std::size_t bytes() const { return rows_.size() * sizeof(S) + stamps_.size() * sizeof(std::uint32_t); }

 private:
  template <class>
  friend class NearPairs;
  AlignedArray<S> rows_;
  std::vector<std::uint32_t> stamps_;
  std::uint32_t stamp_ = 1;
};

/// Buffers of searches and reads; one search or read at a time may use them.
template <class S>
struct NearWork {
  std::vector<WidePair> stack;
  std::vector<LeafSlot> leaf_pairs;
  std::vector<LeafSlot> own_leaves;  ///< of a body with itself: found with themselves, and not taken yet
  std::vector<NearPair> found;
  std::vector<FoundPair> chunk;
  std::size_t bytes() const {
    return stack.size() * sizeof(WidePair) + (leaf_pairs.size() + own_leaves.capacity()) * sizeof(LeafSlot) +
           found.capacity() * sizeof(NearPair) + chunk.capacity() * sizeof(FoundPair);
  }
};

/// One side of a search for near pairs. The boxes of the hierarchy exceed the boxes of `positions` by the
/// margin (lower sides x, y, z, upper sides) and by `rounding` of their coordinates.
template <class S>
struct NearSide {
  WideHierarchy<S>* hierarchy;
  const S* positions;  ///< [vertex][3], one scalar past the end readable
  const S* margin;
  NearLeafRows<S>* rows;  ///< rows of these positions, as far as they exist
  S rounding = 0;         ///< additional error of a vertex, relative to its coordinate
  /// The primitives, for a body with itself: those that share a vertex are not listed. Null: they are.
  const Primitives* neighbours = nullptr;
};

/// The pairs of primitives of two bodies whose boxes can meet while the bodies close in on each other by no
/// more than a reach, in order of the closing at which they first can meet. For slow motion one list contains
/// the candidates of many frames, and each frame reads a prefix in proportion to the motion (neighbour lists,
/// Verlet 1967, for boxes). Both bodies may be the same one, whose vertices then close in on each other.
///
/// Closing is measured by side: the possible loss of the gap between a and b if b lies above a along x, y, z
/// (0 to 2), or below it (3 to 5).
template <class S>
class NearPairs {
 public:
  /// Searches from scratch. The reach per side is the sum of both margins and must be positive. Adds the box
  /// tests made to `tests`. Allocates only if there are more pairs than ever before. Both hierarchies need
  /// the same width and leaf size and must not be empty. For a body with itself, both sides are the same;
  /// each pair is listed once, canonical.
  void build(const NearSide<S>& a, const NearSide<S>& b, std::uint32_t body_a, std::uint32_t body_b,
             const S (&reach)[6], NearWork<S>& work, std::uint64_t& tests);
  void clear();

  /// Appends the pairs whose boxes can have met if no side has closed by more than this fraction of its
  /// reach; 0 to 1, rounding of the quotient included.
  void read(double fraction, PairBuffer& out) const;
  /// Appends those of these pairs whose boxes overlap at the current positions. Returns the number of
  /// examined pairs.
  std::size_t read_meeting(double fraction, const PrimitivesNow<S>& a, const PrimitivesNow<S>& b,
                           NearWork<S>& work, PairBuffer& out) const;
  std::size_t count() const { return pairs_.size(); }
  /// Returns the number of pairs that overlapped at the search.
  std::size_t overlapping() const { return bucket_end_[0]; }

  std::size_t bytes() const;

 private:
  static constexpr std::uint32_t buckets = 65;
  static std::uint32_t bucket(float ratio) {
    return ratio > 0 ? 1 + std::min(buckets - 2, std::uint32_t(ratio * float(buckets - 1))) : 0;
  }
  static void append(const FoundPair* pairs, std::size_t count, PairBuffer& out);
  void sort(std::span<const NearPair> found, std::uint32_t body_a, std::uint32_t body_b);
  static NearLeaves<S> leaves(const NearSide<S>& side);

  std::vector<FoundPair> pairs_;
  KernelSet kernels_{};
  std::uint32_t bucket_end_[buckets] = {};
};

extern template class NearPairs<float>;
extern template class NearPairs<double>;

}  // namespace kbvh
