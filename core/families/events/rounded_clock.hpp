#pragma once
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <type_traits>
#include <vector>

#include "core/base/assert.hpp"
#include "core/families/events/event.hpp"

namespace kbvh {

/// How a clock with rounded times finds the failure of a certificate within a segment.
enum class FailureRule : std::uint8_t {
  end_point_rule,  ///< it fails if and only if the loser is ahead at the segment's end, which is stored data;
                   ///< only the time is rounded
  textbook,  ///< it fails if the two lines cross between now and the segment's end (Z&W 2006, Algorithm 3, as
             ///< printed); everything is rounded
};

/// The arithmetic of a clock with rounded times.
enum class EventTimes : std::uint8_t { in_float, in_double };

/// EventClock without exact arithmetic: event times are floats or doubles, compared as they are. For
/// contestants that show the benefit of exactness; with either rule a bound may be late. Per-vertex plans are
/// not supported.
template <class S>
class RoundedClock {
 public:
  using Event = kbvh::Event;
  /// Only for the sides of boxes: `directions` are the axes.
  RoundedClock(std::vector<const FlightPlans<S>*> plans, std::span<const SlabDirection> directions)
      : plans_(std::move(plans)) {
    KBVH_ASSERT(directions.size() == 3);
    (void)directions;
  }

  /// Chooses the arithmetic, by default double, and the rule, by default `textbook`; before the first event.
  void choose(EventTimes times, FailureRule rule) {
    times_ = times;
    rule_ = rule;
  }

  const FlightPlans<S>& plans(std::uint32_t body) const { return *plans_[body]; }
  /// Returns an empty crossing: `first_failure` starts from an event's `begin`.
  Crossing<S> crossing(const Event& /*event*/) const { return {}; }

  std::size_t bytes() const { return 0; }

  bool earlier(const Event& a, const Event& b) const {
    if (a.hint != b.hint) return a.hint < b.hint;
    if (a.depth != b.depth) return a.depth > b.depth;
    return a.slot < b.slot;
  }
  bool due(const Event& event, double t) const { return event.hint <= t; }

  /// Does the same as EventClock::first_failure, with rounded times. `hint` is the event's time. `begin` and
  /// `end` equal it, unless rounding moved it out of its segment.
  bool first_failure(Event& event, const Instant<S>& now, std::optional<Crossing<S>>& own_crossing,
                     double until = std::numeric_limits<double>::infinity()) const {
    own_crossing.reset();
    if (times_ == EventTimes::in_float)
      return rule_ == FailureRule::textbook ? find<float, FailureRule::textbook>(event, now, until)
                                            : find<float, FailureRule::end_point_rule>(event, now, until);
    return rule_ == FailureRule::textbook ? find<double, FailureRule::textbook>(event, now, until)
                                          : find<double, FailureRule::end_point_rule>(event, now, until);
  }

  /// Compares exactly: only times are rounded, not the state at the beginning.
  int compare_values(std::uint32_t body, Side side, std::uint32_t challenger, std::uint32_t winner,
                     double t) const {
    const FlightPlans<S>& plan = *plans_[body];
    const int axis = axis_of(side);
    const int sign = compare_at(plan.piece_after(challenger, axis, t), plan.piece_after(winner, axis, t), t);
    return is_upper(side) ? sign : -sign;
  }

  /// Returns whether `a` comes first of two failures of one certificate. At equal times the loser that is
  /// further ahead at the segment's end comes first.
  bool overtakes_first(const Event& a, const std::optional<Crossing<S>>& /*crossing_a*/, const Event& b,
                       const std::optional<Crossing<S>>& /*crossing_b*/) const {
    if (a.hint != b.hint) return a.hint < b.hint;
    const FlightPlans<S>& plan = *plans_[a.body];
    const std::size_t k = std::min(plan.segment_at(a.hint) + 1, plan.keyframe_count() - 1);
    const auto axis = std::size_t(axis_of(a.side));
    const S end_a = plan.keyframe(k)[std::size_t(3) * a.loser + axis];
    const S end_b = plan.keyframe(k)[std::size_t(3) * b.loser + axis];
    return is_upper(a.side) ? end_a > end_b : end_a < end_b;
  }

  void remember(std::uint32_t /*slot*/, const std::optional<Crossing<S>>& /*own_crossing*/) {}
  void start() {}

 private:
  /// Implements `first_failure` with times of type T.
  template <class T, FailureRule rule>
  bool find(Event& event, const Instant<S>& now, double until) const {
    const FlightPlans<S>& plan = *plans_[event.body];
    const auto times = plan.keyframe_times();
    const auto axis = std::size_t(axis_of(event.side));
    const std::size_t w = std::size_t(3) * event.winner + axis, l = std::size_t(3) * event.loser + axis;
    // Differences of coordinates are computed first, so that float times do not imply float coordinates.
    using Wide = std::conditional_t<sizeof(T) < sizeof(S), S, T>;
    const T sign = is_upper(event.side) ? T(1) : T(-1);
    for (std::size_t k = plan.segment_at(now.begin); k + 1 < times.size() && times[k] < until; ++k) {
      const T begin = T(times[k]), length = T(times[k + 1]) - begin;
      const T behind = sign * T(Wide(plan.keyframe(k)[w]) - Wide(plan.keyframe(k)[l]));
      T time = 0;
      if constexpr (rule == FailureRule::end_point_rule) {
        const double ahead = double(plan.keyframe(k + 1)[l]) - double(plan.keyframe(k + 1)[w]);
        if (!((is_upper(event.side) ? ahead : -ahead) > 0)) continue;
        time = begin + length * (behind / (behind + T(sign * T(ahead))));
        // The loser is behind at the start and ahead at the end: the time lies in between, in spite of
        // rounding.
        if (!(time >= begin)) time = begin;
        time = std::min(time, T(times[k + 1]));
        if (!(double(time) >= now.begin)) time = T(now.begin);
      } else {
        const T ahead = sign * T(Wide(plan.keyframe(k + 1)[l]) - Wide(plan.keyframe(k + 1)[w]));
        const T closing = (behind + ahead) / length;  // of the loser, relative to the winner
        if (!(closing > 0)) continue;
        time = begin + behind / closing;
        if (!(double(time) >= std::max(now.begin, times[k]) && double(time) < times[k + 1])) continue;
      }
      event.hint = double(time);
      // The next search starts within this segment. No event is found twice, and later events of the segment
      // are not skipped if this time was rounded to its end.
      event.begin = event.end = std::clamp(double(time), times[k], std::nextafter(times[k + 1], times[k]));
      event.error = 0;
      return true;
    }
    return false;
  }

  std::vector<const FlightPlans<S>*> plans_;
  EventTimes times_ = EventTimes::in_double;
  FailureRule rule_ = FailureRule::textbook;
};

}  // namespace kbvh
