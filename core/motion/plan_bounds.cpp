#include <algorithm>
#include <cmath>
#include <limits>

#include "core/motion/error_free.hpp"
#include "core/motion/flight_plans.hpp"

// Bounds of motion: translations, speeds and displacements of a body.

namespace kbvh {

template <class S>
std::optional<Translation<S>> FlightPlans<S>::translation(double t) const {
  const auto& times = keyframes_->times;
  if (!own_plans_.empty() || keyframed_count_ == 0 || t < times.front() || t >= times.back()) return {};
  auto& known = translations_[segment_at(t)];
  if (!known) known = find_translation(segment_at(t));
  return *known;
}

template <class S>
std::optional<Translation<S>> FlightPlans<S>::find_translation(std::size_t segment) const {
  constexpr std::size_t block = 3 * 256;
  constexpr S infinity = std::numeric_limits<S>::infinity(), eps = std::numeric_limits<S>::epsilon();
  const std::size_t scalars = std::size_t(3) * keyframed_count_;
  if (curved_in(segment)) return {};
  const S *from = keyframe(segment), *to = keyframe(segment + 1);
  // A stored coordinate is rounded by a share of itself, whatever those of other vertices are.
  const auto rounding = [&](std::size_t i) { return eps * std::max(std::abs(from[i]), std::abs(to[i])); };
  const std::array<S, 3> first{to[0] - from[0], to[1] - from[1], to[2] - from[2]};
  bool exact = true;
  // The steps that serve all coordinates so far.
  std::array<S, 3> least{-infinity, -infinity, -infinity}, most{infinity, infinity, infinity};
  for (std::size_t begin = 0; begin < scalars; begin += block) {
    for (std::size_t i = begin; i < std::min(begin + block, scalars); i += 3)
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const TwoPart<S> step = two_diff(to[i + axis], from[i + axis]);
        least[axis] = std::max(least[axis], step.hi - rounding(i + axis));
        most[axis] = std::min(most[axis], step.hi + rounding(i + axis));
        exact = exact && step.hi == first[axis] && step.lo == 0;
      }
    for (std::size_t axis = 0; axis < 3; ++axis)
      if (least[axis] > most[axis]) return {};
  }
  if (exact) return Translation<S>{first, first, true};
  std::array<S, 3> step;
  for (std::size_t axis = 0; axis < 3; ++axis)
    step[axis] = std::clamp(least[axis] + (most[axis] - least[axis]) / 2, least[axis], most[axis]);
  for (std::size_t i = 0; i < scalars; ++i)
    if (std::abs(to[i] - (from[i] + step[i % 3])) > rounding(i)) return {};
  return Translation<S>{step, step, false};
}

namespace {
/// Returns an upper bound of every rounding of the few preceding operations on positive numbers, underflow
/// included.
double rounded_up(double value) {
  return value * (1 + 1e-12) + std::numeric_limits<double>::min();
}
}  // namespace

/// Returns the longest step of any vertex in a segment, rounded up; 0 only if no vertex moves. On a curve it
/// is the fastest speed times the duration: the derivative by the share s is a parabola, so that one of its
/// Bernstein coefficients (dx + bend, dx + twist, dx - bend - twist) is at least as long.
template <class S>
double FlightPlans<S>::longest_step(std::size_t segment) const {
  double& known = longest_steps_[segment];
  if (known >= 0) return known;
  const S *from = keyframe(segment), *to = keyframe(segment + 1);
  const S *const bend = curved_in(segment) ? bends(segment) : nullptr, *const twist = curved_in(segment)
                                                                                          ? twists(segment)
                                                                                          : nullptr;
  double square = 0, largest = 0;
  for (std::size_t i = 0; i < std::size_t(3) * keyframed_count_; i += 3) {
    double sums[3] = {0, 0, 0};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double step = double(to[i + axis]) - double(from[i + axis]);
      if (bend == nullptr) {
        sums[0] += step * step;
        largest = std::max(largest, std::abs(step));
        continue;
      }
      const double b = double(bend[i + axis]), w = twist == nullptr ? 0.0 : double(twist[i + axis]);
      // Cancellation in these sums costs at most a share of the summands.
      const double rounding = (std::abs(step) + std::abs(b) + std::abs(w)) * 1e-15;
      const double slopes[3] = {step + b, step + w, step - b - w};
      for (std::size_t c = 0; c < 3; ++c) {
        const double slope = std::abs(slopes[c]) + rounding;
        sums[c] += slope * slope;
        largest = std::max(largest, slope);
      }
    }
    square = std::max({square, sums[0], sums[1], sums[2]});
  }
  // Squares of small numbers underflow; the added term covers the loss.
  known = largest == 0 ? 0 : rounded_up(std::sqrt(square + 1e-300));
  return known;
}

/// Returns the speed of the piece that holds at t.
template <class S>
double FlightPlans<S>::own_speed(const OwnPlan& plan, double t) const {
  double step[3], seconds = 1;
  for (int axis = 0; axis < 3; ++axis) {
    const Piece<S> piece = own_piece(plan, axis, t);
    step[axis] = piece.kind == PieceKind::chord ? double(piece.x1) - double(piece.x0) : double(piece.x1);
    if (piece.kind == PieceKind::chord) seconds = piece.t1 - piece.t0;
  }
  if (step[0] == 0 && step[1] == 0 && step[2] == 0) return 0;
  return rounded_up(std::hypot(step[0], step[1], step[2]) / seconds);
}

template <class S>
double FlightPlans<S>::own_speed_bound(double t) const {
  if (t < own_speed_from_ || t >= own_speed_until_) {
    own_speed_ = 0;
    own_speed_from_ = t;
    own_speed_until_ = std::numeric_limits<double>::infinity();
    for (const OwnPlan& plan : own_plans_) {
      own_speed_ = std::max(own_speed_, own_speed(plan, t));
      own_speed_until_ = std::min(own_speed_until_, piece_end(plan.vertex, t));
    }
  }
  return own_speed_;
}

template <class S>
double FlightPlans<S>::speed_bound(double t) const {
  const auto& times = keyframes_->times;
  const std::size_t k = segment_at(t);
  double bound = own_plans_.empty() ? 0 : own_speed_bound(t);
  if (k + 1 < times.size() && t >= times[0] && longest_step(k) > 0)
    bound = std::max(bound, rounded_up(longest_step(k) / (times[k + 1] - times[k])));
  return bound;
}

template <class S>
double FlightPlans<S>::displacement_bound(double t0, double t1) const {
  if (!(t0 < t1)) return 0;
  const auto& times = keyframes_->times;
  double common = 0;
  for (std::size_t k = segment_at(t0); k + 1 < times.size() && times[k] < t1; ++k) {
    const double begin = std::max(t0, times[k]), end = std::min(t1, times[k + 1]);
    if (!(begin < end) || longest_step(k) == 0) continue;
    const double share = (end - begin) / (times[k + 1] - times[k]);
    common = rounded_up(common + longest_step(k) * std::min(1.0, rounded_up(share)));
  }
  if (own_plans_.empty()) return common;
  double own_bound = own_speed_bound(t0);
  if (t1 <= own_speed_until_) return std::max(common, own_bound == 0 ? 0 : rounded_up(own_bound * (t1 - t0)));
  // Some plan has a knot in between: follow each plan along its own pieces.
  own_bound = 0;
  for (const OwnPlan& plan : own_plans_) {
    double way = 0;
    for (double begin = t0; begin < t1;) {
      const double end = std::min(t1, piece_end(plan.vertex, begin)), speed = own_speed(plan, begin);
      if (speed > 0) way = rounded_up(way + speed * (end - begin));
      begin = end;
    }
    own_bound = std::max(own_bound, way);
  }
  return std::max(common, own_bound);
}

namespace {
/// Returns value + move, rounded down or up to S.
template <class S>
S moved_down(S value, double move) {
  const double exact = double(value) + move;  // off by less than one unit of double
  return std::nextafter(S(exact), -std::numeric_limits<S>::infinity()) + S(0);
}
template <class S>
S moved_up(S value, double move) {
  return -moved_down(-value, -move) + S(0);
}

/// The bulge over a part of a segment, given by the shares of its ends and its length, a share too: a curve
/// lies below its chord by at most the largest second derivative times the square of the length over 8, and
/// that derivative is linear. The length is not to - from: in a short part, the rounding of the two shares
/// would leave few correct digits of it.
template <class S>
Bulge<S> bulge_of_part(S bend, S twist, double from, double to, double length) {
  const double b = double(bend), w = double(twist);
  const double first = 2 * (w - b) - 6 * w * from, last = 2 * (w - b) - 6 * w * to;
  const double scale = 0.125 * length * length * (1 + 1e-12), rounding = (std::abs(b) + std::abs(w)) * 1e-14;
  return {-(std::max({0.0, first, last}) + rounding) * scale,
          (rounding - std::min({0.0, first, last})) * scale};
}
}  // namespace

template <class S>
void FlightPlans<S>::evaluate_hull(double begin, double end, double t, S* out) const {
  const auto& times = keyframes_->times;
  const std::size_t k = segment_at(begin), scalars = std::size_t(3) * keyframed_count_;
  evaluate_keyframed(t, 0, keyframed_count_, out);
  std::copy_n(out, scalars, out + scalars);
  if (!curved_in(k)) return;
  const S *const bend = bends(k), *const twist = twists(k);
  const bool whole = begin == times[k] && end == times[k + 1];
  const double duration = times[k + 1] - times[k], from = (begin - times[k]) / duration,
               to = (end - times[k]) / duration, length = (end - begin) / duration;
  for (std::size_t i = 0; i < scalars; ++i) {
    const S w = twist == nullptr ? S(0) : twist[i];
    if (bend[i] == S(0) && w == S(0)) continue;
    const Bulge<S> distance = whole ? bulge(bend[i], w) : bulge_of_part(bend[i], w, from, to, length);
    if (distance.lower != 0) out[i] = moved_down(out[i], distance.lower);
    if (distance.upper != 0) out[scalars + i] = moved_up(out[scalars + i], distance.upper);
  }
}

#define KBVH_INSTANTIATE(S)                                                                   \
  template std::optional<Translation<S>> FlightPlans<S>::translation(double) const;           \
  template std::optional<Translation<S>> FlightPlans<S>::find_translation(std::size_t) const; \
  template double FlightPlans<S>::longest_step(std::size_t) const;                            \
  template double FlightPlans<S>::own_speed(const OwnPlan&, double) const;                    \
  template double FlightPlans<S>::own_speed_bound(double) const;                              \
  template double FlightPlans<S>::speed_bound(double) const;                                  \
  template double FlightPlans<S>::displacement_bound(double, double) const;                   \
  template void FlightPlans<S>::evaluate_hull(double, double, double, S*) const;
KBVH_INSTANTIATE(float)
KBVH_INSTANTIATE(double)
#undef KBVH_INSTANTIATE

}  // namespace kbvh
