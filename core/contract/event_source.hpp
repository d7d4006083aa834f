#pragma once
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "core/motion/exact_piece.hpp"
#include "core/topology/topology.hpp"

namespace kbvh {

/// The realiser of a bound that does not exist: of a side that a node inherits, or of a node that is new.
inline constexpr std::uint32_t no_vertex = std::numeric_limits<std::uint32_t>::max();

/// What happens at an event of a kinetic structure.
enum class EventKind : std::uint8_t {
  bound,           ///< a certificate of a bound fails: one vertex overtakes another on one side of a box
  boxes_meet,      ///< two boxes of a separation list begin to overlap
  boxes_separate,  ///< two boxes of a separation list cease to overlap
  review,          ///< nothing changes: the structure looks for the next event of a pair of boxes
  window,          ///< nothing changes: which pairs of bodies or of boxes are watched is chosen anew
};

/// One certificate and when it fails. A side is numbered 2 * axis + (0 lower, 1 upper).
template <class S>
struct ScheduledEvent {
  EventKind kind = EventKind::bound;
  std::uint32_t body = 0, node = 0, side = 0;  ///< kind bound: whose bound; else the first box (side unused)
  std::uint32_t winner = no_vertex, loser = no_vertex;  ///< kind bound: `loser` overtakes `winner`
  std::uint32_t other_body = 0, other_node = 0;  ///< boxes_meet, boxes_separate, review: the second box
  TimeEstimate time;                             ///< in seconds; |exact time - time.time| <= time.error
  bool has_crossing = false;  ///< whether `crossing` is meaningful: not for review and window
  Crossing<S> crossing{};     ///< the exact time: the root of two linear pieces

  bool operator==(const ScheduledEvent& other) const {
    return kind == other.kind && body == other.body && node == other.node && side == other.side &&
           winner == other.winner && loser == other.loser && other_body == other.other_body &&
           other_node == other.other_node && time.time == other.time.time && time.error == other.time.error &&
           has_crossing == other.has_crossing && (!has_crossing || crossing == other.crossing);
  }
};

/// A bound that another vertex realises from now on.
template <class S>
struct BoundNotice {
  std::uint32_t body = 0, node = 0, side = 0;
  std::uint32_t old_vertex = no_vertex, new_vertex = no_vertex;
  double begin = 0;        ///< a double not after the instant of the change, in seconds
  bool at_event = false;   ///< whether the instant is `crossing`; else it is `begin` itself
  Crossing<S> crossing{};  ///< the exact time, if `at_event`

  /// Compares what happened; `begin` of a change at an event is only a hint.
  bool operator==(const BoundNotice& other) const {
    return body == other.body && node == other.node && side == other.side && old_vertex == other.old_vertex &&
           new_vertex == other.new_vertex && at_event == other.at_event &&
           (at_event ? crossing == other.crossing : begin == other.begin);
  }
};

/// Everything that one event did.
template <class S>
struct EventDescription {
  ScheduledEvent<S> event;
  std::vector<BoundNotice<S>> touched;  ///< the bounds that changed, in the order of the changes
  /// The certificates that the event made anew, with the failures that they have now; certificates that never
  /// fail are left out. Of bounds only: certificates of pairs of boxes are not listed here.
  std::vector<ScheduledEvent<S>> rescheduled;
};

template <class S>
class Strategy;

/// An optional interface of a strategy that works at events: its event queue, opened. `Strategy::step_event`
/// performs the events one by one. Node ids are those of `tree`.
template <class S>
class EventSource {
 public:
  virtual ~EventSource() = default;

  /// The event that comes first; nothing if none is scheduled. O(1).
  virtual std::optional<ScheduledEvent<S>> next_event() const = 0;
  /// The time of `next_event` in seconds, rounded; infinite if none is scheduled.
  double next_event_time() const {
    const auto next = next_event();
    return next ? next->time.time : std::numeric_limits<double>::infinity();
  }
  /// Replaces `out` by all scheduled events in the order in which they come. O(certificates + events log
  /// events).
  virtual void scheduled_events(std::vector<ScheduledEvent<S>>& out) const = 0;
  /// The tree of one body whose nodes events name. Valid until the next call of the strategy.
  virtual const Topology& tree(std::uint32_t body) const = 0;
  /// The vertex that realises a side of a node now; `no_vertex` for a side that the node inherits.
  virtual std::uint32_t realiser(std::uint32_t body, std::uint32_t node, std::uint32_t side) const = 0;
  /// From now on appends every change of a bound to `log`, whatever causes it (events, changes of plans, but
  /// not `reset`); null: to nothing.
  virtual void watch_bounds(std::vector<BoundNotice<S>>* log) = 0;

 protected:
  friend class Strategy<S>;
  /// Does what `Strategy::step_event` promises.
  virtual bool step(double until, EventDescription<S>& out) = 0;
};

}  // namespace kbvh
