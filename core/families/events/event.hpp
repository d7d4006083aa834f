#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <unordered_map>
#include <utility>
#include <vector>

#include "core/families/events/keyframe_rows.hpp"
#include "core/families/events/projected_plan.hpp"
#include "core/motion/exact_piece.hpp"
#include "core/motion/flight_plans.hpp"

namespace kbvh {

/// A side of a box or k-DOP: 2 * direction + (0 lower, 1 upper). Directions are numbered as in
/// `slab_directions`, so the first six sides are those of the box.
using Side = std::uint32_t;
inline std::size_t direction_of(Side side) {
  return side >> 1;
}
/// Returns the axis of a side of a box.
inline int axis_of(Side side) {
  return int(side >> 1);
}
inline bool is_upper(Side side) {
  return (side & 1) != 0;
}

/// A scheduled certificate failure: `loser` will overtake `winner` on one side. The exact time is a root of
/// the two linear pieces that hold from `begin` on. The doubles bound and approximate it: it lies in [begin,
/// end), within `error` of `hint`.
struct Event {
  double hint = 0, error = 0, begin = 0, end = 0;
  std::uint32_t winner = 0, loser = 0;
  std::uint32_t slot = 0;       ///< of the certificate; unique in the queue
  std::uint32_t body : 19 = 0;  ///< below most_bodies
  std::uint32_t side : 5 = 0;
  std::uint32_t depth : 8 = 0;  ///< of the node; of simultaneous events the deeper comes first

  /// The number of the keyframe segment [begin, end); `no_segment` if it is none, or unknown.
  std::uint32_t segment = no_segment;

  static constexpr std::uint32_t most_bodies = 1U << 19;
  static constexpr std::uint32_t no_segment = std::numeric_limits<std::uint32_t>::max();
};
static_assert(sizeof(Event) == 56);

/// The short form of an event, for queues of many events: half the size. The other members follow from the
/// keyframes, or from the crossing that the clock stores.
struct PackedEvent {
  double hint = 0;
  std::uint32_t winner = 0, loser = 0;
  std::uint32_t segment = 0;    ///< of the keyframes; none if a vertex has its own plan
  std::uint32_t body : 19 = 0;  ///< as in Event
  std::uint32_t side : 5 = 0;
  std::uint32_t depth : 8 = 0;
};
static_assert(sizeof(PackedEvent) == 24);

/// An instant at which certificates are computed: the time of a frame or change, a double, or the exact time
/// of an event. `ExactTime` is the form in which the clock states exact times.
template <class S, class ExactTime = Crossing<S>>
struct Instant {
  using Exact = ExactTime;
  double begin;                  ///< not after the instant
  double end;                    ///< after the instant, or equal to begin if the instant is begin itself
  const Exact* exact = nullptr;  ///< the event's exact time; null: the instant is `begin`
  std::uint32_t segment = Event::no_segment;  ///< as the event's

  static Instant at(double t) { return {t, t, nullptr}; }
};

/// Returns the crossing of linear pieces by which a clock states an exact time; null if it is another form.
template <class S>
const Crossing<S>* crossing_in(const Crossing<S>& exact) {
  return &exact;
}

/// The instants of a clock: of crossings, unless the clock names another form of exact times.
template <class Clock, class S>
struct InstantOf {
  using type = Instant<S>;
};
template <class Clock, class S>
requires requires {
  typename Clock::ExactTime;
}
struct InstantOf<Clock, S> {
  using type = Instant<S, typename Clock::ExactTime>;
};

/// Decides all questions about event times exactly, on the flight plans (truth A): order, whether an event is
/// due, and failure times. Events are ordered by exact time, then deeper node first, then slot.
template <class S>
class EventClock {
 public:
  using Event = kbvh::Event;
  using Packed = PackedEvent;
  /// `start` copies the keyframes of moving bodies along the directions of the sides. Bodies with common
  /// keyframes share the copy.
  explicit EventClock(std::vector<const FlightPlans<S>*> plans,
                      std::span<const SlabDirection> directions = Dop<S, 6>::directions)
      : plans_(std::move(plans)), directions_(directions) {
    std::unordered_map<const S*, const KeyframeRows<S>*> of_keyframes;
    for (const FlightPlans<S>* body : plans_) {
      const KeyframeRows<S>*& rows = of_keyframes[body->keyframe(0)];
      if (rows == nullptr) {
        distinct_rows_.push_back(std::make_unique<KeyframeRows<S>>(*body, directions));
        rows = distinct_rows_.back().get();
      }
      rows_.push_back(rows);
    }
  }

  const FlightPlans<S>& plans(std::uint32_t body) const { return *plans_[body]; }

  /// Returns the piece of a vertex's plan along a direction that holds at t and right after it.
  Piece<S> piece_after(std::uint32_t body, std::uint32_t vertex, std::size_t direction, double t) const {
    if (direction < 3) return plans_[body]->piece_after(vertex, int(direction), t);
    return projected_piece(*plans_[body], vertex, directions_[direction], t);
  }
  /// Computes values[side] for sides 0 to count - 1: the value of realisers[side] at t along the side's
  /// direction, rounded correctly to S.
  void values_at(std::uint32_t body, const std::uint32_t* realisers, std::size_t count, double t,
                 S* values) const {
    const KeyframeRows<S>& rows = *rows_[body];
    const auto times = rows.times();
    if (plans_[body]->has_own_plans() || times.size() < 2 || t < times.front() || t >= times.back()) {
      for (Side side = 0; side < count; ++side)
        values[side] = round_piece(piece_after(body, realisers[side], direction_of(side), t), t);
      return;
    }
    const std::size_t segment = rows.segment_at(t);
    S ends[32];
    for (Side side = 0; side < count; ++side) {
      const S* const row = rows.row(realisers[side], direction_of(side)) + segment;
      values[side] = row[0];
      ends[side] = row[1];
    }
    round_chord(values, ends, count, times[segment], times[segment + 1], t, values);
  }

  /// Returns the two pieces whose crossing is the event.
  Crossing<S> crossing(const Event& event) const {
    if (event.slot < place_.size() && place_[event.slot] != none) return crossings_[place_[event.slot]];
    return keyframed_crossing(event);
  }

  /// Returns the short form of an event that is about to be scheduled. Requires that its crossing has been
  /// stored (`remember`).
  Packed pack(const Event& event) const {
    const bool stored = event.slot < place_.size() && place_[event.slot] != none;
    return {event.hint, event.winner, event.loser, stored ? none : segment_of(event),
            event.body, event.side,   event.depth};
  }
  /// Restores an event from its short form. If a vertex has its own plan, `begin` is the start of the pieces,
  /// not the instant of the search.
  Event unpack(const Packed& packed, std::uint32_t slot) const {
    Event event;
    event.hint = packed.hint;
    event.winner = packed.winner;
    event.loser = packed.loser;
    event.slot = slot;
    event.body = packed.body;
    event.side = packed.side;
    event.depth = packed.depth;
    if (packed.segment == none) {
      const Crossing<S>& own_crossing = crossings_[place_[slot]];
      event.begin = std::max(own_crossing.winner.t0, own_crossing.loser.t0);
      event.end = std::min(own_crossing.winner.t1, own_crossing.loser.t1);
      event.error = crossing_estimate(own_crossing).error;
    } else {
      const double* const times = rows_[packed.body]->times().data() + packed.segment;
      event.begin = times[0];
      event.end = times[1];
      event.error = keyframed_error(event.begin, event.end);
      event.segment = packed.segment;
    }
    return event;
  }
  /// Returns the error bound of an event in short form.
  double error_of(const Packed& packed, std::uint32_t slot) const {
    if (packed.segment == none) return crossing_estimate(crossings_[place_[slot]]).error;
    const double* const times = rows_[packed.body]->times().data() + packed.segment;
    return keyframed_error(times[0], times[1]);
  }
  /// Prefetches the keyframes of a vertex that the handling of the event will read.
  void fetch_ahead(const Packed& packed, std::uint32_t vertex) const {
    if (packed.segment != none && vertex < plans_[packed.body]->keyframed_count())
      __builtin_prefetch(rows_[packed.body]->row(vertex, direction_of(packed.side)) + packed.segment);
  }
  /// Returns the time up to which to search from an instant: `look_ahead` keyframes later, or infinity.
  /// Realisers seldom last through a long clip, and a search to its end for each of them would be quadratic
  /// in the number of keyframes.
  double horizon(std::uint32_t body, const Instant<S>& now, std::size_t look_ahead) const {
    constexpr double never = std::numeric_limits<double>::infinity();
    const auto times = rows_[body]->times();
    if (times.size() <= look_ahead) return never;
    const std::size_t k = segment_of(body, now);
    // Events of per-vertex plans may lie in any segment.
    if (k + look_ahead + 1 >= times.size() || (now.exact != nullptr && now.end > times[k + 1])) return never;
    return times[k + look_ahead];
  }
  std::size_t keyframe_count(std::uint32_t body) const { return rows_[body]->times().size(); }
  /// Returns the times of all keyframes, ascending.
  std::vector<double> keyframe_times() const {
    std::vector<double> all;
    for (const auto& rows : distinct_rows_)
      if (rows->times().size() > 1) all.insert(all.end(), rows->times().begin(), rows->times().end());
    std::sort(all.begin(), all.end());
    all.erase(std::unique(all.begin(), all.end()), all.end());
    return all;
  }

  /// Returns whether `a` comes before `b` in a queue; a strict weak order.
  bool earlier(const Event& a, const Event& b) const {
    const int order = compare_times(a, b);
    if (order != 0) return order < 0;
    if (a.depth != b.depth) return a.depth > b.depth;
    return a.slot < b.slot;
  }

  /// Does the same for short forms and their slots. Often two vertices exchange their ranks in several nodes
  /// at once, on both sides of a direction.
  bool earlier(const Packed& a, std::uint32_t slot_a, const Packed& b, std::uint32_t slot_b) const {
    const bool same_pair =
        (a.winner == b.winner && a.loser == b.loser) || (a.winner == b.loser && a.loser == b.winner);
    if (!same_pair || a.segment == none || a.segment != b.segment || a.body != b.body ||
        direction_of(a.side) != direction_of(b.side))
      return earlier(unpack(a, slot_a), unpack(b, slot_b));
    return a.depth != b.depth ? a.depth > b.depth : slot_a < slot_b;
  }
  /// Returns the sign of (a's time - b's time), exactly.
  int compare_times(const Event& a, const Event& b) const {
    if (a.end <= b.begin) return -1;
    if (b.end <= a.begin) return 1;
    const double error = a.error + b.error;
    if (a.hint + error < b.hint) return -1;
    if (b.hint + error < a.hint) return 1;
    return compare_crossings(crossing(a), crossing(b));
  }

  /// Returns whether the event happens at or before t.
  bool due(const Event& event, double t) const {
    if (event.end <= t) return true;
    if (event.begin > t) return false;
    if (event.hint + event.error < t) return true;
    if (event.hint - event.error > t) return false;
    return compare_crossing_to(crossing(event), t) <= 0;
  }

  /// Finds the first time from `now` on at which `loser` gets strictly ahead of `winner` on the event's side.
  /// Requires that the winner is not behind at `now`. Walks the segments forward (Z&W Algorithm 3 with its
  /// errata): in a bounded segment the values at its end decide, in an unbounded one the slopes. Reads
  /// winner, loser, side, body and slot of `event`; writes hint, error, begin and end, and returns true.
  /// Returns false if the loser never gets ahead, or not before `until`: a search for the earliest of several
  /// failures can pass the best one so far. If a vertex has its own plan, the crossing is written to
  /// `own_crossing`, for `remember`.
  bool first_failure(Event& event, const Instant<S>& now, std::optional<Crossing<S>>& own_crossing,
                     double until = std::numeric_limits<double>::infinity()) const {
    own_crossing.reset();
    const FlightPlans<S>& plan = *plans_[event.body];
    if (plan.has_own_plan(event.winner) || plan.has_own_plan(event.loser))
      return first_own_failure(event, now, own_crossing, until);
    if (rows_[event.body]->times().size() < 2) return false;
    const KeyframeSearch search = keyframe_search(event.body, event.side, now, until);
    const std::size_t ahead_at = search.first_ahead(event.loser, event.winner, search.end);
    if (ahead_at >= search.end) return false;
    set_failure(event, ahead_at);
    return true;
  }

  /// A search for failures of certificates of one side of a body without per-vertex plans.
  struct KeyframeSearch {
    const KeyframeRows<S>* rows;
    std::size_t direction;
    bool upper;
    std::size_t begin, end;  ///< the range of keyframes to search

    /// Returns the first keyframe of the range before `limit` at which `loser` is strictly ahead of `winner`,
    /// or `limit`.
    std::size_t first_ahead(std::uint32_t loser, std::uint32_t winner, std::size_t limit) const {
      const S *const l = rows->row(loser, direction), *const w = rows->row(winner, direction);
      return upper ? rows->first_above(l, w, begin, limit) : rows->first_above(w, l, begin, limit);
    }
    /// Returns the next of `losers`, from index `first` on, that is strictly ahead of `winner` at a keyframe
    /// of the range before `limit`, and that keyframe.
    RowAhead next_ahead(std::span<const std::uint32_t> losers, std::size_t first, std::uint32_t winner,
                        std::size_t limit) const {
      return rows->next_ahead(direction, upper, losers, first, winner, begin, limit);
    }
  };
  /// Returns the search from an instant on, through the segments that begin before `until`. Requires a body
  /// with several keyframes.
  KeyframeSearch keyframe_search(std::uint32_t body, Side side, const Instant<S>& now, double until) const {
    const KeyframeRows<S>& rows = *rows_[body];
    const auto times = rows.times();
    std::size_t k = segment_of(body, now), end = times.size();
    // The event of two per-vertex plans may lie several keyframes after the begin of its pieces.
    while (now.exact != nullptr && k + 1 < times.size() && times[k + 1] < now.end &&
           compare_crossing_to(*now.exact, times[k + 1]) >= 0)
      ++k;
    if (!std::isinf(until)) {
      const std::size_t last = rows.segment_at(until);
      end = std::min(end, last + (times[last] < until ? 2 : 1));
    }
    return {&rows, direction_of(side), is_upper(side), k + 1, std::max(end, k + 1)};
  }
  /// Writes hint, error, begin and end of an event whose loser is ahead for the first time at keyframe
  /// `ahead_at`.
  void set_failure(Event& event, std::size_t ahead_at) const {
    const KeyframeRows<S>& rows = *rows_[event.body];
    const std::size_t direction = direction_of(event.side);
    const S* const winner = rows.row(event.winner, direction) + ahead_at - 1;
    const S* const loser = rows.row(event.loser, direction) + ahead_at - 1;
    const double sign = is_upper(event.side) ? 1.0 : -1.0;
    const double ahead = sign * (double(loser[1]) - double(winner[1]));
    const double behind = sign * (double(winner[0]) - double(loser[0]));
    event.segment = std::uint32_t(ahead_at - 1);
    event.begin = rows.times()[ahead_at - 1];
    event.end = rows.times()[ahead_at];
    event.hint = event.begin + (event.end - event.begin) * (behind / (behind + ahead));
    event.error = keyframed_error(event.begin, event.end);
  }

  /// Returns the sign of (challenger's value - winner's value) at t, as seen from the side: > 0 means ahead.
  int compare_values(std::uint32_t body, Side side, std::uint32_t challenger, std::uint32_t winner,
                     double t) const {
    const std::size_t direction = direction_of(side);
    const int sign =
        compare_at(piece_after(body, challenger, direction, t), piece_after(body, winner, direction, t), t);
    return is_upper(side) ? sign : -sign;
  }

  /// Returns whether `a` comes first of two failures of one certificate. Of simultaneous ones the faster
  /// loser comes first, because it stays ahead and no second change follows at once.
  bool overtakes_first(const Event& a, const std::optional<Crossing<S>>& crossing_a, const Event& b,
                       const std::optional<Crossing<S>>& crossing_b) const {
    if (!crossing_a && !crossing_b) {
      if (a.end <= b.begin || a.hint + a.error + b.error < b.hint) return true;
      if (b.end <= a.begin || b.hint + a.error + b.error < a.hint) return false;
    }
    const Crossing<S> x = crossing_a ? *crossing_a : keyframed_crossing(a),
                      y = crossing_b ? *crossing_b : keyframed_crossing(b);
    const int order = compare_crossings(x, y);
    if (order != 0) return order < 0;
    const int faster = compare_slopes(x.loser, y.loser);
    return is_upper(a.side) ? faster > 0 : faster < 0;
  }

  /// Stores the crossing of the event that is about to be scheduled in a slot; an empty one removes the
  /// stored crossing. Requires that no queue holds an event of that slot. Allocates only for more crossings
  /// than ever before, or for a slot beyond all earlier ones.
  void remember(std::uint32_t slot, const std::optional<Crossing<S>>& own_crossing) {
    if (!own_crossing) {
      if (slot >= place_.size() || place_[slot] == none) return;
      free_.push_back(std::exchange(place_[slot], none));
      return;
    }
    if (slot >= place_.size())
      place_.resize(std::max<std::size_t>(2 * place_.size(), std::size_t(slot) + 1), none);
    std::uint32_t& place = place_[slot];
    if (place == none && free_.empty()) {
      place = std::uint32_t(crossings_.size());
      crossings_.push_back(*own_crossing);
      free_.reserve(crossings_.capacity());
      return;
    }
    if (place == none) {
      place = free_.back();
      free_.pop_back();
    }
    crossings_[place] = *own_crossing;
  }
  /// Copies the keyframes, and forgets all crossings: a clip begins. No event may be asked for before.
  void start() {
    for (const auto& rows : distinct_rows_) rows->copy();
    if (crossings_.empty()) return;
    crossings_.clear();
    free_.clear();
    std::fill(place_.begin(), place_.end(), none);
  }
  std::size_t bytes() const {
    std::size_t total = crossings_.capacity() * sizeof(Crossing<S>) +
                        (place_.capacity() + free_.capacity()) * sizeof(std::uint32_t);
    for (const auto& rows : distinct_rows_) total += sizeof(*rows) + rows->bytes();
    return total;
  }

 private:
  std::uint32_t segment_of(const Event& event) const {
    if (event.segment != Event::no_segment) return event.segment;
    return std::uint32_t(rows_[event.body]->segment_at(event.begin));
  }
  std::size_t segment_of(std::uint32_t body, const Instant<S>& now) const {
    return now.segment != Event::no_segment ? now.segment : rows_[body]->segment_at(now.begin);
  }
  /// Differences, sum, quotient, product and final sum each have at most one rounding error.
  static double keyframed_error(double begin, double end) {
    return 16 * std::numeric_limits<double>::epsilon() * std::max(std::abs(begin), std::abs(end));
  }
  Crossing<S> keyframed_crossing(const Event& event) const {
    return {keyframed_piece(event, event.winner), keyframed_piece(event, event.loser)};
  }
  Piece<S> keyframed_piece(const Event& event, std::uint32_t vertex) const {
    // Reads the keyframes, which stay valid when a vertex gets its own plan.
    const KeyframeRows<S>& rows = *rows_[event.body];
    const S* const values = rows.row(vertex, direction_of(event.side)) + segment_of(event);
    return {event.begin, event.end, values[0], values[1], PieceKind::chord};
  }

  /// Returns the piece that holds at the instant and right after it.
  Piece<S> piece_at(std::uint32_t body, std::uint32_t vertex, std::size_t direction,
                    const Instant<S>& now) const {
    Piece<S> piece = piece_after(body, vertex, direction, now.begin);
    while (now.exact != nullptr && piece.t1 < now.end && compare_crossing_to(*now.exact, piece.t1) >= 0)
      piece = piece_after(body, vertex, direction, piece.t1);
    return piece;
  }

  bool first_own_failure(Event& event, const Instant<S>& now, std::optional<Crossing<S>>& own_crossing,
                         double until) const {
    const std::size_t direction = direction_of(event.side);
    Piece<S> winner = piece_at(event.body, event.winner, direction, now);
    Piece<S> loser = piece_at(event.body, event.loser, direction, now);
    double begin = now.begin;
    for (;;) {
      const double end = std::min(winner.t1, loser.t1);
      const int ahead = std::isinf(end) ? compare_slopes(loser, winner) : compare_at(loser, winner, end);
      if ((is_upper(event.side) ? ahead : -ahead) > 0) {
        const Crossing<S> crossing{winner, loser};
        const TimeEstimate estimate = crossing_estimate(crossing);
        if (!std::isfinite(estimate.time)) return false;  // later than any admissible time
        event.segment = Event::no_segment;
        event.begin = std::max(begin, std::max(winner.t0, loser.t0));
        event.end = end;
        event.hint = estimate.time;
        event.error = estimate.error;
        own_crossing = crossing;
        return true;
      }
      if (std::isinf(end) || end >= until) return false;
      if (winner.t1 <= end) winner = piece_after(event.body, event.winner, direction, end);
      if (loser.t1 <= end) loser = piece_after(event.body, event.loser, direction, end);
      begin = end;
    }
  }

  std::vector<const FlightPlans<S>*> plans_;
  std::span<const SlabDirection> directions_;
  std::vector<const KeyframeRows<S>*> rows_;  ///< [body]
  std::vector<std::unique_ptr<KeyframeRows<S>>> distinct_rows_;
  static constexpr std::uint32_t none = std::numeric_limits<std::uint32_t>::max();
  std::vector<Crossing<S>> crossings_;  ///< crossings of vertices with their own plans
  std::vector<std::uint32_t> place_;    ///< [slot] index in crossings_, or none; none for slots past the end
  std::vector<std::uint32_t> free_;     ///< unused indices of crossings_
};

}  // namespace kbvh
