#include "core/judge/range_watch.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

namespace kbvh {

namespace {

constexpr double forever = std::numeric_limits<double>::infinity();
constexpr double last_double = std::numeric_limits<double>::max();

/// Returns the last line of a vertex's own plan along an axis.
template <class S>
Piece<S> last_line(const FlightPlans<S>& plans, std::uint32_t vertex, int axis) {
  return plans.piece_after(vertex, axis, last_double);
}

/// Returns a time, rounded down, until which a vertex with its own plan stays in the range.
template <class S>
double stays_until(const FlightPlans<S>& plans, std::uint32_t vertex) {
  double until = forever;
  for (int axis = 0; axis < 3; ++axis) {
    const Piece<S> line = last_line(plans, vertex, axis);
    const double velocity = double(line.x1), start = double(line.x0);
    if (velocity == 0) continue;
    const double room = double(admissible_reach<S>) - (velocity > 0 ? start : -start);
    const double seconds = std::max(0.0, room) / std::abs(velocity) * (1 - 1e-12);
    until = std::min(until, std::nextafter(line.t0 + seconds, -forever));
  }
  return until;
}

/// Throws if the vertex is out of the range at t.
template <class S>
void check_vertex(const FlightPlans<S>& plans, std::uint32_t body, std::uint32_t vertex, double t) {
  for (int axis = 0; axis < 3; ++axis) {
    const Piece<S> line = last_line(plans, vertex, axis);
    if (!(line.t0 < t)) continue;
    // Computed in a wider type: the value may be beyond the range of S, and of double.
    const auto x = static_cast<long double>(line.x0) +
                   static_cast<long double>(line.x1) * (static_cast<long double>(t) - line.t0);
    if (std::abs(x) <= static_cast<long double>(admissible_reach<S>)) continue;
    const double shown = std::abs(x) < last_double ? double(x) : x > 0 ? forever : -forever;
    throw std::invalid_argument("vertex " + std::to_string(vertex) + " of body " + std::to_string(body) +
                                " is at " + "xyz"[axis] + " = " + number_text(shown) +
                                " at t = " + number_text(t) + " s, outside the admissible range (" +
                                (sizeof(S) == 4 ? "8e+30 in float)" : "8e+100 in double)"));
  }
}

}  // namespace

template <class S>
void RangeWatch<S>::start(const Playback<S>& playback) {
  safe_until_ = forever;
  for (std::uint32_t body = 0; body < playback.body_count(); ++body) {
    const FlightPlans<S>& plans = playback.plans(body);
    for (std::uint32_t v = 0; plans.has_own_plans() && v < plans.vertex_count(); ++v)
      if (plans.has_own_plan(v)) safe_until_ = std::min(safe_until_, stays_until(plans, v));
  }
}

template <class S>
void RangeWatch<S>::changed(const Playback<S>& playback, std::uint32_t body, std::uint32_t vertex) {
  safe_until_ = std::min(safe_until_, stays_until(playback.plans(body), vertex));
}

template <class S>
void RangeWatch<S>::added(const Playback<S>& playback, const GeometryChange<S>& change) {
  std::vector<std::uint32_t> next(playback.body_count());  // the last ids are the new ones, in order
  for (std::uint32_t body = 0; body < playback.body_count(); ++body)
    next[body] = playback.plans(body).vertex_count();
  for (const auto& vertex : change.vertices) --next[vertex.body];
  for (const auto& vertex : change.vertices) changed(playback, vertex.body, next[vertex.body]++);
}

template <class S>
void RangeWatch<S>::check(const Playback<S>& playback, double t) {
  if (t <= safe_until_) return;
  start(playback);
  if (t <= safe_until_) return;
  for (std::uint32_t body = 0; body < playback.body_count(); ++body) {
    const FlightPlans<S>& plans = playback.plans(body);
    for (std::uint32_t v = 0; plans.has_own_plans() && v < plans.vertex_count(); ++v)
      if (plans.has_own_plan(v)) check_vertex(plans, body, v, t);
  }
}

template <class S>
void check_played(const Scene<S>& scene, const PlanScript<S>& script, std::span<const double> frames) {
  if (frames.empty()) return;
  for (std::size_t f = 0; f < frames.size(); ++f) check_time(frames[f], "frame " + std::to_string(f) + " is");
  if (script.empty()) return;  // keyframes are in the range, and so are all positions between them
  Playback<S> playback(scene);
  std::optional<ChangingScene<S>> changing;
  if (script.changes_geometry()) changing.emplace(scene);
  RangeWatch<S> watch;
  watch.start(playback);
  for (const auto& step : script.steps) {
    if (step.time > frames.back()) break;
    watch.check(playback, step.time);
    playback.seek(step.time);
    playback.change_plans(step.time, step.changes);
    for (const PlanChange<S>& change : step.changes) watch.changed(playback, change.body, change.vertex);
    if (step.geometry.empty()) continue;
    changing->apply(step.geometry, playback);
    watch.added(playback, step.geometry);
  }
  watch.check(playback, frames.back());
}

#define KBVH_INSTANTIATE(S)     \
  template class RangeWatch<S>; \
  template void check_played(const Scene<S>&, const PlanScript<S>&, std::span<const double>);
KBVH_INSTANTIATE(float)
KBVH_INSTANTIATE(double)
#undef KBVH_INSTANTIATE

}  // namespace kbvh
