#pragma once
#include <cstdint>
#include <vector>

#include "core/motion/curved_piece.hpp"
#include "core/motion/flight_plans.hpp"

namespace kbvh {

/// A copy of the curves of one body in vertex order, made when a clip begins, as KeyframeRows copies
/// keyframes: a search for the failure of a certificate reads the segments of a vertex in order.
template <class S>
class CurveRows {
 public:
  /// Copies the keyframes and coefficients of plans, again if they were copied before. O(keyframes x
  /// vertices).
  void copy(const FlightPlans<S>& plans) {
    times_ = plans.keyframe_times();
    vertices_ = plans.keyframed_count();
    knots_.resize(std::size_t(3) * vertices_ * times_.size());
    for (std::size_t k = 0; k < times_.size(); ++k) {
      const bool bent = plans.curved_in(k);
      const S *const x = plans.keyframe(k), *const bend = bent ? plans.bends(k) : nullptr,
                     *const twist = bent ? plans.twists(k) : nullptr;
      for (std::size_t v = 0; v < vertices_; ++v)
        for (std::size_t axis = 0; axis < 3; ++axis) {
          const std::size_t from = 3 * v + axis;
          knots_[(axis * vertices_ + v) * times_.size() + k] = {x[from], bend == nullptr ? S(0) : bend[from],
                                                                twist == nullptr ? S(0) : twist[from]};
        }
    }
  }
  std::span<const double> times() const { return times_; }
  /// Returns a coordinate's piece in segment k.
  CurvedPiece<S> piece(std::uint32_t vertex, std::size_t axis, std::size_t k) const {
    const Knot* const knot = knots_.data() + (axis * vertices_ + vertex) * times_.size() + k;
    return {times_[k], times_[k + 1], knot[0].x, knot[1].x, knot[0].bend, knot[0].twist};
  }
  /// Returns a coordinate at keyframe k.
  S value(std::uint32_t vertex, std::size_t axis, std::size_t k) const {
    return knots_[(axis * vertices_ + vertex) * times_.size() + k].x;
  }
  std::size_t bytes() const { return knots_.capacity() * sizeof(Knot); }

 private:
  struct Knot {
    S x, bend, twist;  ///< the position at a keyframe, and the curve from there on
  };
  std::span<const double> times_;  ///< of the plans
  std::size_t vertices_ = 0;
  std::vector<Knot> knots_;  ///< [axis][vertex][keyframe]
};

}  // namespace kbvh
