#pragma once
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "core/motion/exact_piece.hpp"
#include "core/topology/topology.hpp"

namespace kbvh {

/// Marks a missing realiser: of a side that a node inherits, or of a new node.
inline constexpr std::uint32_t no_vertex = std::numeric_limits<std::uint32_t>::max();

/// The kinds of events of a kinetic structure.
enum class EventKind : std::uint8_t {
  bound,           ///< a certificate of a bound fails: one vertex overtakes another on one side of a box
  boxes_meet,      ///< two boxes of a separation list begin to overlap
  boxes_separate,  ///< two boxes of a separation list cease to overlap
  review,          ///< no bound changes: the structure searches for the next event of a pair of boxes
  window,          ///< no bound changes: the structure chooses again which pairs of bodies or boxes to watch
};

/// One certificate and its failure time. A side is numbered 2 * axis + (0 lower, 1 upper).
template <class S>
struct ScheduledEvent {
  EventKind kind = EventKind::bound;
  std::uint32_t body = 0, node = 0,
                side = 0;  ///< kind bound: node and side of the bound; else the first box (side unused)
  std::uint32_t winner = no_vertex, loser = no_vertex;  ///< kind bound: `loser` overtakes `winner`
  std::uint32_t other_body = 0, other_node = 0;  ///< boxes_meet, boxes_separate, review: the second box
  TimeEstimate time;                             ///< in seconds; |exact time - time.time| <= time.error
  /// Whether `crossing` is valid: false for review and window, and for vertices on curves.
  bool has_crossing = false;
  Crossing<S> crossing{};  ///< the exact time: the crossing of two linear pieces

  bool operator==(const ScheduledEvent& other) const {
    return kind == other.kind && body == other.body && node == other.node && side == other.side &&
           winner == other.winner && loser == other.loser && other_body == other.other_body &&
           other_node == other.other_node && time.time == other.time.time && time.error == other.time.error &&
           has_crossing == other.has_crossing && (!has_crossing || crossing == other.crossing);
  }
};

/// A bound whose realiser changed.
template <class S>
struct BoundNotice {
  std::uint32_t body = 0, node = 0, side = 0;
  std::uint32_t old_vertex = no_vertex, new_vertex = no_vertex;
  double begin = 0;  ///< seconds; not later than the change
  /// Whether the change happened at `crossing`; else at `begin`, or, on curves, in the segment from `begin`
  /// on.
  bool at_event = false;
  Crossing<S> crossing{};  ///< the exact time, if `at_event`

  /// Compares the changes; ignores `begin` of a change at an event, which is only a hint.
  bool operator==(const BoundNotice& other) const {
    return body == other.body && node == other.node && side == other.side && old_vertex == other.old_vertex &&
           new_vertex == other.new_vertex && at_event == other.at_event &&
           (at_event ? crossing == other.crossing : begin == other.begin);
  }
};

/// Describes the effects of one event.
template <class S>
struct EventDescription {
  ScheduledEvent<S> event;
  std::vector<BoundNotice<S>> touched;  ///< the bounds that changed, in the order of the changes
  /// The certificates that the event created, with their failure times. Certificates that never fail and
  /// certificates of pairs of boxes are not listed.
  std::vector<ScheduledEvent<S>> rescheduled;
};

/// Two boxes that a separation list watches.
struct WatchedPair {
  std::uint32_t body = 0, node = 0;              ///< the first box
  std::uint32_t other_body = 0, other_node = 0;  ///< the second box
  bool overlapping = false;
  /// Whether the pair is in the list: its boxes are apart, or both are leaves and overlap. Otherwise it is an
  /// inner pair above the list, with overlapping boxes.
  bool listed = false;

  auto operator<=>(const WatchedPair&) const = default;
};

template <class S>
class Strategy;

/// An optional interface of event-driven strategies: access to the event queue. `Strategy::step_event`
/// performs single events. Node ids refer to `tree`.
template <class S>
class EventSource {
 public:
  virtual ~EventSource() = default;

  /// Returns the earliest event, or nothing if none is scheduled. O(1).
  virtual std::optional<ScheduledEvent<S>> next_event() const = 0;
  /// Returns the time of `next_event` in seconds, rounded; infinite if none is scheduled.
  double next_event_time() const {
    const auto next = next_event();
    return next ? next->time.time : std::numeric_limits<double>::infinity();
  }
  /// Replaces `out` by all scheduled events in order of time. O(certificates + events log events).
  virtual void scheduled_events(std::vector<ScheduledEvent<S>>& out) const = 0;
  /// Returns the tree of one body; events name its nodes. Valid until the next call of the strategy.
  virtual const Topology& tree(std::uint32_t body) const = 0;
  /// Returns the vertex that currently realises a side of a node; `no_vertex` for an inherited side.
  virtual std::uint32_t realiser(std::uint32_t body, std::uint32_t node, std::uint32_t side) const = 0;
  /// Starts to append every change of a bound to `log`, for any cause (events, changes of plans) except
  /// `reset`. Null stops the logging.
  virtual void watch_bounds(std::vector<BoundNotice<S>>* log) = 0;
  /// Replaces `out` by all pairs of boxes that the strategy watches, in no particular order. Leaves `out`
  /// empty without a separation list.
  virtual void watched_pairs(std::vector<WatchedPair>& out) const { out.clear(); }

 protected:
  friend class Strategy<S>;
  /// Implements `Strategy::step_event`.
  virtual bool step(double until, EventDescription<S>& out) = 0;
};

}  // namespace kbvh
