#pragma once
#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "core/families/drift/kernels/near_pairs.hpp"
#include "core/families/wide/wide_hierarchy.hpp"

namespace kbvh {

/// Rows of the leaves of one body that a search came to; all pairs that the body is in share them.
template <class S>
class NearLeafRows {
 public:
  /// The positions are others now: nothing is taken over.
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

/// Buffers of searches and reads, which need them one at a time.
template <class S>
struct NearWork {
  std::vector<WidePair> stack;
  std::vector<LeafSlot> leaf_pairs;
  std::vector<NearPair> found;
  std::vector<FoundPair> chunk;
  std::size_t bytes() const {
    return stack.size() * sizeof(WidePair) + leaf_pairs.size() * sizeof(LeafSlot) +
           found.capacity() * sizeof(NearPair) + chunk.capacity() * sizeof(FoundPair);
  }
};

/// One side of a search for near pairs. The boxes of the hierarchy are larger than those of `positions` by
/// the margin (lower sides x, y, z, upper sides), with all its roundings at most 4 ulps of the largest
/// coordinate too small.
template <class S>
struct NearSide {
  WideHierarchy<S>* hierarchy;
  const S* positions;  ///< [vertex][3], one scalar past the end readable
  const S* margin;
  NearLeafRows<S>* rows;  ///< of these positions, as far as there are any
};

/// The pairs of primitives of two bodies whose boxes can meet while the bodies close in on each other by no
/// more than a reach, in the order in which they can: what moves little has the candidates of many frames in
/// one list, and each frame takes as much of its beginning as the bodies have moved (lists of neighbours,
/// Verlet 1967, for boxes).
///
/// Closing is by side: what the gap between a and b may have lost if b lies above a along x, y, z (0 to 2),
/// or below it (3 to 5).
template <class S>
class NearPairs {
 public:
  /// Searches anew. The reach is what both margins add up to, by side: positive. Adds the box tests made to
  /// `tests`. Allocates only where there are more pairs than ever before. Hierarchies need one width and leaf
  /// size. Not for empty hierarchies.
  void build(const NearSide<S>& a, const NearSide<S>& b, std::uint32_t body_a, std::uint32_t body_b,
             const S (&reach)[6], NearWork<S>& work, std::uint64_t& tests);
  void clear();

  /// Appends the pairs whose boxes can have met when no side has closed by more than this fraction of its
  /// reach; 0 to 1, rounding of the quotient included.
  void read(double fraction, PairBuffer& out) const;
  /// The same, less those whose boxes do not overlap at the present positions. Returns how many it looked at.
  std::size_t read_meeting(double fraction, const PrimitivesNow<S>& a, const PrimitivesNow<S>& b,
                           NearWork<S>& work, PairBuffer& out) const;
  std::size_t count() const { return pairs_.size(); }
  /// How many of them overlapped when they were found.
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
