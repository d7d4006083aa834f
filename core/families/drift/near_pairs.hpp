#pragma once
#include <cstdint>
#include <vector>

#include "core/families/drift/kernels/near_pairs.hpp"
#include "core/families/wide/wide_hierarchy.hpp"

namespace kbvh {

/// One side of a search for near pairs. The boxes of the hierarchy are larger than those of `positions` by
/// the margin (lower sides x, y, z, upper sides), with all its roundings at most 4 ulps of the largest
/// coordinate too small.
template <class S>
struct NearSide {
  WideHierarchy<S>* hierarchy;
  const S* positions;  ///< [vertex][3], one scalar past the end readable
  const S* margin;
  bool same;  ///< the positions are those of the last `build`
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
             const S (&reach)[6], std::uint64_t& tests);
  void clear();
  /// Positions may have changed in ways that nobody has told of: the next `build` takes nothing over.
  void forget();

  /// Appends the pairs whose boxes can have met when no side has closed by more than this fraction of its
  /// reach; 0 to 1, rounding of the quotient included.
  void read(double fraction, PairBuffer& out) const;
  /// The same, less those whose boxes do not overlap at the present positions. Returns how many it looked at.
  std::size_t read_meeting(double fraction, const PrimitivesNow<S>& a, const PrimitivesNow<S>& b,
                           PairBuffer& out);
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
  void sort(std::size_t found, std::uint32_t body_a, std::uint32_t body_b);

  struct Leaves {
    AlignedArray<S> rows;
    std::vector<std::uint32_t> stamps;
    std::uint32_t stamp = 0;
  };
  NearLeaves<S> leaves(const NearSide<S>& side, Leaves& own);

  Leaves leaves_[2];
  std::vector<WidePair> stack_;
  std::vector<LeafSlot> leaf_pairs_;
  std::vector<NearPair> found_;
  std::vector<FoundPair> pairs_, chunk_;
  KernelSet kernels_{};
  std::uint32_t bucket_end_[buckets] = {};
};

extern template class NearPairs<float>;
extern template class NearPairs<double>;

}  // namespace kbvh
