#pragma once
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "core/base/assert.hpp"
#include "core/families/events/curve_rows.hpp"
#include "core/families/events/event.hpp"
#include "core/motion/curve_roots.hpp"
#include "core/motion/round_curve.hpp"

namespace kbvh {

/// The exact time of an event of AlgebraicClock: a root of the difference of two curves, or the crossing of
/// two lines.
template <class S>
struct AlgebraicInstant {
  bool curved = false;
  CurveMoment<S> moment;  ///< if `curved`
  CurveRoot root;         ///< the moment's
  Crossing<S> crossing;   ///< if not
};

template <class S>
const Crossing<S>* crossing_in(const AlgebraicInstant<S>& exact) {
  return exact.curved ? nullptr : &exact.crossing;
}

/// EventClock for scenes in which vertices of some bodies move on curves (FlightPlans::curved). A certificate
/// may fail up to twice per segment, at the roots of the difference of two pieces; roots, their order and
/// signs at them are exact (curve_roots.hpp). Bodies without curves keep the rules of EventClock, own plans
/// included.
///
/// A certificate with g = loser - winner, as seen from its side, holds as long as g <= 0. It fails at the
/// first root of g, from now on, right after which g is positive. If g is positive on both sides of the root,
/// the winner changed just there.
template <class S>
class AlgebraicClock {
 public:
  using Event = kbvh::Event;
  using ExactTime = AlgebraicInstant<S>;
  using Now = Instant<S, ExactTime>;

  /// Along the axes certificates compare the flight plans, along other directions the projected plans.
  explicit AlgebraicClock(std::vector<const FlightPlans<S>*> plans,
                          std::span<const SlabDirection> directions = Dop<S, 6>::directions)
      : lines_(plans, directions), plans_(std::move(plans)), directions_(directions), rows_(plans_.size()) {}

  const FlightPlans<S>& plans(std::uint32_t body) const { return *plans_[body]; }
  bool on_curves(std::uint32_t body) const { return plans_[body]->curved(); }
  std::vector<double> keyframe_times() const { return lines_.keyframe_times(); }
  /// Does the same as EventClock::values_at.
  void values_at(std::uint32_t body, const std::uint32_t* realisers, std::size_t count, double t,
                 S* values) const {
    if (!on_curves(body)) return lines_.values_at(body, realisers, count, t, values);
    const CurveRows<S>& rows = rows_[body];
    const auto times = rows.times();
    const std::size_t k = plans_[body]->segment_at(t);
    const bool at_rest = t < times.front() || k + 1 == times.size();
    for (Side side = 0; side < count; ++side) {
      const std::size_t direction = direction_of(side);
      values[side] = at_rest ? rows.value(realisers[side], direction, k)
                             : round_piece(rows.piece(realisers[side], direction, k), t);
    }
  }

  /// Returns the exact time of an event.
  ExactTime crossing(const Event& event) const {
    ExactTime exact;
    exact.curved = on_curves(event.body);
    if (exact.curved) {
      exact.moment = moment_of(event);
      exact.root = segment_roots(exact.moment.first, exact.moment.second).roots[exact.moment.root];
    } else {
      exact.crossing = lines_.crossing(event);
    }
    return exact;
  }

  double horizon(std::uint32_t body, const Now& now, std::size_t look_ahead) const {
    if (!on_curves(body))
      return on_lines(now, [&](const auto& t) { return lines_.horizon(body, t, look_ahead); });
    const auto times = plans_[body]->keyframe_times();
    const std::size_t k = segment_of(body, now);
    return k + look_ahead + 1 >= times.size() ? never : times[k + look_ahead];
  }
  void fetch_ahead(const Event& /*event*/, std::uint32_t /*vertex*/) const {}

  bool earlier(const Event& a, const Event& b) const {
    const int order = compare_times(a, b);
    if (order != 0) return order < 0;
    if (a.depth != b.depth) return a.depth > b.depth;
    return a.slot < b.slot;
  }
  /// Returns the sign of (a's time - b's time), exactly.
  int compare_times(const Event& a, const Event& b) const {
    if (a.end <= b.begin) return -1;
    if (b.end <= a.begin) return 1;
    const double error = a.error + b.error;
    if (a.hint + error < b.hint) return -1;
    if (b.hint + error < a.hint) return 1;
    if (error == 0) return 0;  // equal, and both exact, as at the beginning of a segment
    const bool curved_a = on_curves(a.body), curved_b = on_curves(b.body);
    if (!curved_a && !curved_b) return lines_.compare_times(a, b);
    if (!curved_a) return -compare_moment_to(moment_of(b), lines_.crossing(a));
    if (!curved_b) return compare_moment_to(moment_of(a), lines_.crossing(b));
    return compare_moments(moment_of(a), moment_of(b));
  }
  /// Returns whether the event happens at or before t.
  bool due(const Event& event, double t) const {
    if (!on_curves(event.body)) return lines_.due(event, t);
    if (event.end <= t) return true;
    if (event.begin > t) return false;
    if (event.hint + event.error < t) return true;
    if (event.hint - event.error > t) return false;
    return compare_moment_to(moment_of(event), t) <= 0;
  }

  /// Does the same as EventClock::first_failure; the winner must not be behind at `now`.
  bool first_failure(Event& event, const Now& now, std::optional<Crossing<S>>& own_crossing,
                     double until = never) const {
    if (!on_curves(event.body))
      return on_lines(now,
                      [&](const auto& t) { return lines_.first_failure(event, t, own_crossing, until); });
    own_crossing.reset();
    const CurveRows<S>& rows = rows_[event.body];
    const auto times = rows.times();
    const std::size_t direction = direction_of(event.side);
    const std::uint32_t ahead = is_upper(event.side) ? event.loser : event.winner,
                        behind = is_upper(event.side) ? event.winner : event.loser;
    const std::size_t first = segment_of(event.body, now);
    for (std::size_t k = first; k + 1 < times.size() && (k == first || times[k] < until); ++k) {
      const CurvedPiece<S> a = rows.piece(ahead, direction, k), b = rows.piece(behind, direction, k);
      const SegmentRoots found = segment_roots(a, b);
      for (int i = 0; i < found.count; ++i) {
        const CurveRoot& root = found.roots[i];
        if (root.after <= 0 || (k == first && is_past({a, b, std::uint32_t(i)}, root, now))) continue;
        const TimeEstimate estimate = moment_estimate(a, root);
        event.segment = std::uint32_t(k) | std::uint32_t(i) << root_shift;
        event.begin = times[k];
        event.end = times[k + 1];
        event.hint = estimate.time;
        event.error = estimate.error;
        return true;
      }
    }
    return false;
  }

  /// Returns the sign of (challenger's value - winner's value) at t, as seen from the side: > 0 means ahead.
  int compare_values(std::uint32_t body, Side side, std::uint32_t challenger, std::uint32_t winner,
                     double t) const {
    if (!on_curves(body)) return lines_.compare_values(body, side, challenger, winner, t);
    const CurveRows<S>& rows = rows_[body];
    const auto times = rows.times();
    const std::size_t direction = direction_of(side);
    const std::size_t k = plans_[body]->segment_at(t);
    int sign = 0;
    if (t < times.front() || k + 1 == times.size()) {
      const S x = rows.value(challenger, direction, k), y = rows.value(winner, direction, k);
      sign = (x > y) - (x < y);
    } else {
      sign = compare_at(rows.piece(challenger, direction, k), rows.piece(winner, direction, k), t);
    }
    return is_upper(side) ? sign : -sign;
  }

  /// Returns whether `a` comes first of two failures of one certificate. Of simultaneous ones the loser that
  /// is ahead right after them comes first.
  bool overtakes_first(const Event& a, const std::optional<Crossing<S>>& crossing_a, const Event& b,
                       const std::optional<Crossing<S>>& crossing_b) const {
    if (!on_curves(a.body)) return lines_.overtakes_first(a, crossing_a, b, crossing_b);
    const int order = compare_times(a, b);
    if (order != 0) return order < 0;
    const CurveRows<S>& rows = rows_[a.body];
    const std::size_t direction = direction_of(a.side);
    const std::size_t k = segment_number(a);
    const int ahead = compare_after_moment(rows.piece(a.loser, direction, k),
                                           rows.piece(b.loser, direction, k), moment_of(a));
    return is_upper(a.side) ? ahead > 0 : ahead < 0;
  }

  void remember(std::uint32_t slot, const std::optional<Crossing<S>>& own_crossing) {
    lines_.remember(slot, own_crossing);
  }
  void start() {
    lines_.start();
    for (std::uint32_t body = 0; body < plans_.size(); ++body)
      if (on_curves(body)) rows_[body].copy(*plans_[body], directions_);
  }
  std::size_t bytes() const {
    std::size_t total = lines_.bytes();
    for (const CurveRows<S>& rows : rows_) total += sizeof rows + rows.bytes();
    return total;
  }

 private:
  static constexpr double never = std::numeric_limits<double>::infinity();
  /// An event's `segment` on curves: the number of the root in the upper bits, that of the segment below.
  static constexpr std::uint32_t root_shift = 30;

  static std::uint32_t segment_number(const Event& event) { return event.segment & ((1U << root_shift) - 1); }
  std::size_t segment_of(std::uint32_t body, const Now& now) const {
    if (now.segment != Event::no_segment) return now.segment & ((1U << root_shift) - 1);
    return plans_[body]->segment_at(now.begin);
  }
  CurveMoment<S> moment_of(const Event& event) const {
    const CurveRows<S>& rows = rows_[event.body];
    const std::size_t direction = direction_of(event.side);
    const std::size_t k = segment_number(event);
    return {rows.piece(event.loser, direction, k), rows.piece(event.winner, direction, k),
            event.segment >> root_shift};
  }
  /// Returns whether a root in the segment that contains `now` comes before it.
  static bool is_past(const CurveMoment<S>& moment, const CurveRoot& root, const Now& now) {
    if (now.exact == nullptr) return compare_moment_to(moment, now.begin) < 0;
    KBVH_ASSERT(now.exact->curved);
    if (root.end < now.exact->root.begin) return true;
    if (root.begin > now.exact->root.end) return false;
    return compare_moments(moment, now.exact->moment) < 0;
  }
  /// Calls work with the same instant in the form of EventClock.
  template <class Work>
  static auto on_lines(const Now& now, const Work& work) {
    KBVH_ASSERT(now.exact == nullptr || !now.exact->curved);
    return work(
        Instant<S>{now.begin, now.end, now.exact == nullptr ? nullptr : &now.exact->crossing, now.segment});
  }

  EventClock<S> lines_;
  std::vector<const FlightPlans<S>*> plans_;
  std::span<const SlabDirection> directions_;
  std::vector<CurveRows<S>> rows_;  ///< [body]; empty for bodies without curves
};

}  // namespace kbvh
