#pragma once
#include <cstdint>
#include <vector>

#include "core/families/envelope/kernels/wide_realisers.hpp"
#include "core/families/wide/wide_hierarchy.hpp"

namespace kbvh {

/// What an envelope did, for counters.
struct EnvelopeCounts {
  std::uint64_t active_sides = 0;  ///< sides that have another realiser at the end of the segment
  std::uint64_t crossings = 0;     ///< crossings of two lines that were computed
  std::uint64_t exact = 0;         ///< decisions that were too close for double arithmetic
  std::uint64_t stores = 0;        ///< realisers written while time went on
};

/// The vertices that realise the boxes of one wide hierarchy, in the layout of its rows: [node][6][width],
/// each as 3 * vertex + axis. The root's own box is that of its children and needs none.
using WideRealisers = AlignedArray<std::uint32_t>;

/// Any vertices that realise the boxes at `positions`; O(nodes + vertices of leaves). For starts: slow.
template <class S>
void find_realisers(WideHierarchy<S>& hierarchy, const S* positions, WideRealisers& realisers);

/// Who realises which side of which box, and from when on, over one segment in which every vertex of a body
/// moves along a line between two stored positions.
///
/// A side whose realiser at the begin also realises it at the end does so throughout: both are linear, and
/// nobody is ahead of it at either end. So one pass of the cost of a few refits finds the few sides that are
/// *active*, and each of those is the upper envelope of lines, which is walked from crossing to crossing.
/// Envelopes of inner nodes are those of the lines that take part in the envelopes below. What comes of it is
/// a list of stores, (time, side, new realiser), in buckets by time; frames carry out those that are due.
///
/// Exact on truth A: end points are stored numbers, so times of crossings are right to a few roundings; what
/// is closer than that is decided by exact arithmetic, between two crossings when the envelope is made, and
/// between a crossing and a frame when the frame comes. Rounding is monotone, so that whoever realises a side
/// exactly does so among the rounded positions.
template <class S>
class SegmentEnvelope {
 public:
  /// From `key` on, `slot` of the realisers is `realiser`. A key is the fraction of the segment, in steps of
  /// 2^-32, rounded down.
  struct Store {
    std::uint32_t key, slot, realiser;
    bool operator==(const Store&) const = default;
  };
  /// Takes the shape of a hierarchy. Segments can be made in as many slices as that, if there are nodes
  /// enough; in more where it costs nothing. Allocates.
  void assign(const WideHierarchy<S>& hierarchy, std::uint32_t slices = 1);

  /// Makes the envelopes of the segment from t0 to t1 > t0, in which vertices move from p0 to p1, both
  /// [vertex][3] with one readable number behind, and both stored numbers. `realisers` are those at t0.
  /// O(nodes + vertices of leaves), and O(lines of a side) for each store.
  void make(WideHierarchy<S>& hierarchy, const WideRealisers& realisers, const S* p0, const S* p1, double t0,
            double t1);
  /// The segment from t0 to t1 > t0 if nobody overtakes anybody in it.
  void make_empty(double t0, double t1);

  /// Makes the envelopes of the segment from `end()` to t1, otherwise as `make` does, but in slices, while
  /// `advance` goes on with the present one: first `start_next`, then `step` as often as wanted, then
  /// `take_next`. Any other segment that is made meanwhile ends that.
  void start_next(const WideHierarchy<S>& hierarchy, const S* p0, const S* p1, double t1);
  /// Does a share of the whole work of this, what was done before included: 1 is all. `realisers` are those
  /// of the present, `at_end`, as large and the same at each call, becomes those at its end.
  void step(WideHierarchy<S>& hierarchy, const WideRealisers& realisers, WideRealisers& at_end, double share);
  /// Wide nodes of which the sides have not been looked at.
  std::uint32_t nodes_left() const { return nodes_left_; }
  /// The next segment, made to the end, is the present one; realisers have been brought to its begin.
  void take_next();

  /// Brings the realisers from the last time asked for (first: t0) to t, t0 <= t <= t1. O(stores that are
  /// due).
  void advance(double t, WideRealisers& realisers);

  /// The stores of the segment, those of one side in the order of time.
  const std::vector<Store>& stores() const { return segments_[now_].made; }

  double begin() const { return segments_[now_].t0; }
  double end() const { return segments_[now_].t1; }
  const EnvelopeCounts& counts() const { return counts_; }
  void clear_counts() { counts_ = {}; }
  std::size_t bytes() const;

 private:
  struct Line {
    S begin, end;  ///< values, seen from the side: more is further out
    std::uint32_t place;
  };
  struct Walk {
    std::uint32_t slot, realiser, count;  ///< of its lines
  };
  struct Segment {
    const S *p0 = nullptr, *p1 = nullptr;
    double t0 = 0, t1 = 0;
    std::vector<Store> made, stores;          ///< as they were made; in buckets
    std::vector<std::uint32_t> bucket{0, 0};  ///< [bucket]: where it begins in `stores`
    std::uint32_t bucket_shift = 0;           ///< key >> shift is its bucket
    std::size_t next = 0, ordered = 0;        ///< first store not carried out; stores before are in order
    Piece<S> piece(std::uint32_t place) const { return {t0, t1, p0[place], p1[place], PieceKind::chord}; }
  };
  void start(std::uint32_t which, const WideHierarchy<S>& hierarchy, const S* p0, const S* p1, double t0,
             double t1);
  void make_block(WideHierarchy<S>& hierarchy, const WideRealisers& realisers);
  void carry_over(const WideRealisers& realisers, WideRealisers& at_end);
  std::uint32_t next_block() const;
  void walk_leaves(WideHierarchy<S>& hierarchy, const WideRealisers& realisers, std::uint32_t begin,
                   std::uint32_t end);
  void walk_above(WideHierarchy<S>& hierarchy, const WideRealisers& realisers, std::uint32_t node);
  void walk(std::uint32_t slot, Line now, Line* lines, std::size_t count);
  Line* room_for(std::size_t lines);
  static double meeting(const Line& now, const Line& later);
  std::size_t first_exactly(const Line& now, const Line* lines, std::size_t count);
  bool comes_first(const Line& x, const Line& y, const Line& winner) const;
  bool is_lower(std::uint32_t slot) const { return slot % lane_scalars(width_) < 3 * width_; }
  bool is_due(const Store& store, std::uint32_t before, double t);
  void fill_buckets(std::size_t steps);

  std::uint32_t width_ = 8;
  std::uint32_t block_ = 1;                 ///< nodes that are made together
  Segment segments_[2];                     ///< the present one; the next one, where it is made ahead
  std::uint32_t now_ = 0, making_ = 0;      ///< in segments_
  std::uint32_t nodes_left_ = 0;            ///< of the segment being made
  std::size_t sorted_ = 0;                  ///< steps done of its sorting, two for each store
  std::size_t carried_ = 0;                 ///< stores of the present segment that its end has
  AlignedArray<S> node_bounds_;             ///< boxes at the end
  std::vector<std::uint64_t> lost_;         ///< by node: active sides
  std::vector<std::uint32_t> first_store_;  ///< by slot, of active sides
  std::vector<Line> lines_;
  std::vector<Walk> walks_;
  EnvelopeCounts counts_;
};

extern template class SegmentEnvelope<float>;
extern template class SegmentEnvelope<double>;

}  // namespace kbvh
