#pragma once
#include <cstdint>
#include <vector>

#include "core/families/wide/kernels/wide_realisers.hpp"
#include "core/families/wide/wide_hierarchy.hpp"

namespace kbvh {

/// Counts the work of an envelope, for counters.
struct EnvelopeCounts {
  std::uint64_t active_sides = 0;  ///< sides with another realiser at the end of the segment
  std::uint64_t crossings = 0;     ///< computed crossings of two lines
  std::uint64_t exact = 0;         ///< decisions that were too close for double arithmetic
  std::uint64_t stores = 0;        ///< realisers written during the segment
};

/// The vertices that realise the boxes of one wide hierarchy, in the layout of its rows: [node][6][width],
/// each as 3 * vertex + axis. The root's own box is the box of its children and needs none.
using WideRealisers = AlignedArray<std::uint32_t>;

/// Finds any vertices that realise the boxes at `positions`; O(nodes + vertices of leaves). Slow; for starts.
template <class S>
void find_realisers(WideHierarchy<S>& hierarchy, const S* positions, WideRealisers& realisers);

/// The realisers of all sides of all boxes over one segment, in which every vertex of a body moves on a line
/// between two stored positions.
///
/// A side whose realiser at the start also realises it at the end is realised by it throughout: both bounds
/// are linear, and no vertex is ahead at either end. One pass with the cost of a few refits therefore finds
/// the few *active* sides. Each active side is the upper envelope of lines, which is walked from crossing to
/// crossing. Envelopes of inner nodes are those of the lines in the envelopes below. The result is a list of
/// stores, (time, side, new realiser), in buckets by time; frames apply the due stores.
///
/// Exact on truth A: end points are stored numbers, so crossing times are correct up to a few roundings.
/// Exact arithmetic decides closer cases: between two crossings when the envelope is made, and between a
/// crossing and a frame at that frame. Rounding is monotone, so the exact realiser of a side also realises it
/// among the rounded positions.
template <class S>
class SegmentEnvelope {
 public:
  /// From `key` on, `slot` of the realisers is `realiser`. A key is the fraction of the segment in steps of
  /// 2^-32, rounded down.
  struct Store {
    std::uint32_t key, slot, realiser;
    bool operator==(const Store&) const = default;
  };
  /// Takes the shape of a hierarchy. Segments can then be made in `slices` slices if there are enough nodes,
  /// and in more where this costs nothing. Allocates.
  void assign(const WideHierarchy<S>& hierarchy, std::uint32_t slices = 1);

  /// Computes the envelopes of the segment from t0 to t1 > t0, in which vertices move from p0 to p1, both
  /// [vertex][3] with one readable number behind, and both stored numbers. `realisers` are those at t0.
  /// O(nodes + vertices of leaves), and O(lines of a side) for each store.
  void make(WideHierarchy<S>& hierarchy, const WideRealisers& realisers, const S* p0, const S* p1, double t0,
            double t1);
  /// Makes the segment from t0 to t1 > t0 without stores: no vertex overtakes another in it.
  void make_empty(double t0, double t1);

  /// Computes the envelopes of the segment from `end()` to t1 like `make`, but in slices, while `advance`
  /// continues in the current segment: first `start_next`, then any number of `step`, then `take_next`.
  /// Making any other segment in between aborts this work.
  void start_next(const WideHierarchy<S>& hierarchy, const S* p0, const S* p1, double t1);
  /// Continues until this share of the whole work is done, including earlier work: 1 is all. `realisers` are
  /// the current ones; `at_end`, of the same size and the same at each call, receives the realisers at the
  /// segment's end.
  void step(WideHierarchy<S>& hierarchy, const WideRealisers& realisers, WideRealisers& at_end, double share);
  /// Returns the number of wide nodes whose sides have not been processed.
  std::uint32_t nodes_left() const { return nodes_left_; }
  /// Makes the finished next segment current; the realisers must have been brought to its start.
  void take_next();

  /// Brings the realisers from the last requested time (first: t0) to t, t0 <= t <= t1. O(due stores).
  void advance(double t, WideRealisers& realisers);

  /// Returns the stores of the segment; those of one side are in order of time.
  const std::vector<Store>& stores() const { return segments_[now_].made; }

  double begin() const { return segments_[now_].t0; }
  double end() const { return segments_[now_].t1; }
  const EnvelopeCounts& counts() const { return counts_; }
  void clear_counts() { counts_ = {}; }
  std::size_t bytes() const;

 private:
  struct Line {
    S begin, end;  ///< values, oriented outwards: larger is further out
    std::uint32_t place;
  };
  struct Walk {
    std::uint32_t slot, realiser, count;  ///< index and number of its lines
  };
  struct Segment {
    const S *p0 = nullptr, *p1 = nullptr;
    double t0 = 0, t1 = 0;
    std::vector<Store> made, stores;          ///< in order of creation; in buckets
    std::vector<std::uint32_t> bucket{0, 0};  ///< [bucket]: its first index in `stores`
    std::uint32_t bucket_shift = 0;           ///< key >> shift is the bucket
    std::size_t next = 0, ordered = 0;  ///< first store not yet applied; stores before `ordered` are in order
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
  std::uint32_t block_ = 1;                 ///< number of nodes that are made together
  Segment segments_[2];                     ///< the current one; the next one if it is made ahead
  std::uint32_t now_ = 0, making_ = 0;      ///< indices into segments_
  std::uint32_t nodes_left_ = 0;            ///< of the segment being made
  std::size_t sorted_ = 0;                  ///< completed steps of its sort, two per store
  std::size_t carried_ = 0;                 ///< stores of the current segment that its end includes
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
