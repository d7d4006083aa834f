#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "core/families/events/projected_plan.hpp"
#include "core/motion/curved_piece.hpp"
#include "core/motion/flight_plans.hpp"

namespace kbvh {

/// A copy of the curves of one body in vertex order, made when a clip begins, as KeyframeRows copies
/// keyframes: a search for the failure of a certificate reads the segments of a vertex in order. Along an
/// axis the numbers are the stored ones. Along another direction each is a projection, rounded to S
/// (projected_plan.hpp).
template <class S>
class CurveRows {
 public:
  /// Copies the keyframes and coefficients of plans along directions, the axes first, again if they were
  /// copied before. O(keyframes x vertices x directions).
  void copy(const FlightPlans<S>& plans, std::span<const SlabDirection> directions) {
    times_ = plans.keyframe_times();
    vertices_ = plans.keyframed_count();
    knots_.resize(directions.size() * vertices_ * times_.size());
    for (std::size_t k = 0; k < times_.size(); ++k) {
      const bool bent = plans.curved_in(k);
      const S *const x = plans.keyframe(k), *const bend = bent ? plans.bends(k) : nullptr,
                     *const twist = bent ? plans.twists(k) : nullptr;
      for (std::size_t direction = 0; direction < directions.size(); ++direction)
        for (std::size_t v = 0; v < vertices_; ++v) {
          const auto along = [&](const S* values) {
            if (values == nullptr) return S(0);
            return direction < 3 ? values[3 * v + direction]
                                 : projected(directions[direction], values + 3 * v);
          };
          knots_[(direction * vertices_ + v) * times_.size() + k] = {along(x), along(bend), along(twist)};
        }
    }
  }
  std::span<const double> times() const { return times_; }
  /// Returns a vertex's piece along a direction in segment k.
  CurvedPiece<S> piece(std::uint32_t vertex, std::size_t direction, std::size_t k) const {
    const Knot* const knot = knots_.data() + (direction * vertices_ + vertex) * times_.size() + k;
    return {times_[k], times_[k + 1], knot[0].x, knot[1].x, knot[0].bend, knot[0].twist};
  }
  /// Returns a vertex's value along a direction at keyframe k.
  S value(std::uint32_t vertex, std::size_t direction, std::size_t k) const {
    return knots_[(direction * vertices_ + vertex) * times_.size() + k].x;
  }
  std::size_t bytes() const { return knots_.capacity() * sizeof(Knot); }

 private:
  struct Knot {
    S x, bend, twist;  ///< the position at a keyframe, and the curve from there on
  };
  std::span<const double> times_;  ///< of the plans
  std::size_t vertices_ = 0;
  std::vector<Knot> knots_;  ///< [direction][vertex][keyframe]
};

}  // namespace kbvh
