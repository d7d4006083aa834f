#pragma once
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "core/families/linear/linear_segment.hpp"
#include "core/scene/pairs.hpp"
#include "core/scene/self_pairs.hpp"

namespace kbvh {

/// Times of a segment, as fractions, in buckets of one length: what happens in a bucket can be left in any
/// order until a frame lies in it. Powers of two, so that no bucket's limits are rounded.
struct FractionBuckets {
  static constexpr std::uint32_t count = 256;
  static std::uint32_t of(float fraction) {
    const auto bucket = std::uint32_t(fraction * float(count));
    return bucket < count ? bucket : count - 1;
  }
};

/// The pairs of primitives of two bodies whose linear boxes overlap within a segment, with the fractions at
/// which they begin and cease to: one traversal for a whole segment, from which frames are read. Or the same
/// of many pairs of bodies together, one traversal each: they share all buffers, and a frame reads them as
/// one.
template <class S>
class IntervalJoin {
 public:
  /// Joins anew for a segment; within one body if both are the same, and then without pairs that share a
  /// vertex, unless `keep_neighbours` was called. Allocates only where there are more pairs than ever before.
  void join(const LinearSegment<S>& segment, const SceneView<S>& scene, std::uint32_t body_a,
            std::uint32_t body_b) {
    const BodyPair bodies{body_a, body_b};
    join(segment, scene, {&bodies, 1});
  }
  void join(const LinearSegment<S>& segment, const SceneView<S>& scene, std::span<const BodyPair> bodies) {
    start(segment, scene, bodies, leaf_pairs_at_once);
    step(std::numeric_limits<std::uint64_t>::max());
  }
  /// The same in parts: `step` works until it has made so many box tests, or somewhat more, and returns
  /// whether all is done. The segment's boxes and positions stay in use until then. Pairs of leaves are
  /// looked at when there are `leaf_pairs` of them.
  void start(const LinearSegment<S>& segment, const SceneView<S>& scene, std::span<const BodyPair> bodies,
             std::size_t leaf_pairs);
  bool step(std::uint64_t box_tests);
  /// Box tests that the join has made so far.
  std::uint64_t tests() const { return node_tests_ + traversal_.tests + leaf_join_.tests; }
  /// Pairs of leaves that are collected before they are turned into pairs of primitives: few enough to stay
  /// in the cache.
  static constexpr std::size_t leaf_pairs_at_once = 2048;

  /// From now on pairs within one body that share a vertex are kept.
  void keep_neighbours() { with_neighbours_ = true; }

  /// Appends the pairs whose boxes overlap at a fraction of the segment, which never decreases within one.
  /// O(pairs that begin or end since the last call), and one copy of those that overlap.
  void read(float fraction, PairBuffer& out);

  /// All pairs of the segment: first those that overlap from its begin to its end, then the others in the
  /// order in which they begin, roughly.
  std::span<const JoinedPair> pairs() const { return {sorted_.data(), count_}; }
  /// All that overlap at the begin are among so many first ones, and all that overlap throughout are the
  /// first of those.
  std::size_t from_begin() const { return bucket_end_[0]; }
  std::size_t throughout() const { return throughout_; }
  /// The bodies of one of `pairs`, by its place there.
  BodyPair bodies_of(std::size_t pair) const {
    return bodies_.size() == 1 ? bodies_[0] : bodies_[bodies_of_[pair]];
  }

  std::size_t bytes() const;

 private:
  static constexpr std::uint32_t none = ~std::uint32_t(0);
  /// What a join found, in columns; there is room for more than was found.
  struct Columns {
    std::vector<std::uint32_t> primitive_a, primitive_b;
    std::vector<float> begin, end;

    JoinColumns view(std::size_t found, bool timed);
    std::size_t bytes() const;
  };
  /// How many pairs were found with one pair of bodies, and all before it.
  struct Found {
    std::size_t throughout, partly;
  };
  void begin_bodies();
  void end_bodies();
  void take_leaves(std::size_t end);
  void take_self_leaves(std::size_t end, LeavesOf leaves);
  void sort_by_begin();
  void start_reading();
  void begin_pair(std::uint32_t index);
  void end_pair(std::uint32_t index);

  const LinearSegment<S>* segment_ = nullptr;
  std::optional<SceneView<S>> scene_;
  std::vector<BodyPair> bodies_;  ///< that are joined
  std::vector<Found> found_;      ///< [pair of bodies] of those that are done
  std::size_t leaf_pairs_room_ = 0;
  std::uint64_t node_tests_ = 0;  ///< of pairs of bodies that are done
  bool self_ = false;             ///< the present pair is one body
  bool with_neighbours_ = false, done_ = true;
  WideTraversal traversal_{};
  WideLeafJoin<S> leaf_join_{};
  typename WideLinearKernels<S>::Join traverse_ = nullptr;
  typename WideLinearKernels<S>::LeafJoin join_leaves_ = nullptr;
  const Primitives* neighbours_ = nullptr;
  std::vector<WidePair> stack_;
  std::vector<LeafSlot> leaf_pairs_;
  Columns found_throughout_, found_partly_;
  std::vector<JoinedPair> sorted_;          ///< there may be more than there are pairs
  std::vector<std::uint32_t> bodies_of_;    ///< [sorted_] index into bodies_, where there are several
  std::size_t throughout_ = 0, count_ = 0;  ///< in sorted_: from begin to end, and all
  bool reading_ = false;
  std::uint32_t bucket_end_[FractionBuckets::count] = {};  ///< in sorted_
  std::uint32_t next_ = 0;              ///< in sorted_: those before it have begun, or are in `waiting_`
  std::vector<std::uint32_t> waiting_;  ///< of the present bucket
  /// The first `alive_count_` of them at the last `read`, and first of all those that overlap throughout.
  PairBuffer alive_;
  std::uint32_t alive_count_ = 0;
  std::vector<std::uint32_t> alive_places_, place_;  ///< their places in sorted_, and back
  /// Pairs that are alive, in lists by the bucket in which they end.
  std::uint32_t ending_[FractionBuckets::count] = {}, present_ = 0;
  std::vector<std::uint32_t> next_ending_;
};

extern template class IntervalJoin<float>;
extern template class IntervalJoin<double>;

}  // namespace kbvh
