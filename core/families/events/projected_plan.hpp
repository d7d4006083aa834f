#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>

#include "core/geometry/volumes/dop.hpp"
#include "core/motion/flight_plans.hpp"

// The motion of a vertex along a fixed direction n, as kinetic trees see it. Along an axis it is the flight
// plan of a coordinate. Along another direction it is the projected plan: n . x of the stored positions (and
// velocities), rounded once to the scalar, and linear in between. A curve's coefficients are projected in the
// same way. Certificates, events and their order are exact for the projected plan. It differs from the
// projection of the exact plan by rounding, so bounds that are read from it are widened by a
// ProjectionMargin.

namespace kbvh {

/// Returns n . p, rounded to S with a relative error of at most one ulp.
template <class S>
S projected(const SlabDirection& n, const S* p) {
  return S(outward::sum_of(n[0] * double(p[0]), n[1] * double(p[1]), n[2] * double(p[2])).nearest);
}

/// Returns the piece of a vertex's projected plan that holds at t and right after it.
template <class S>
Piece<S> projected_piece(const FlightPlans<S>& plans, std::uint32_t vertex, const SlabDirection& n,
                         double t) {
  Piece<S> piece;
  S first[3], second[3];
  for (int axis = 0; axis < 3; ++axis) {
    piece = plans.piece_after(vertex, axis, t);  // of equal kind and times for all axes
    first[axis] = piece.x0;
    second[axis] = piece.x1;
  }
  piece.x0 = projected(n, first);
  piece.x1 = projected(n, second);
  return piece;
}

/// Bounds how far the projection of a body's vertex may lie beyond the rounded projected plan of the vertex
/// that realises a side.
///
/// Let u be half an ulp of 1 in S, and R an upper bound of |x| + |y| + |z| over the vertices' exact plans. At
/// a frame, v is any vertex, w the realiser, q the projected plans and P the position of v. All components of
/// n are -1, 0 or 1, so that every number below is at most R in magnitude. Up to terms of the order u^2 R:
///   n . P <= n . x_v + u R     each coordinate of P is x_v, rounded
///   n . x_v <= q_v + 2 u R     the ends of the linear piece are rounded
///   q_v <= q_w                 w realises the side
///   q_w <= RN(q_w) + u R       the value of the plan is rounded
/// The margin is 5 u R, plus as many least numbers of S as underflow may cost.
///
/// On a curve (curved_piece.hpp) the weights of bend and twist, s (1 - s) and s^2 (1 - s), are at most 1/4.
/// With R = |x|_1 at the ends + (|bend|_1 + |twist|_1) / 4 every line above holds: the four coefficients of q
/// are rounded by at most 2 u of their magnitude each.
template <class S>
class ProjectionMargin {
 public:
  /// Takes R from the keyframes alone, and from the curves between them. O(keyframes). Must precede the other
  /// calls.
  void start_over(const FlightPlans<S>& plans) {
    keyframed_ = 0;
    for (std::size_t k = 0; k < plans.keyframe_count(); ++k) {
      const bool bent = plans.curved_in(k);
      const S *const bend = bent ? plans.bends(k) : nullptr, *const twist = bent ? plans.twists(k) : nullptr;
      for (std::size_t v = 0; v < plans.keyframed_count(); ++v) {
        double reach = length(plans.keyframe(k) + 3 * v);
        if (bent) reach = std::max(reach, length(plans.keyframe(k + 1) + 3 * v));
        for (const S* const coefficients : {bend, twist})
          if (coefficients != nullptr) reach += 0.25 * length(coefficients + 3 * v);
        keyframed_ = std::max(keyframed_, reach);
      }
    }
    own_reach_ = speed_ = 0;
    since_ = std::numeric_limits<double>::infinity();
  }
  /// Includes the plan that a vertex follows from t on. Until `start_over` the margin never shrinks.
  /// O(knots).
  void include(const FlightPlans<S>& plans, std::uint32_t vertex, double t) {
    since_ = std::min(since_, t);
    for (;;) {
      Piece<S> piece;
      S first[3], second[3];
      for (int axis = 0; axis < 3; ++axis) {
        piece = plans.piece_after(vertex, axis, t);
        first[axis] = piece.x0;
        second[axis] = piece.x1;
      }
      own_reach_ = std::max(own_reach_, length(first));
      if (piece.kind == PieceKind::ray) {
        speed_ = std::max(speed_, length(second));
        return;
      }
      t = piece.t1;
    }
  }

  /// Returns the margin at t.
  double at(double t) const {
    const double elapsed = since_ < t ? t - since_ : 0;
    const double reach = std::max(keyframed_, own_reach_ + speed_ * elapsed);
    return 5 * unit * reach + (8 + elapsed) * least;
  }

 private:
  static constexpr double unit = double(std::numeric_limits<S>::epsilon()) / 2;
  static constexpr double least = double(std::numeric_limits<S>::denorm_min());
  static double length(const S* x) {
    return std::fabs(double(x[0])) + std::fabs(double(x[1])) + std::fabs(double(x[2]));
  }

  double keyframed_ = 0;              ///< R of the keyframes
  double own_reach_ = 0, speed_ = 0;  ///< of the vertices' own plans: largest |x| + |y| + |z| at knots, and
                                      ///< of velocities
  double since_ = std::numeric_limits<double>::infinity();  ///< no own plan begins earlier
};

}  // namespace kbvh
