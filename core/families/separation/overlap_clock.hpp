#pragma once
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <type_traits>
#include <vector>

#include "core/base/library_gaps.hpp"
#include "core/families/events/event.hpp"

namespace kbvh {

/// Direction in which a bound is inflated before it is compared with another body's bound. Rounding preserves
/// <= but not <: two bounds that are at most one ulp apart on the flight plans may be equal as rounded
/// positions. A bound is therefore inflated by at least four ulps at its knots. If an inflated bound is apart
/// from another bound, their rounded positions are apart, too: between knots the margin is linear, and thus
/// at least four ulps of the interpolated value.
enum class Widening : std::uint8_t { none, up, down };

/// Returns a value of S that is 4 to 8 ulps above x (some 2^-21 |x| in float, 2^-50 |x| in double). For x = 0
/// the result is positive.
template <class S>
S widened_up(S x) {
  using Bits = std::conditional_t<sizeof(S) == 4, std::uint32_t, std::uint64_t>;
  constexpr S share = sizeof(S) == 4 ? S(0x1p-21) : S(0x1p-50);
  constexpr Bits sign = bit_cast<Bits>(S(-0.0));
  const S sum = x + std::abs(x) * share;
  // Adds two ulps for the rounding errors of product and sum.
  const Bits bits = bit_cast<Bits>(sum);
  if ((bits & ~sign) <= 2) [[unlikely]] {
    if (sum == 0) return 2 * std::numeric_limits<S>::denorm_min();
    return bit_cast<S>(sum > 0 ? bits + 2 : Bits(0));
  }
  return bit_cast<S>(Bits(bits + 2 - ((bits & sign) != 0 ? 4 : 0)));
}

/// Iterates over the linear pieces of one vertex coordinate, from an instant on.
template <class S>
class PieceWalk {
 public:
  /// Reads `keyframes` ([keyframe][vertex][3]) in place of those of the plans unless it is null.
  PieceWalk(const FlightPlans<S>& plans, const S* keyframes, std::uint32_t vertex, int axis,
            Widening widening, const Instant<S>& now)
      : plans_(&plans),
        keyframes_(keyframes),
        vertex_(vertex),
        axis_(axis),
        widening_(widening),
        own_(plans.has_own_plan(vertex)),
        times_(plans.keyframe_times()) {
    take(now.begin);
    while (now.exact != nullptr && piece_.t1 < now.end && compare_crossing_to(*now.exact, piece_.t1) >= 0)
      next();
  }

  const Piece<S>& piece() const { return piece_; }
  /// Advances to the piece that begins where the current piece ends.
  void next() {
    if (own_ || segment_ == before_first)
      take(piece_.t1);
    else
      take_segment(segment_ + 1);
  }
  /// Returns the value at `end` if it is one of the stored numbers. Requires that `end` is not after the end
  /// of the piece.
  std::optional<S> stored_value(double end) const {
    if (piece_.kind == PieceKind::chord) return end == piece_.t1 ? std::optional<S>(piece_.x1) : std::nullopt;
    return piece_.x1 == 0 ? std::optional<S>(piece_.x0) : std::nullopt;
  }

 private:
  static constexpr std::size_t before_first = std::numeric_limits<std::size_t>::max();

  void take(double t) {
    if (own_ || t < times_[0]) {
      piece_ = plans_->piece_after(vertex_, axis_, t);
      if (!own_) piece_.x0 = value(0);
      segment_ = before_first;
      widen();
    } else {
      take_segment(plans_->segment_at(t));
    }
  }
  void take_segment(std::size_t k) {
    segment_ = k;
    if (k + 1 < times_.size())
      piece_ = {times_[k], times_[k + 1], value(k), value(k + 1), PieceKind::chord};
    else
      piece_ = {times_[k], std::numeric_limits<double>::infinity(), value(k), S(0), PieceKind::ray};
    widen();
  }
  /// Returns the coordinate at keyframe k.
  S value(std::size_t k) const {
    const S* const keyframe =
        keyframes_ == nullptr ? plans_->keyframe(k) : keyframes_ + 3 * k * plans_->keyframed_count();
    return keyframe[std::size_t(3) * vertex_ + std::size_t(axis_)];
  }
  void widen() {
    if (widening_ == Widening::none) return;
    piece_.x0 = widened(piece_.x0);
    // A resting body keeps velocity zero. A nonzero velocity is widened like a position.
    if (piece_.kind == PieceKind::chord || piece_.x1 != 0) piece_.x1 = widened(piece_.x1);
  }
  S widened(S x) const { return widening_ == Widening::up ? widened_up(x) : -widened_up(-x); }

  const FlightPlans<S>* plans_;
  const S* keyframes_;
  std::uint32_t vertex_;
  int axis_;
  Widening widening_;
  bool own_;
  std::span<const double> times_;
  std::size_t segment_ = before_first;
  Piece<S> piece_;
};

/// A box given by the six vertices that realise its sides now: [lower x, upper x, lower y, ...]. In a body on
/// curves the sides follow the chains of CurveHulls.
template <class S>
struct RealisedBox {
  const FlightPlans<S>* plans;
  const std::uint32_t* realisers;
  const S *lower = nullptr, *upper = nullptr;  ///< chains; null: the plans

  /// Returns the walk of a side's realiser.
  PieceWalk<S> walk(Side side, Widening widening, const Instant<S>& now) const {
    return {*plans, is_upper(side) ? upper : lower, realisers[side], axis_of(side), widening, now};
  }
};

/// The instant at which two boxes begin or cease to overlap: a crossing of two pieces, within `error` of
/// `hint`. For a review, the instant up to which the state of the boxes is known to last; the clock must be
/// asked again at that instant.
template <class S>
struct OverlapEvent {
  double hint = 0, error = 0;
  Crossing<S> crossing;
  std::uint32_t slot = 0;
  std::uint32_t depth = 0;  ///< depth of the pair below the pair of roots
  bool review = false;      ///< `hint` is exact, and nothing changes there

  /// Return doubles before and after the event.
  double not_after() const { return std::nextafter(hint - error, -std::numeric_limits<double>::infinity()); }
  double not_before() const { return std::nextafter(hint + error, std::numeric_limits<double>::infinity()); }
  Instant<S> instant() const { return {not_after(), not_before(), &crossing}; }
};

/// Decides exactly, on the flight plans, when two boxes of different bodies overlap (Z&W s.8.1 with its
/// erratum: the overlap intervals of the axes are intersected). Boxes are closed; the first box is inflated
/// as `Widening` describes. "After" an instant means right after it. A contact of zero duration therefore
/// does not count, which the margin allows. Boxes are evaluated with their current realisers; after a change
/// of realisers the caller must ask again.
///
/// The clock looks a limited number of linear pieces ahead, and then returns a review. Realisers seldom last
/// through a clip, and a search to the clip's end for each of them would be quadratic in the number of
/// keyframes.
template <class S>
class OverlapClock {
 public:
  using Event = OverlapEvent<S>;
  static constexpr int usual_look_ahead = 32;
  explicit OverlapClock(int look_ahead = usual_look_ahead) : look_ahead_(look_ahead) {}

  /// Strict weak order of events: exact time, then the smaller depth, then the slot.
  bool earlier(const Event& a, const Event& b) const {
    const int order = compare_times(a, b);
    if (order != 0) return order < 0;
    if (a.depth != b.depth) return a.depth < b.depth;
    return a.slot < b.slot;
  }
  int compare_times(const Event& a, const Event& b) const {
    const double error = a.error + b.error;
    if (a.hint + error < b.hint) return -1;
    if (b.hint + error < a.hint) return 1;
    if (a.crossing == b.crossing) return 0;  // pairs often share their realisers
    return compare_crossings(a.crossing, b.crossing);
  }
  /// Returns whether the event happens at or before t.
  bool due(const Event& event, double t) const {
    if (event.hint + event.error < t) return true;
    if (event.hint - event.error > t) return false;
    return compare_crossing_to(event.crossing, t) <= 0;
  }

  /// Returns whether the event happens before t.
  bool before(const Event& event, double t) const {
    if (event.hint + event.error < t) return true;
    if (event.hint - event.error > t) return false;
    return compare_crossing_to(event.crossing, t) < 0;
  }
  /// Sets the time of an event. Returns false if the crossing has no finite time.
  static bool set(Event& event, const Crossing<S>& crossing) {
    const TimeEstimate estimate = crossing_estimate(crossing);
    if (!std::isfinite(estimate.time)) return false;
    event.crossing = crossing;
    event.hint = estimate.time;
    event.error = estimate.error;
    event.review = false;
    return true;
  }

  /// Returns whether the boxes overlap right after the instant.
  bool overlap_after(const RealisedBox<S>& a, const RealisedBox<S>& b, const Instant<S>& now) const {
    for (int side = 0; side < 6; ++side)
      if (Gap(a, b, side, now).sign_after(now) < 0) return false;
    return true;
  }

  /// Finds when two boxes that are apart right after `now` begin to overlap, or a review. Returns false if
  /// they never overlap.
  bool next_overlap(const RealisedBox<S>& a, const RealisedBox<S>& b, const Instant<S>& now,
                    Event& event) const {
    Instant<S> instant = now;
    int pieces = look_ahead_;
    event.review = false;
    // Each gap in turn advances the instant to where the gap closes. The search ends when six gaps in a row
    // are not negative.
    for (int side = 0, agreed = 0; agreed < 6; side = (side + 1) % 6) {
      Gap gap(a, b, side, instant);
      if (gap.sign_after(instant) >= 0) {
        ++agreed;
        continue;
      }
      Crossing<S> crossing;
      if (!gap.first_closing(pieces, crossing)) {
        if (!std::isfinite(gap.known_until())) return false;
        set_review(event, gap.known_until());
        return true;
      }
      if (!set(event, crossing)) return false;
      instant = event.instant();
      agreed = 1;
    }
    return true;
  }

  /// Finds when two boxes that overlap right after `now` separate, or a review. Returns false if they never
  /// separate.
  bool next_separation(const RealisedBox<S>& a, const RealisedBox<S>& b, const Instant<S>& now,
                       Event& event) const {
    constexpr double never = std::numeric_limits<double>::infinity();
    bool found = false;
    double latest = never, known_until = never;
    event.review = false;
    for (int side = 0; side < 6; ++side) {
      Crossing<S> crossing;
      Event other = event;
      Gap gap(a, b, side, now);
      const bool opens = gap.first_opening(look_ahead_, std::min(latest, known_until), crossing);
      known_until = std::min(known_until, gap.known_until());
      if (!opens || !set(other, crossing)) continue;
      if (found && compare_times(event, other) <= 0) continue;
      found = true;
      event = other;
      latest = event.not_before();
    }
    if (known_until == never || (found && due(event, known_until))) return found;
    set_review(event, known_until);
    return true;
  }

 private:
  /// One of the six conditions of an overlap: the upper bound of one box minus the lower bound of the other
  /// box on one axis. The boxes are apart if any gap is negative.
  class Gap {
   public:
    Gap(const RealisedBox<S>& a, const RealisedBox<S>& b, int side, const Instant<S>& now)
        : axis_(side / 2),
          upper_(side % 2 == 0 ? a.walk(Side(2 * axis_ + 1), Widening::up, now)
                               : b.walk(Side(2 * axis_ + 1), Widening::none, now)),
          lower_(side % 2 == 0 ? b.walk(Side(2 * axis_), Widening::none, now)
                               : a.walk(Side(2 * axis_), Widening::down, now)) {}

    /// Returns the sign of the gap right after `now`, at which the walk stands.
    int sign_after(const Instant<S>& now) const {
      const Piece<S>&u = upper_.piece(), &l = lower_.piece();
      int sign = 0;  // the gap is zero if it closes or opens exactly at `now`
      if (now.exact == nullptr)
        sign = compare_at(u, l, now.begin);
      else if (!is_crossing(*now.exact, u, l))
        sign = compare_at_crossing(u, l, *now.exact);
      return sign != 0 ? sign : compare_slopes(u, l);
    }

    /// Finds where a negative gap ceases to be negative. Subtracts the visited linear pieces from `pieces`,
    /// and gives up when none is left. Returns false if the gap stays negative or the search gave up.
    bool first_closing(int& pieces, Crossing<S>& crossing) {
      for (double begin = -never;;) {
        const double end = this->end();
        if (std::isinf(end)) {
          if (compare_slopes(upper_.piece(), lower_.piece()) <= 0) return false;
          crossing = {lower_.piece(), upper_.piece()};
          return true;
        }
        const int sign = sign_at(end);
        if (sign >= 0) crossing = {lower_.piece(), upper_.piece()};
        // The gap is negative throughout this piece.
        if (sign < 0 && --pieces < 0 && std::isfinite(begin)) return gives_up(begin);
        next(end);
        if (sign > 0) return true;
        // At zero the slope of the next pieces decides.
        if (sign == 0 && compare_slopes(upper_.piece(), lower_.piece()) >= 0) return true;
        begin = end;
      }
    }

    /// Finds where a gap that is not negative becomes negative, unless that is after `latest`. Gives up after
    /// `pieces` linear pieces. Returns false if the gap does not open by `latest` or the search gave up.
    bool first_opening(int pieces, double latest, Crossing<S>& crossing) {
      for (double begin = -never; begin <= latest;) {
        const double end = this->end();
        const int sign = std::isinf(end) ? compare_slopes(upper_.piece(), lower_.piece()) : sign_at(end);
        if (sign < 0) {
          crossing = {upper_.piece(), lower_.piece()};
          return true;
        }
        if (std::isinf(end)) return false;
        // The gap is not negative throughout this piece.
        if (--pieces < 0) return gives_up(begin);
        next(end);
        begin = end;
      }
      return false;
    }

    /// Returns, after a search that gave up, the begin of a piece through which the gap keeps its initial
    /// sign. Infinite if the search did not give up.
    double known_until() const { return known_until_; }

   private:
    static constexpr double never = std::numeric_limits<double>::infinity();

    bool gives_up(double begin) {
      known_until_ = begin;
      return false;
    }
    static bool is_crossing(const Crossing<S>& crossing, const Piece<S>& u, const Piece<S>& l) {
      return (crossing.winner == u && crossing.loser == l) || (crossing.winner == l && crossing.loser == u);
    }
    double end() const { return std::min(upper_.piece().t1, lower_.piece().t1); }
    void next(double end) {
      if (upper_.piece().t1 <= end) upper_.next();
      if (lower_.piece().t1 <= end) lower_.next();
    }
    int sign_at(double end) const {
      const auto u = upper_.stored_value(end), l = lower_.stored_value(end);
      if (u && l) return *u > *l ? 1 : *u < *l ? -1 : 0;
      return compare_at(upper_.piece(), lower_.piece(), end);
    }

    int axis_;
    PieceWalk<S> upper_, lower_;
    double known_until_ = never;
  };

  int look_ahead_;

  static void set_review(Event& event, double t) {
    const Piece<S> rest{t, std::numeric_limits<double>::infinity(), S(0), S(0), PieceKind::ray};
    Piece<S> rises = rest;
    rises.x1 = 1;
    event.crossing = {rises, rest};
    event.hint = t;
    event.error = 0;
    event.review = true;
  }
};

}  // namespace kbvh
