#pragma once
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "core/families/linear/changed_parts.hpp"
#include "core/families/linear/linear_segment.hpp"
#include "core/families/linear/pair_marks.hpp"
#include "core/families/linear/shared_join.hpp"
#include "core/scene/pairs.hpp"
#include "core/scene/self_pairs.hpp"

namespace kbvh {

/// Times of a segment as fractions, in buckets of equal length: the events of a bucket may stay unordered
/// until a frame lies in it. The number is a power of two, so that no bucket limit is rounded.
struct FractionBuckets {
  static constexpr std::uint32_t count = 256;
  static std::uint32_t of(float fraction) {
    const auto bucket = std::uint32_t(fraction * float(count));
    return bucket < count ? bucket : count - 1;
  }
};

/// The pairs of primitives of two bodies whose linear boxes overlap within a segment, with the fractions at
/// which the overlap begins and ends: one traversal per segment, from which frames are read. Several pairs of
/// bodies may be joined together, with one traversal each: they share all buffers, and a frame reads them
/// together. Prior art: core/adr/0010-prior-art-of-answering-intervals.md.
template <class S>
class IntervalJoin {
 public:
  /// Joins from scratch for a segment. For one body with itself, pairs that share a vertex are left out
  /// unless `keep_neighbours` was called. Allocates only if there are more pairs than ever before.
  void join(const LinearSegment<S>& segment, const SceneView<S>& scene, std::uint32_t body_a,
            std::uint32_t body_b) {
    const BodyPair bodies{body_a, body_b};
    join(segment, scene, {&bodies, 1});
  }
  void join(const LinearSegment<S>& segment, const SceneView<S>& scene, std::span<const BodyPair> bodies) {
    start(segment, scene, bodies, leaf_pairs_at_once);
    step(std::numeric_limits<std::uint64_t>::max());
  }
  /// Does the same on several threads: the same pairs in the same order.
  void join(const LinearSegment<S>& segment, const SceneView<S>& scene, std::span<const BodyPair> bodies,
            Workers& workers);
  /// Starts the same join in parts. `step` works until it has made the given number of box tests, or slightly
  /// more, and returns whether the join is complete. The segment's boxes and positions must stay valid until
  /// then. Pairs of leaves are processed in groups of `leaf_pairs`.
  void start(const LinearSegment<S>& segment, const SceneView<S>& scene, std::span<const BodyPair> bodies,
             std::size_t leaf_pairs);
  bool step(std::uint64_t box_tests);
  /// Returns the number of box tests made so far.
  std::uint64_t tests() const { return node_tests_ + traversal_.tests + leaf_join_.tests; }
  /// The number of leaf pairs that are collected before they are turned into pairs of primitives: few enough
  /// to stay in the cache.
  static constexpr std::size_t leaf_pairs_at_once = 2048;

  /// Keeps pairs within one body that share a vertex from now on.
  void keep_neighbours() { with_neighbours_ = true; }

  /// From now on leaves out pairs of triangles that the slab of a leaf separates throughout the segment
  /// (SlabSpanPairs); all bodies must consist of triangles only.
  void use_slabs() { with_slabs_ = true; }

  /// Appends the pairs whose boxes overlap at a fraction of the segment. Fractions must not decrease within a
  /// segment. O(pairs that begin or end since the last call), plus one copy of the overlapping pairs.
  void read(float fraction, PairBuffer& out) {
    move_to(fraction);
    out.insert(out.end(), alive_.begin(), alive_.begin() + std::ptrdiff_t(alive_count_));
  }
  /// Does the same without the copy: O(pairs that begin or end). Afterwards the functions below return the
  /// pairs that overlap.
  void move_to(float fraction);
  bool overlaps(std::uint32_t pair) const {
    if (pair < permanent_count_) return true;
    const std::uint32_t place = place_[pair];
    return place >= permanent_count_ && place < alive_count_ && alive_places_[place] == pair;
  }
  /// Touches these marks whenever a pair begins or ends to overlap, until the next join.
  void follow(const FollowingMarks& marks) { following_ = marks; }

  /// The reader of the pairs: `read` and `move_to`, or a TriangleSpanFilter.
  enum class Reader : std::uint8_t { join, filter };
  /// Removes the pairs of primitives whose plans changed, and joins these primitives again: all their pairs
  /// within the segment from `fraction` on, which must not be before that of the last call of `read` or
  /// `move_to`. Removed pairs keep their places in `pairs`, but end at -1; new pairs are appended. `changed`
  /// holds the changes by body. Returns the box tests made. O(pairs) at the first call in a segment;
  /// afterwards in proportion to the changed primitives, their pairs, and the nodes above them.
  std::uint64_t repair(std::span<const ChangedParts> changed, float fraction, Reader reader);
  /// Returns the pairs that the last `repair` removed, and the first one that it appended.
  std::span<const std::uint32_t> removed() const { return removed_; }
  std::uint32_t first_added() const { return first_added_; }

  /// Returns all pairs of the segment: first those that overlap from its start to its end, then the others
  /// roughly in the order of their start.
  std::span<const JoinedPair> pairs() const { return {sorted_.data(), count_}; }
  /// Returns the size of a prefix of `pairs` that contains all pairs that overlap at the start; pairs that
  /// overlap throughout are first in it.
  std::size_t from_begin() const { return bucket_end_[0]; }
  std::size_t throughout() const { return throughout_; }
  /// Calls use(pair) for all pairs in the order in which the traversal found them, which is similar in
  /// consecutive segments; pairs that overlap throughout come first.
  template <class Use>
  void for_found(const Use& use) const {
    const std::size_t joined = throughout_ + found_at_.size();
    for (std::uint32_t pair = 0; pair < throughout_; ++pair) use(pair);
    for (const std::uint32_t pair : found_at_) use(pair);
    for (auto pair = std::uint32_t(joined); pair < count_; ++pair) use(pair);
  }
  /// Returns the bodies of one of `pairs`, by its index.
  BodyPair bodies_of(std::size_t pair) const {
    return bodies_.size() == 1 ? bodies_[0] : bodies_[bodies_of_[pair]];
  }
  /// Returns one of `pairs`, by its index, with its bodies.
  PrimitivePair primitives_of(std::size_t pair) const {
    const BodyPair bodies = bodies_of(pair);
    return {bodies.first, sorted_[pair].primitive_a, bodies.second, sorted_[pair].primitive_b};
  }

  std::size_t bytes() const;

 private:
  static constexpr std::uint32_t none = ~std::uint32_t(0);
  using Found = typename SharedJoin<S>::Ends;
  void begin_bodies();
  void end_bodies();
  void take_leaves(std::size_t end, LeavesOf leaves);
  std::size_t filter_leaves(std::size_t count);
  static SlabSpanPairs<S> slabs_of(const BodySegmentBounds<S>& a, const BodySegmentBounds<S>& b);
  void take_self_leaves(std::size_t end, LeavesOf leaves);
  void take_own_leaves();
  void take_found_leaves();
  void sort_by_begin();
  void sort_by_begin(Workers& workers);
  void start_reading();
  bool is_removed(std::uint32_t index) const { return sorted_[index].end < 0; }
  void index_pairs();
  void link(std::uint32_t index);
  void remove(std::uint32_t index, Reader reader);
  void remove_changed(std::span<const ChangedParts> changed, Reader reader);
  void join_changed(const ChangedParts& a, const ChangedParts& b);
  void make_room(std::size_t pairs);
  void add(const JoinedPair& pair, std::uint32_t bodies, float fraction, Reader reader);
  void begin_added(float fraction, std::uint32_t bucket);
  void begin_pair(std::uint32_t index);
  void end_pair(std::uint32_t index);

  const LinearSegment<S>* segment_ = nullptr;
  std::optional<SceneView<S>> scene_;
  std::vector<BodyPair> bodies_;  ///< the joined bodies
  std::vector<Found> found_;      ///< [pair of bodies]: pairs up to and including it; completed ones
  std::size_t leaf_pairs_room_ = 0;
  std::uint64_t node_tests_ = 0;  ///< of completed pairs of bodies
  std::uint32_t padded_ = 4;      ///< lanes of a leaf
  bool self_ = false;             ///< the current pair is one body with itself
  bool with_neighbours_ = false, with_slabs_ = false, done_ = true;
  SlabSpanPairs<S> slabs_{};          ///< of the current pair of bodies
  std::vector<std::uint32_t> masks_;  ///< [pair of leaves]
  WideTraversal traversal_{};
  WideLeafJoin<S> leaf_join_{};
  typename WideLinearKernels<S>::Join traverse_ = nullptr;
  typename WideLinearKernels<S>::LeafJoin join_leaves_ = nullptr;
  const Primitives* neighbours_ = nullptr;
  std::vector<WidePair> stack_;
  std::vector<LeafSlot> leaf_pairs_;
  std::vector<LeafSlot> own_leaves_;  ///< found with themselves, and not taken yet
  JoinedColumns found_throughout_, found_partly_;
  std::vector<JoinedPair> sorted_;          ///< may be longer than the number of pairs
  std::vector<std::uint32_t> bodies_of_;    ///< [sorted_] index into bodies_, if there are several
  std::vector<std::uint32_t> found_at_;     ///< the other pairs in the order of discovery, by index
  std::size_t throughout_ = 0, count_ = 0;  ///< counts in sorted_: from start to end, and all
  bool reading_ = false;
  std::uint32_t bucket_end_[FractionBuckets::count] = {};  ///< in sorted_
  std::uint32_t next_ = 0;  ///< index into sorted_: earlier pairs have begun, or are in `waiting_`
  std::vector<std::uint32_t> waiting_;  ///< of the current bucket
  /// The first `alive_count_` entries overlapped at the last `read`; pairs that overlap throughout come
  /// first.
  PairBuffer alive_;
  std::uint32_t alive_count_ = 0;
  std::vector<std::uint32_t> alive_places_, place_;  ///< indices into sorted_, and the inverse map
  /// Alive pairs, in lists by the bucket of their end.
  std::uint32_t ending_[FractionBuckets::count] = {}, present_ = 0;
  std::vector<std::uint32_t> next_ending_;
  std::uint32_t permanent_count_ = 0;  ///< these first pairs of `alive_` overlap throughout, in order
  FollowingMarks following_;
  /// Only with several threads: the join; [part of the pairs][bucket] the place of the next pair; the pairs
  /// of bodies that were joined.
  SharedJoin<S> shared_;
  std::vector<std::uint32_t> bucket_places_, added_;

  // Only after a repair in the segment:
  bool indexed_ = false;
  std::vector<std::uint32_t> first_primitive_;  ///< [body]: number of its first primitive in the scene
  std::vector<std::uint32_t> heads_, links_;    ///< lists of pairs by primitive; links: [pair][side]
  std::vector<std::uint32_t> removed_;
  std::uint32_t first_added_ = 0;
  /// Added pairs that have not begun, in lists by the bucket of their begin, linked in next_ending_.
  std::uint32_t beginning_[FractionBuckets::count] = {}, beginning_from_ = 0;
  bool has_beginning_ = false;
  std::vector<std::uint8_t> no_lanes_;     ///< all 0
  std::vector<std::uint16_t> no_entries_;  ///< all 0
};

extern template class IntervalJoin<float>;
extern template class IntervalJoin<double>;

}  // namespace kbvh
