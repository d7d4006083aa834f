#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>

#include "core/base/counters.hpp"
#include "core/families/events/event.hpp"

namespace kbvh {

/// Computes and schedules the failures of certificates for a kinetic tree. A certificate states that one
/// vertex, its winner, is not behind any of its candidates on one side of a body. The certificate fails when
/// the first candidate gets ahead. Certificates are passed as events with winner, slot, body, side and depth.
template <class S, class Queue>
class Certifier {
  using Clock = typename Queue::ClockType;
  using Now = typename InstantOf<Clock, S>::type;

 public:
  Certifier(Clock& clock, Queue& queue, Counters& count) : clock_(&clock), queue_(&queue), count_(&count) {}

  /// Returns the instant at which an event happens. Computes the exact time, into `crossing`, if `exact` is
  /// set, if the event lies in no segment, or if the body has per-vertex plans or curves. Otherwise the
  /// segment identifies the instant well enough.
  Now instant_of(const Event& event, bool exact, typename Now::Exact& crossing) const {
    exact = exact || event.segment == Event::no_segment || clock_->plans(event.body).has_own_plans();
    if constexpr (requires { clock_->on_curves(event.body); }) exact = exact || clock_->on_curves(event.body);
    if (exact) crossing = clock_->crossing(event);
    return {event.begin, event.end, exact ? &crossing : nullptr, event.segment};
  }

  /// Removes a slot's scheduled failure from the queue, if there is one.
  void withdraw(std::uint32_t slot) {
    if (!queue_->cancel(slot)) return;
    count_->add(Counter::certificates_discarded);
    count_->add(Counter::queue_operations);
  }

  /// Schedules the certificate's earliest failure from `now` on, and replaces the scheduled one. The winner
  /// may be among the candidates; `others` are the candidates without it, as far as the caller knows their
  /// number. O(candidates x segments until the failure).
  void certify(Event event, const Now& now, std::span<const std::uint32_t> candidates,
               std::size_t others = not_counted) {
    withdraw(event.slot);  // the queue must not hold this slot while the clock stores its new crossing
    if constexpr (reads_keyframes)
      if (!clock_->plans(event.body).has_own_plans())
        return certify_keyframed(event, now, candidates, others);
    std::optional<Crossing<S>> own_crossing, earliest_crossing;
    Event earliest;
    bool found = false;
    double horizon = horizon_after(event.body, now);
    for (;;) {
      double until = horizon;
      for (const std::uint32_t challenger : candidates) {
        if (challenger == event.winner) continue;
        event.loser = challenger;
        count_->add(Counter::certificates_made);
        if (!clock_->first_failure(event, now, own_crossing, until)) continue;
        if (found && !clock_->overtakes_first(event, own_crossing, earliest, earliest_crossing)) continue;
        found = true;
        earliest = event;
        earliest_crossing = own_crossing;
        until = std::min(until, earliest.end);
      }
      if (std::isinf(horizon)) break;
      if (found && (earliest.end <= horizon || earliest.hint + earliest.error < horizon)) break;
      clock_->remember(event.slot, {});
      count_->add(Counter::queue_operations);
      event.begin = horizon;
      event.segment = Event::no_segment;
      if (review_at(event, horizon)) return;
      horizon = never;
      found = false;
    }
    clock_->remember(event.slot, earliest_crossing);
    if (found) schedule(earliest);
  }

  /// Adds a candidate that is not ahead of the winner at `now`: the certificate fails at the scheduled time
  /// or earlier.
  void add_candidate(Event event, const Now& now, std::uint32_t challenger) {
    if (challenger == event.winner) return;
    event.loser = challenger;
    count_->add(Counter::certificates_made);
    if constexpr (reads_keyframes)
      if (!clock_->plans(event.body).has_own_plans()) return add_keyframed(event, now);
    const bool scheduled = queue_->scheduled(event.slot);
    double until = scheduled ? queue_->event(event.slot).end : never;
    if (const std::optional<double> review = review_time(event.slot)) until = *review;
    std::optional<Crossing<S>> own_crossing, next_crossing;
    if (!clock_->first_failure(event, now, own_crossing, until)) return;
    if (scheduled) {
      const Event next = queue_->event(event.slot);
      const FlightPlans<S>& plans = clock_->plans(event.body);
      if (plans.has_own_plan(next.winner) || plans.has_own_plan(next.loser)) {
        const auto exact = clock_->crossing(next);
        if (const Crossing<S>* const of_lines = crossing_in(exact)) next_crossing = *of_lines;
      }
      if (!clock_->overtakes_first(event, own_crossing, next, next_crossing)) return;
    } else if (own_crossing && !std::isinf(until) && compare_crossing_to(*own_crossing, until) >= 0) {
      return;  // the review, which checks all candidates, comes first
    }
    withdraw(event.slot);
    clock_->remember(event.slot, own_crossing);
    schedule(event);
  }

 private:
  static constexpr std::size_t not_counted = std::numeric_limits<std::size_t>::max();
  static constexpr double never = std::numeric_limits<double>::infinity();
  static constexpr bool reads_keyframes = requires(const Clock& clock, const Now& now) {
    clock.keyframe_search(0, 0, now, 0.0);
  };

  void schedule(const Event& event) {
    queue_->schedule(event);
    count_->add(Counter::queue_operations);
    count_->peak(Counter::queue_peak, queue_->size());
  }
  /// Returns the time up to which a search from `now` on looks for a failure; infinite if the queue has no
  /// reviews.
  double horizon_after(std::uint32_t body, const Now& now) const {
    if constexpr (requires { clock_->horizon(body, now, queue_->look_ahead()); })
      if (const std::size_t keyframes = queue_->look_ahead(); keyframes > 0)
        return clock_->horizon(body, now, keyframes);
    return never;
  }
  bool review_at(const Event& event, double time) {
    if constexpr (requires { queue_->review(event, time); })
      return queue_->review(event, time);
    else
      return false;
  }
  /// Returns the time of the next review of a certificate without a scheduled failure, if there is one.
  std::optional<double> review_time(std::uint32_t slot) const {
    if constexpr (requires { queue_->reviewing(slot); })
      if (queue_->reviewing(slot)) return queue_->event(slot).begin;
    return {};
  }

  /// Implements `certify` for a body without per-vertex plans.
  void certify_keyframed(Event event, const Now& now, std::span<const std::uint32_t> candidates,
                         std::size_t others) {
    if (clock_->keyframe_count(event.body) < 2) return;
    const double horizon = horizon_after(event.body, now);
    if (find_failure(event, clock_->keyframe_search(event.body, event.side, now, horizon), candidates,
                     others))
      return schedule(event);
    if (horizon == never) return;
    event.begin = horizon;
    event.loser = event.winner;
    if (review_at(event, horizon)) {
      count_->add(Counter::queue_operations);
      count_->peak(Counter::queue_peak, queue_->size());
    } else if (find_failure(event, clock_->keyframe_search(event.body, event.side, now, never), candidates,
                            others)) {
      schedule(event);
    }
  }
  /// Writes the earliest failure of a certificate to `event`. Returns whether there is one.
  template <class Search>
  bool find_failure(Event& event, const Search& search, std::span<const std::uint32_t> candidates,
                    std::size_t others) {
    std::size_t limit = search.end, next = 0;
    bool found = false;
    for (;;) {
      const RowAhead ahead = search.next_ahead(candidates, next, event.winner, limit);
      if (ahead.index == candidates.size()) break;
      next = ahead.index + 1;
      const std::uint32_t challenger = candidates[ahead.index];
      if (found && ahead.at + 1 == limit && !comes_first(event, challenger, ahead.at)) continue;
      found = true;
      event.loser = challenger;
      limit = ahead.at + 1;
    }
    if (others == not_counted)
      others = candidates.size() - search.rows->occurrences(candidates, event.winner);
    count_->add(Counter::certificates_made, others);
    if (found) clock_->set_failure(event, limit - 1);
    return found;
  }
  /// Returns whether `challenger`, which gets ahead at keyframe `ahead_at`, overtakes before the loser of
  /// `than`, which gets ahead in the same segment.
  bool comes_first(const Event& than, std::uint32_t challenger, std::size_t ahead_at) const {
    Event first = than, other = than;
    first.loser = challenger;
    clock_->set_failure(first, ahead_at);
    clock_->set_failure(other, ahead_at);
    return clock_->overtakes_first(first, {}, other, {});
  }
  void add_keyframed(Event event, const Now& now) {
    if (clock_->keyframe_count(event.body) < 2) return;
    double until = never;
    std::optional<Event> next;
    if (queue_->scheduled(event.slot)) {
      next = queue_->event(event.slot);
      until = next->end;
    } else if (const std::optional<double> review = review_time(event.slot)) {
      until = *review;
    }
    const auto search = clock_->keyframe_search(event.body, event.side, now, until);
    const std::size_t ahead_at = search.first_ahead(event.loser, event.winner, search.end);
    if (ahead_at >= search.end) return;
    clock_->set_failure(event, ahead_at);
    if (next && !clock_->overtakes_first(event, {}, *next, {})) return;
    if (next) withdraw(event.slot);
    schedule(event);
  }

  Clock* clock_;
  Queue* queue_;
  Counters* count_;
};

}  // namespace kbvh
