#include "core/motion/flight_plans.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "core/geometry/predicates.hpp"

namespace kbvh {

namespace {
template <class S>
void check_value(S value, const char* what, std::size_t keyframe, std::size_t vertex, int axis) {
  if (std::isfinite(value) && std::abs(value) <= admissible_magnitude<S>) return;
  throw std::invalid_argument(std::string(what) + " of vertex " + std::to_string(vertex) + ", axis " +
                              "xyz"[axis] + ", at knot " + std::to_string(keyframe) + " is " +
                              std::to_string(value) + ", outside the admissible range");
}
}  // namespace

template <class S>
FlightPlans<S>::FlightPlans(std::uint32_t vertex_count, std::vector<double> times, std::vector<S> positions)
    : vertex_count_(vertex_count), keyframed_count_(vertex_count) {
  if (times.empty()) throw std::invalid_argument("flight plans need at least one keyframe");
  for (std::size_t k = 0; k < times.size(); ++k) {
    if (!std::isfinite(times[k]))
      throw std::invalid_argument("keyframe " + std::to_string(k) + " has time " + std::to_string(times[k]));
    if (k > 0 && !(times[k - 1] < times[k]))
      throw std::invalid_argument("keyframe times must increase: keyframe " + std::to_string(k) + " at " +
                                  std::to_string(times[k]) + " follows " + std::to_string(times[k - 1]));
  }
  if (positions.size() != std::size_t(3) * vertex_count * times.size())
    throw std::invalid_argument("expected " + std::to_string(std::size_t(3) * vertex_count * times.size()) +
                                " coordinates for the keyframes, got " + std::to_string(positions.size()));
  for (std::size_t i = 0; i < positions.size(); ++i) {
    const std::size_t point = i / 3;
    check_value(positions[i], "coordinate", point / vertex_count, point % vertex_count, int(i % 3));
    if (positions[i] == S(0)) positions[i] = S(0);  // truth B holds no negative zero
  }
  keyframes_ = std::make_shared<const Keyframes>(Keyframes{std::move(times), std::move(positions)});
}

template <class S>
std::size_t FlightPlans<S>::segment_at(double t) const {
  const auto& times = keyframes_->times;
  const auto above = std::upper_bound(times.begin(), times.end(), t);
  return above == times.begin() ? 0 : std::size_t(above - times.begin()) - 1;
}

template <class S>
void FlightPlans<S>::evaluate(double t, S* out, RoundingStats* stats) const {
  const auto& times = keyframes_->times;
  const std::size_t k = segment_at(t), scalars = std::size_t(3) * keyframed_count_;
  if (t <= times[k] || k + 1 == times.size()) {
    std::copy_n(keyframe(k), scalars, out);
  } else {
    round_chord(keyframe(k), keyframe(k + 1), scalars, times[k], times[k + 1], t, out, stats);
  }
  for (const OwnPlan& plan : own_)
    for (int axis = 0; axis < 3; ++axis)
      out[3 * std::size_t(plan.vertex) + std::size_t(axis)] = round_piece(own_piece(plan, axis, t), t);
}

template <class S>
void FlightPlans<S>::evaluate_keyframed(double t, std::span<const std::uint32_t> vertices, S* out,
                                        RoundingStats* stats) const {
  const auto& times = keyframes_->times;
  const std::size_t k = segment_at(t);
  if (t <= times[k] || k + 1 == times.size()) {
    for (std::uint32_t v : vertices)
      std::copy_n(keyframe(k) + std::size_t(3) * v, 3, out + std::size_t(3) * v);
  } else {
    round_chord_vertices(keyframe(k), keyframe(k + 1), vertices.data(), vertices.size(), times[k],
                         times[k + 1], t, out, stats);
  }
}

template <class S>
void FlightPlans<S>::evaluate(double t, std::span<const std::uint32_t> vertices, S* out,
                              RoundingStats* stats) const {
  if (vertex_count_ == keyframed_count_) {
    evaluate_keyframed(t, vertices, out, stats);
  } else {
    // Vertices added at run time have no keyframes: only the runs between them are looked up there.
    const auto added = [this](std::uint32_t v) { return v >= keyframed_count_; };
    for (auto begin = vertices.begin(); begin != vertices.end();) {
      const auto end = std::find_if(begin, vertices.end(), added);
      evaluate_keyframed(t, {begin, end}, out, stats);
      begin = std::find_if_not(end, vertices.end(), added);
    }
  }
  if (own_.empty()) return;
  for (std::uint32_t v : vertices)
    if (own_of_vertex_[v] != none)
      for (int axis = 0; axis < 3; ++axis)
        out[std::size_t(3) * v + std::size_t(axis)] =
            round_piece(own_piece(own_[own_of_vertex_[v]], axis, t), t);
}

template <class S>
Piece<S> FlightPlans<S>::piece_after(std::uint32_t vertex, int axis, double t) const {
  if (has_own_plan(vertex)) return own_piece(own_[own_of_vertex_[vertex]], axis, t);
  const auto& times = keyframes_->times;
  const std::size_t k = segment_at(t), at = std::size_t(3) * vertex + std::size_t(axis);
  if (t < times[0]) return {t, times[0], keyframe(0)[at], S(0), PieceKind::ray};
  if (k + 1 == times.size())
    return {times[k], std::numeric_limits<double>::infinity(), keyframe(k)[at], S(0), PieceKind::ray};
  return {times[k], times[k + 1], keyframe(k)[at], keyframe(k + 1)[at], PieceKind::chord};
}

template <class S>
double FlightPlans<S>::piece_end(std::uint32_t vertex, double t) const {
  const auto& times = has_own_plan(vertex) ? own_[own_of_vertex_[vertex]].times : keyframes_->times;
  const auto above = std::upper_bound(times.begin(), times.end(), t);
  return above == times.end() ? std::numeric_limits<double>::infinity() : *above;
}

template <class S>
Piece<S> FlightPlans<S>::own_piece(const OwnPlan& plan, int axis, double t) const {
  const auto above = std::upper_bound(plan.times.begin(), plan.times.end(), t);
  const std::size_t k = above == plan.times.begin() ? 0 : std::size_t(above - plan.times.begin()) - 1;
  const std::size_t at = 3 * k + std::size_t(axis);
  if (k + 1 == plan.times.size())
    return {plan.times[k], std::numeric_limits<double>::infinity(), plan.positions[at], plan.velocity[axis],
            PieceKind::ray};
  return {plan.times[k], plan.times[k + 1], plan.positions[at], plan.positions[at + 3], PieceKind::chord};
}

template <class S>
auto FlightPlans<S>::checked_plan(double t, const PlanChange<S>& change, std::uint32_t vertex,
                                  const S* position) -> OwnPlan {
  if (change.positions.size() != 3 * change.times.size())
    throw std::invalid_argument("plan change with " + std::to_string(change.times.size()) + " knots and " +
                                std::to_string(change.positions.size()) + " coordinates");
  OwnPlan plan{vertex, {t}, {position[0], position[1], position[2]}, {}};
  for (std::size_t k = 0; k < change.times.size(); ++k) {
    if (!std::isfinite(change.times[k]) || !(plan.times.back() < change.times[k]))
      throw std::invalid_argument("knot " + std::to_string(k) + " of a plan change at " + std::to_string(t) +
                                  " has time " + std::to_string(change.times[k]) + ", which does not follow");
    plan.times.push_back(change.times[k]);
    for (int axis = 0; axis < 3; ++axis) {
      const S value = change.positions[3 * k + std::size_t(axis)];
      check_value(value, "coordinate", k + 1, vertex, axis);
      plan.positions.push_back(value == S(0) ? S(0) : value);
    }
  }
  for (int axis = 0; axis < 3; ++axis) {
    check_value(change.velocity[axis], "velocity", change.times.size(), vertex, axis);
    plan.velocity[axis] = change.velocity[axis];
  }
  return plan;
}

template <class S>
void FlightPlans<S>::change(double t, const PlanChange<S>& change, const S* position) {
  if (change.vertex >= vertex_count_)
    throw std::invalid_argument("plan change for vertex " + std::to_string(change.vertex) +
                                " of a body with " + std::to_string(vertex_count_) + " vertices");
  OwnPlan plan = checked_plan(t, change, change.vertex, position);
  if (own_of_vertex_.empty()) own_of_vertex_.assign(vertex_count_, none);
  std::uint32_t& slot = own_of_vertex_[change.vertex];
  if (slot == none) {
    slot = std::uint32_t(own_.size());
    own_.push_back(std::move(plan));
  } else {
    own_[slot] = std::move(plan);
  }
}

template <class S>
void FlightPlans<S>::check_new_vertex(double t, const PlanChange<S>& plan, const S* position,
                                      std::uint32_t vertex) {
  for (int axis = 0; axis < 3; ++axis) check_value(position[axis], "coordinate", 0, vertex, axis);
  checked_plan(t, plan, vertex, position);
}

template <class S>
void FlightPlans<S>::add_vertex(double t, const PlanChange<S>& plan, const S* position) {
  check_new_vertex(t, plan, position, vertex_count_);
  S start[3];
  for (int axis = 0; axis < 3; ++axis) start[axis] = position[axis] == S(0) ? S(0) : position[axis];
  own_of_vertex_.resize(vertex_count_, none);
  own_of_vertex_.push_back(std::uint32_t(own_.size()));
  own_.push_back(checked_plan(t, plan, vertex_count_, start));
  ++vertex_count_;
}

template <class S>
double FlightPlans<S>::speed_bound(double t) const {
  const auto speed = [](const double* step, double seconds) {
    return std::sqrt(step[0] * step[0] + step[1] * step[1] + step[2] * step[2]) / seconds;
  };
  const auto& times = keyframes_->times;
  const std::size_t k = segment_at(t);
  if (k != bounded_segment_) {
    segment_speed_ = 0;
    if (k + 1 < times.size() && t >= times[0])
      for (std::size_t i = 0; i < std::size_t(3) * keyframed_count_; i += 3) {
        double step[3];
        for (std::size_t axis = 0; axis < 3; ++axis)
          step[axis] = double(keyframe(k + 1)[i + axis]) - double(keyframe(k)[i + axis]);
        segment_speed_ = std::max(segment_speed_, speed(step, times[k + 1] - times[k]));
      }
    bounded_segment_ = k;
  }
  double bound = segment_speed_;
  for (const OwnPlan& plan : own_) {
    double step[3], seconds = 1;
    for (int axis = 0; axis < 3; ++axis) {
      const Piece<S> piece = own_piece(plan, axis, t);
      step[axis] = piece.kind == PieceKind::chord ? double(piece.x1) - double(piece.x0) : double(piece.x1);
      if (piece.kind == PieceKind::chord) seconds = piece.t1 - piece.t0;
    }
    bound = std::max(bound, speed(step, seconds));
  }
  return bound * (1 + 1e-12);  // above every rounding of the few operations here
}

template <class S>
std::size_t FlightPlans<S>::bytes() const {
  std::size_t total = keyframes_->times.size() * sizeof(double) + keyframes_->positions.size() * sizeof(S) +
                      own_of_vertex_.size() * sizeof(std::uint32_t) + own_.size() * sizeof(OwnPlan);
  for (const OwnPlan& plan : own_) total += plan.times.size() * (sizeof(double) + 3 * sizeof(S));
  return total;
}

template class FlightPlans<float>;
template class FlightPlans<double>;

}  // namespace kbvh
