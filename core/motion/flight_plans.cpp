#include "core/motion/flight_plans.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "core/motion/admissible.hpp"
#include "core/motion/error_free.hpp"
#include "core/motion/round_curve.hpp"

namespace kbvh {

namespace {
template <class S>
void check_value(S value, const char* what, std::size_t keyframe, std::size_t vertex, int axis) {
  if (std::isfinite(value) && std::abs(value) <= admissible_magnitude<S>) return;
  throw std::invalid_argument(std::string(what) + " of vertex " + std::to_string(vertex) + ", axis " +
                              "xyz"[axis] + ", at knot " + std::to_string(keyframe) + " is " +
                              number_text(double(value)) + ", outside the admissible range (" +
                              admissible_text<S>() + ")");
}

/// Checks the curves of all segments, and removes lists of zeros.
template <class S>
void check_bends(std::size_t segments, std::uint32_t vertex_count, std::vector<SegmentBends<S>>& bends) {
  if (bends.empty()) return;
  if (bends.size() != segments)
    throw std::invalid_argument("expected the curves of " + std::to_string(segments) + " segments, got " +
                                std::to_string(bends.size()));
  const std::size_t scalars = std::size_t(3) * vertex_count;
  for (std::size_t k = 0; k < segments; ++k)
    for (std::vector<S>* values : {&bends[k].twist, &bends[k].bend}) {
      if (!values->empty() && values->size() != scalars)
        throw std::invalid_argument("expected " + std::to_string(scalars) +
                                    " numbers for the curves of segment " + std::to_string(k) + ", got " +
                                    std::to_string(values->size()));
      bool zero = true;
      for (std::size_t i = 0; i < values->size(); ++i) {
        S& value = (*values)[i];
        check_value(value, values == &bends[k].bend ? "bend" : "twist", k, i / 3, int(i % 3));
        if (value == S(0)) value = S(0);
        zero = zero && value == S(0);
      }
      if (zero) values->clear();
      if (values == &bends[k].bend && values->empty() && !bends[k].twist.empty())
        values->assign(scalars, S(0));
    }
  if (std::all_of(bends.begin(), bends.end(), [](const auto& segment) { return segment.bend.empty(); }))
    bends.clear();
}

[[noreturn]] void refuse_change_of_curves() {
  throw std::invalid_argument("plans of a body whose vertices move on curves cannot change");
}
}  // namespace

template <class S>
FlightPlans<S>::FlightPlans(std::uint32_t vertex_count, std::vector<double> times, std::vector<S> positions,
                            std::vector<SegmentBends<S>> bends)
    : vertex_count_(vertex_count), keyframed_count_(vertex_count) {
  if (times.empty()) throw std::invalid_argument("flight plans need at least one keyframe");
  for (std::size_t k = 0; k < times.size(); ++k) {
    check_time(times[k], "keyframe " + std::to_string(k) + " is");
    if (k > 0 && !(times[k - 1] < times[k]))
      throw std::invalid_argument("keyframe times must increase: keyframe " + std::to_string(k) + " at " +
                                  number_text(times[k]) + " follows " + number_text(times[k - 1]));
  }
  if (positions.size() != std::size_t(3) * vertex_count * times.size())
    throw std::invalid_argument("expected " + std::to_string(std::size_t(3) * vertex_count * times.size()) +
                                " coordinates for the keyframes, got " + std::to_string(positions.size()));
  for (std::size_t i = 0; i < positions.size(); ++i) {
    const std::size_t point = i / 3;
    check_value(positions[i], "coordinate", point / vertex_count, point % vertex_count, int(i % 3));
    if (positions[i] == S(0)) positions[i] = S(0);  // truth B holds no negative zero
  }
  check_bends(times.size() - 1, vertex_count, bends);
  // Not at the first request: plans are restored for every play, and frames allocate nothing.
  longest_steps_.assign(times.size(), -1.0);
  translations_.resize(times.size());
  positions.push_back(S(0));  // readers may load four scalars
  keyframes_ =
      std::make_shared<const Keyframes>(Keyframes{std::move(times), std::move(positions), std::move(bends)});
}

template <class S>
CurvedPiece<S> FlightPlans<S>::curved_piece(std::uint32_t vertex, int axis, std::size_t k) const {
  const std::size_t at = std::size_t(3) * vertex + std::size_t(axis);
  const S *const bend = curved() ? bends(k) : nullptr, *const twist = curved() ? twists(k) : nullptr;
  return {keyframes_->times[k], keyframes_->times[k + 1],          keyframe(k)[at],
          keyframe(k + 1)[at],  bend == nullptr ? S(0) : bend[at], twist == nullptr ? S(0) : twist[at]};
}

template <class S>
std::size_t FlightPlans<S>::segment_at(double t) const {
  const auto& times = keyframes_->times;
  const auto above = std::upper_bound(times.begin(), times.end(), t);
  return above == times.begin() ? 0 : std::size_t(above - times.begin()) - 1;
}

template <class S>
void FlightPlans<S>::evaluate(double t, S* out) const {
  evaluate_keyframed(t, 0, keyframed_count_, out);
  evaluate_own_plans(t, 0, 1, out);
}

template <class S>
void FlightPlans<S>::evaluate_keyframed(double t, std::uint32_t begin, std::uint32_t end, S* out) const {
  const auto& times = keyframes_->times;
  const std::size_t k = segment_at(t), first = std::size_t(3) * begin,
                    scalars = std::size_t(3) * (end - begin);
  if (t <= times[k] || k + 1 == times.size())
    std::copy_n(keyframe(k) + first, scalars, out + first);
  else if (curved_in(k))
    round_curve(keyframe(k) + first, keyframe(k + 1) + first, bends(k) + first,
                twists(k) == nullptr ? nullptr : twists(k) + first, scalars, times[k], times[k + 1], t,
                out + first);
  else
    round_chord(keyframe(k) + first, keyframe(k + 1) + first, scalars, times[k], times[k + 1], t,
                out + first);
}

template <class S>
void FlightPlans<S>::evaluate_own_plans(double t, std::size_t part, std::size_t parts, S* out) const {
  const auto cut = [parts](std::size_t count, std::size_t which) { return count * which / parts; };
  for (std::size_t i = cut(own_plans_.size(), part); i < cut(own_plans_.size(), part + 1); ++i) {
    const OwnPlan& plan = own_plans_[i];
    for (int axis = 0; plan.group == none && axis < 3; ++axis)
      out[3 * std::size_t(plan.vertex) + std::size_t(axis)] = round_piece(own_piece(plan, axis, t), t);
  }
  constexpr std::size_t block = 128;  // vertices
  S positions[3 * block];
  for (const Rays& rays : rays_) {
    const std::size_t end = cut(rays.vertices.size(), part + 1);
    for (std::size_t first = cut(rays.vertices.size(), part); first < end; first += block) {
      const std::size_t count = std::min(block, end - first);
      round_ray(rays.origins.data() + 3 * first, rays.velocities.data() + 3 * first, 3 * count, rays.t0, t,
                positions);
      for (std::size_t i = 0; i < count; ++i)
        std::copy_n(positions + 3 * i, 3, out + std::size_t(3) * rays.vertices[first + i]);
    }
  }
}

template <class S>
void FlightPlans<S>::join_rays(OwnPlan& plan) {
  if (plan.times.size() > 1) return;
  // Changes of one time come together: the newest group is nearly always the right one.
  auto rays = std::find_if(rays_.rbegin(), rays_.rend(),
                           [&](const Rays& group) { return group.t0 == plan.times[0]; });
  if (rays == rays_.rend()) {
    rays_.push_back({plan.times[0], {}, {}, {}});
    rays = rays_.rbegin();
  }
  plan.group = std::uint32_t(rays_.rend() - rays - 1);
  plan.place = std::uint32_t(rays->vertices.size());
  rays->vertices.push_back(plan.vertex);
  rays->origins.insert(rays->origins.end(), plan.positions.begin(), plan.positions.end());
  rays->velocities.insert(rays->velocities.end(), plan.velocity, plan.velocity + 3);
}

template <class S>
void FlightPlans<S>::leave_rays(const OwnPlan& plan) {
  if (plan.group == none) return;
  Rays& rays = rays_[plan.group];
  const std::size_t last = rays.vertices.size() - 1;
  own_plans_[own_of_vertex_[rays.vertices[last]]].place = plan.place;
  rays.vertices[plan.place] = rays.vertices[last];
  for (std::vector<S>* values : {&rays.origins, &rays.velocities}) {
    std::copy_n(values->begin() + std::ptrdiff_t(3 * last), 3,
                values->begin() + std::ptrdiff_t(3) * plan.place);
    values->resize(3 * last);
  }
  rays.vertices.pop_back();
  if (!rays.vertices.empty()) return;
  const std::uint32_t group = plan.group;
  for (const std::uint32_t vertex : rays_.back().vertices) own_plans_[own_of_vertex_[vertex]].group = group;
  if (group + 1 < rays_.size()) rays_[group] = std::move(rays_.back());
  rays_.pop_back();
}

template <class S>
void FlightPlans<S>::evaluate_listed(double t, std::span<const std::uint32_t> vertices, S* out) const {
  const auto& times = keyframes_->times;
  const std::size_t k = segment_at(t);
  if (t <= times[k] || k + 1 == times.size()) {
    for (std::uint32_t v : vertices)
      std::copy_n(keyframe(k) + std::size_t(3) * v, 3, out + std::size_t(3) * v);
  } else if (curved_in(k)) {
    round_curve_vertices(keyframe(k), keyframe(k + 1), bends(k), twists(k), vertices.data(), vertices.size(),
                         times[k], times[k + 1], t, out);
  } else {
    round_chord_vertices(keyframe(k), keyframe(k + 1), vertices.data(), vertices.size(), times[k],
                         times[k + 1], t, out);
  }
}

template <class S>
void FlightPlans<S>::evaluate(double t, std::span<const std::uint32_t> vertices, S* out) const {
  if (vertex_count_ == keyframed_count_) {
    evaluate_listed(t, vertices, out);
  } else {
    // Vertices added at run time have no keyframes: only the runs between them are looked up there.
    const auto added = [this](std::uint32_t v) { return v >= keyframed_count_; };
    for (auto begin = vertices.begin(); begin != vertices.end();) {
      const auto end = std::find_if(begin, vertices.end(), added);
      evaluate_listed(t, {begin, end}, out);
      begin = std::find_if_not(end, vertices.end(), added);
    }
  }
  if (own_plans_.empty()) return;
  for (std::uint32_t v : vertices)
    if (own_of_vertex_[v] != none)
      for (int axis = 0; axis < 3; ++axis)
        out[std::size_t(3) * v + std::size_t(axis)] =
            round_piece(own_piece(own_plans_[own_of_vertex_[v]], axis, t), t);
}

template <class S>
Piece<S> FlightPlans<S>::piece_after(std::uint32_t vertex, int axis, double t) const {
  if (has_own_plan(vertex)) return own_piece(own_plans_[own_of_vertex_[vertex]], axis, t);
  const auto& times = keyframes_->times;
  const std::size_t k = segment_at(t), at = std::size_t(3) * vertex + std::size_t(axis);
  if (t < times[0]) return {t, times[0], keyframe(0)[at], S(0), PieceKind::ray};
  if (k + 1 == times.size())
    return {times[k], std::numeric_limits<double>::infinity(), keyframe(k)[at], S(0), PieceKind::ray};
  if (curved_in(k)) throw std::logic_error("a linear piece is asked for where vertices move on curves");
  return {times[k], times[k + 1], keyframe(k)[at], keyframe(k + 1)[at], PieceKind::chord};
}

template <class S>
double FlightPlans<S>::piece_end(std::uint32_t vertex, double t) const {
  const auto& times = has_own_plan(vertex) ? own_plans_[own_of_vertex_[vertex]].times : keyframes_->times;
  const auto above = std::upper_bound(times.begin(), times.end(), t);
  return above == times.end() ? std::numeric_limits<double>::infinity() : *above;
}

template <class S>
double FlightPlans<S>::lines_begin(double t) const {
  const auto& times = keyframes_->times;
  double begin =
      !has_knots() || t < times[0] ? -std::numeric_limits<double>::infinity() : times[segment_at(t)];
  // Plans without a further knot are known by their groups, of which there are far fewer.
  std::size_t on_rays = 0;
  for (const Rays& rays : rays_) {
    on_rays += rays.vertices.size();
    if (rays.t0 <= t) begin = std::max(begin, rays.t0);
  }
  if (on_rays == own_plans_.size()) return begin;
  for (const OwnPlan& plan : own_plans_) {
    if (plan.group != none) continue;
    const auto above = std::upper_bound(plan.times.begin(), plan.times.end(), t);
    if (above != plan.times.begin()) begin = std::max(begin, *(above - 1));
  }
  return begin;
}

template <class S>
double FlightPlans<S>::lines_end(double t) const {
  const auto& times = keyframes_->times;
  const auto above = has_knots() ? std::upper_bound(times.begin(), times.end(), t) : times.end();
  double end = above == times.end() ? std::numeric_limits<double>::infinity() : *above;
  std::size_t on_rays = 0;
  for (const Rays& rays : rays_) {
    on_rays += rays.vertices.size();
    if (t < rays.t0) end = std::min(end, rays.t0);
  }
  if (on_rays == own_plans_.size()) return end;
  for (const OwnPlan& plan : own_plans_)
    if (plan.group == none) end = std::min(end, piece_end(plan.vertex, t));
  return end;
}

template <class S>
bool FlightPlans<S>::at_rest(double t) const {
  const auto& times = keyframes_->times;
  return !handed_in_ && own_plans_.empty() && (!has_knots() || t < times.front() || t >= times.back());
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
void FlightPlans<S>::check_vertex(std::uint32_t vertex) const {
  if (vertex >= vertex_count_)
    throw std::invalid_argument("plan change for vertex " + std::to_string(vertex) + " of a body with " +
                                std::to_string(vertex_count_) + " vertices");
}

template <class S>
void FlightPlans<S>::check_plan(double t, const PlanChange<S>& change, std::uint32_t vertex,
                                const S* position) {
  check_time(t, "plan change");
  if (change.positions.size() != 3 * change.times.size())
    throw std::invalid_argument("plan change with " + std::to_string(change.times.size()) + " knots and " +
                                std::to_string(change.positions.size()) + " coordinates");
  for (int axis = 0; axis < 3; ++axis) {
    check_value(position[axis], "coordinate", 0, vertex, axis);
    check_value(change.velocity[axis], "velocity", change.times.size(), vertex, axis);
  }
  double before = t;
  for (std::size_t k = 0; k < change.times.size(); ++k) {
    check_time(change.times[k],
               "knot " + std::to_string(k) + " of the plan of vertex " + std::to_string(vertex) + " is");
    if (!(before < change.times[k]))
      throw std::invalid_argument("knot " + std::to_string(k) + " of a plan change at " + number_text(t) +
                                  " has time " + number_text(change.times[k]) + ", which does not follow");
    before = change.times[k];
    for (int axis = 0; axis < 3; ++axis)
      check_value(change.positions[3 * k + std::size_t(axis)], "coordinate", k + 1, vertex, axis);
  }
}

template <class S>
void FlightPlans<S>::check_change(double t, const PlanChange<S>& change, const S* position) const {
  check_vertex(change.vertex);
  if (curved()) refuse_change_of_curves();
  check_plan(t, change, change.vertex, position);
}

template <class S>
auto FlightPlans<S>::own_plan(double t, const PlanChange<S>& change, std::uint32_t vertex, const S* position)
    -> OwnPlan {
  const auto without_sign = [](S value) { return value == S(0) ? S(0) : value; };
  OwnPlan plan;
  plan.vertex = vertex;
  plan.times = {t};
  plan.times.insert(plan.times.end(), change.times.begin(), change.times.end());
  for (int axis = 0; axis < 3; ++axis) plan.positions.push_back(without_sign(position[axis]));
  for (const S value : change.positions) plan.positions.push_back(without_sign(value));
  std::copy_n(change.velocity, 3, plan.velocity);
  return plan;
}

template <class S>
void FlightPlans<S>::change(double t, const PlanChange<S>& change, const S* position) {
  check_change(t, change, position);
  OwnPlan plan = own_plan(t, change, change.vertex, position);
  own_speed_until_ = own_speed_from_;  // forces recomputation
  if (own_of_vertex_.empty()) own_of_vertex_.assign(vertex_count_, none);
  std::uint32_t& slot = own_of_vertex_[change.vertex];
  if (slot == none) {
    slot = std::uint32_t(own_plans_.size());
    own_plans_.push_back(std::move(plan));
  } else {
    leave_rays(own_plans_[slot]);
    own_plans_[slot] = std::move(plan);
  }
  join_rays(own_plans_[slot]);
}

template <class S>
void FlightPlans<S>::check_new_vertex(double t, const PlanChange<S>& plan, const S* position,
                                      std::uint32_t vertex) {
  check_plan(t, plan, vertex, position);
}

template <class S>
void FlightPlans<S>::add_vertex(double t, const PlanChange<S>& plan, const S* position) {
  if (curved()) refuse_change_of_curves();
  check_plan(t, plan, vertex_count_, position);
  own_speed_until_ = own_speed_from_;  // forces recomputation
  own_of_vertex_.resize(vertex_count_, none);
  own_of_vertex_.push_back(std::uint32_t(own_plans_.size()));
  own_plans_.push_back(own_plan(t, plan, vertex_count_, position));
  ++vertex_count_;
  join_rays(own_plans_.back());
}

template <class S>
std::size_t FlightPlans<S>::bytes() const {
  std::size_t total = keyframes_->times.size() * sizeof(double) + keyframes_->positions.size() * sizeof(S) +
                      longest_steps_.size() * sizeof(double) +
                      translations_.size() * sizeof(translations_[0]) +
                      own_of_vertex_.size() * sizeof(std::uint32_t) + own_plans_.size() * sizeof(OwnPlan);
  for (const SegmentBends<S>& segment : keyframes_->bends)
    total += sizeof segment + (segment.bend.size() + segment.twist.size()) * sizeof(S);
  for (const OwnPlan& plan : own_plans_) total += plan.times.size() * (sizeof(double) + 3 * sizeof(S));
  for (const Rays& rays : rays_)
    total += sizeof(Rays) + rays.vertices.size() * (sizeof(std::uint32_t) + 6 * sizeof(S));
  return total;
}

template class FlightPlans<float>;
template class FlightPlans<double>;

}  // namespace kbvh
