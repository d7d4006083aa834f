#pragma once
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "core/families/envelope/segment_envelope.hpp"
#include "core/families/wide/wide_hierarchy.hpp"
#include "core/scene/motion_view.hpp"

namespace kbvh {

/// Counts the work of a calendar, for counters.
struct CalendarCounts {
  std::uint64_t sides = 0;         ///< sides whose realiser was determined again
  std::uint64_t certificates = 0;  ///< pairs of vertices whose overtaking time was bounded
  std::uint64_t failed = 0;        ///< certificates that became due
  std::uint64_t idle = 0;          ///< of these, certificates that changed no realiser
  std::uint64_t exact = 0;         ///< decisions left to exact arithmetic
  std::uint64_t changes = 0;       ///< realisers that changed
  std::uint64_t reads = 0;         ///< lines read
};

/// The kinetic AABB tree of one body for frames: the realiser of each side of each box in a wide hierarchy,
/// exact at every frame, at a cost that depends on the changes and not on the size of the body.
///
/// Every side has one certificate: no vertex below it can be ahead of its realiser before a certain time.
/// This time is a lower bound and needs exact arithmetic only where lines nearly touch. Certificates that end
/// before the segment does are entered into a calendar, lists of sides by time. A frame takes the due sides,
/// deepest first, and determines their realisers again from the plans at its own time; a change of a realiser
/// makes the side above due. Several changes between two frames cost one.
///
/// Realisers are exact on truth A, and therefore on truth B, because rounding is monotone. A segment ends
/// where any vertex of the body reaches a knot of its plan; then the whole body restarts. A change of a plan
/// affects the sides of the leaves that contain the vertex, and the sides above with this vertex as realiser.
template <class S>
class CalendarTree {
 public:
  CalendarTree(WideHierarchy<S>& hierarchy, const SegmentMotion<S>& motion, std::uint32_t body);

  /// Restarts at the motion's current time. O(nodes + vertices of leaves).
  void reset(WideHierarchy<S>& hierarchy, WideRealisers& realisers);
  /// Brings the realisers to the motion's current time, which may lie beyond the segment. Returns false if
  /// the body rests and no realiser changed. O(certificates that fail).
  bool advance(WideHierarchy<S>& hierarchy, WideRealisers& realisers);
  /// Registers the plan changes of this body in `changes`, at the motion's current time.
  void plans_changed(WideHierarchy<S>& hierarchy, WideRealisers& realisers,
                     std::span<const PlanChange<S>> changes);

  const CalendarCounts& counts() const { return counts_; }
  void clear_counts() { counts_ = {}; }
  std::size_t bytes() const;

 private:
  static constexpr std::uint32_t none = ~std::uint32_t(0);
  static constexpr double never = std::numeric_limits<double>::infinity();
  static constexpr std::uint32_t buckets = 1024;
  static constexpr std::size_t together = 8;  ///< sides that are prefetched together

  /// A coordinate in double: first + slope * (t - begin_); off by less than error_ until end_.
  struct Line {
    double first, slope;
  };
  /// A vertex that may realise a side: its current and final values, oriented outwards.
  struct Candidate {
    double now, end;
    std::uint32_t place;
  };
  /// An entry of the calendar.
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
  /// Returns the sign of x's lead over y, oriented outwards, at a time of the segment.
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
  double horizon_ = 1;                    ///< assumed length of a segment without an end
  double error_ = 0, scale_ = 0;
  bool at_rest_ = false;
  std::vector<Line> lines_;           ///< [vertex][3]
  std::vector<Entry> entries_;        ///< [slot]
  std::vector<std::uint32_t> heads_;  ///< [bucket]: first slot
  std::uint32_t bucket_ = 0;          ///< bucket of the current time
  std::vector<std::uint32_t> above_;  ///< [node]: the slot of its lower x side in the node above
  std::vector<std::uint8_t> depth_;   ///< [node]
  std::vector<std::uint8_t> due_;     ///< [slot]: whether it is in `levels_`
  std::vector<std::vector<std::uint32_t>> levels_;  ///< [depth]: sides to determine again
  std::vector<std::uint32_t> first_leaf_,
      leaves_;                           ///< by vertex: lower x sides of the leaves that contain it
  std::vector<std::uint32_t> new_plan_;  ///< [vertex]: number of the last change that contained it
  std::uint32_t change_ = 1;
  std::vector<Candidate> candidates_;
  CalendarCounts counts_;
};

extern template class CalendarTree<float>;
extern template class CalendarTree<double>;

}  // namespace kbvh
