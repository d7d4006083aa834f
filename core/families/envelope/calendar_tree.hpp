#pragma once
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "core/families/envelope/segment_envelope.hpp"
#include "core/families/wide/wide_hierarchy.hpp"
#include "core/scene/motion_view.hpp"

namespace kbvh {

/// What a calendar did, for counters.
struct CalendarCounts {
  std::uint64_t sides = 0;         ///< sides whose realiser was determined anew
  std::uint64_t certificates = 0;  ///< pairs of vertices of which it was decided when one overtakes the other
  std::uint64_t failed = 0;        ///< certificates whose time had come
  std::uint64_t idle = 0;          ///< of these, the ones that changed no realiser
  std::uint64_t exact = 0;         ///< decisions left to exact arithmetic
  std::uint64_t changes = 0;       ///< realisers that changed
  std::uint64_t reads = 0;         ///< lines read
};

/// The kinetic AABB tree of one body for frames: who realises which side of which box in a wide hierarchy,
/// exactly at every frame, at a cost that depends on what changes and not on the size of the body.
///
/// Every side has one certificate: nobody below it can be ahead of its realiser before a certain time. That
/// time is a lower bound and needs no exact arithmetic but where lines nearly touch; those that come before
/// the end of the segment stand in a calendar, lists of sides by time. A frame takes the sides whose time has
/// come, deepest first, and determines their realisers anew from the plans at its own time; where one changes
/// the side above follows. What happens several times between two frames is done once.
///
/// Realisers are exact on truth A, so they are on truth B, for rounding is monotone. A segment ends where any
/// vertex of the body gets to a knot of its plan: then everything starts over. Changes of plans concern the
/// sides of the leaves that the vertex is in, and those above as far as they have it as realiser.
template <class S>
class CalendarTree {
 public:
  CalendarTree(WideHierarchy<S>& hierarchy, const SegmentMotion<S>& motion, std::uint32_t body);

  /// Starts over at the motion's present time. O(nodes + vertices of leaves).
  void reset(WideHierarchy<S>& hierarchy, WideRealisers& realisers);
  /// Brings the realisers to the motion's present time, which may lie beyond the segment. False if nothing
  /// moves and none has changed. O(certificates that fail).
  bool advance(WideHierarchy<S>& hierarchy, WideRealisers& realisers);
  /// The plans of `changes` that are of this body have changed at the motion's present time.
  void plans_changed(WideHierarchy<S>& hierarchy, WideRealisers& realisers,
                     std::span<const PlanChange<S>> changes);

  const CalendarCounts& counts() const { return counts_; }
  void clear_counts() { counts_ = {}; }
  std::size_t bytes() const;

 private:
  static constexpr std::uint32_t none = ~std::uint32_t(0);
  static constexpr double never = std::numeric_limits<double>::infinity();
  static constexpr std::uint32_t buckets = 1024;
  static constexpr std::size_t together = 8;  ///< sides that are asked for at once

  /// A coordinate in double: first + slope * (t - begin_); off by less than error_ until end_.
  struct Line {
    double first, slope;
  };
  /// A vertex that may realise a side: its values now and at the end, seen from the side.
  struct Candidate {
    double now, end;
    std::uint32_t place;
  };
  /// A place in the calendar.
  struct Entry {
    double time = never;
    std::uint32_t next = none, before = none, bucket = none;
  };

  void start(WideHierarchy<S>& hierarchy, WideRealisers& realisers);
  struct Place {
    std::uint32_t node, row, lane;
  };
  Place place_of(std::uint32_t slot) const {
    const std::uint32_t rows = slot >> width_shift_;
    return {rows / 6, rows % 6, slot & (width_ - 1)};
  }
  void read_line(std::uint32_t vertex);
  void choose_end(double t);
  Piece<S> piece(std::uint32_t place) const { return motion_.piece(body_, place / 3, int(place % 3)); }
  /// The sign of what x is ahead of y, seen from the side, at a time of the segment.
  int ahead(std::uint32_t x, std::uint32_t y, bool lower, double t);
  void list_candidates(const WideArrays<S>& h, const WideRealisers& realisers, std::uint32_t slot);
  void determine(const WideArrays<S>& h, WideRealisers& realisers, std::uint32_t slot);
  double failure(const Candidate& winner, const Candidate& other, bool lower);
  Candidate candidate(std::uint32_t place, bool lower) const;
  void schedule(std::uint32_t slot, double time);
  void unschedule(std::uint32_t slot);
  std::uint32_t bucket_of(double time) const;
  void fetch_ahead(const WideArrays<S>& h, const WideRealisers& realisers,
                   std::span<const std::uint32_t> slots) const;
  void make_due(std::uint32_t slot);
  void process(const WideArrays<S>& h, WideRealisers& realisers);
  bool has_new_plan(std::uint32_t place) const { return new_plan_[place / 3] == change_; }

  SegmentMotion<S> motion_;
  std::uint32_t body_, width_, width_shift_, scalars_;
  double begin_ = 0, now_ = 0, end_ = 0;  ///< of the segment
  double horizon_ = 1;                    ///< how far ahead a segment without an end is taken
  double error_ = 0, scale_ = 0;
  bool at_rest_ = false;
  std::vector<Line> lines_;           ///< [vertex][3]
  std::vector<Entry> entries_;        ///< [slot]
  std::vector<std::uint32_t> heads_;  ///< [bucket]: first slot
  std::uint32_t bucket_ = 0;          ///< of the present
  std::vector<std::uint32_t> above_;  ///< [node]: the slot of its lower x side in the node above
  std::vector<std::uint8_t> depth_;   ///< [node]
  std::vector<std::uint8_t> due_;     ///< [slot]: waits in `levels_`
  std::vector<std::vector<std::uint32_t>> levels_;  ///< [depth]: sides to determine anew
  std::vector<std::uint32_t> first_leaf_, leaves_;  ///< of each vertex: lower x sides of the leaves it is in
  std::vector<std::uint32_t> new_plan_;             ///< [vertex]: last change that it took part in
  std::uint32_t change_ = 1;
  std::vector<Candidate> candidates_;
  CalendarCounts counts_;
};

extern template class CalendarTree<float>;
extern template class CalendarTree<double>;

}  // namespace kbvh
