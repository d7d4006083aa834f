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

/// Thrown when a contestant's own range is exceeded; `what` is the end of a sentence that begins with its id.
struct BeyondContestant : std::invalid_argument {
  BeyondContestant(const std::string& id, const std::string& why)
      : std::invalid_argument("'" + id + "' " + why), clause(why) {}
  std::string clause;
};

std::string vertex_text(std::uint32_t body, std::uint32_t vertex) {
  return "vertex " + std::to_string(vertex) + " of body " + std::to_string(body);
}

}  // namespace

template <class S>
RangeWatch<S>::RangeWatch(const Info& contestant) {
  if (!(contestant.max_coordinate < most_)) return;
  most_ = contestant.max_coordinate;
  contestant_ = contestant.id;
}

template <class S>
void RangeWatch<S>::refuse(const std::string& where) const {
  if (narrow())
    throw BeyondContestant(contestant_, "takes coordinates up to " + number_text(most_) + ", but " + where);
  throw std::invalid_argument(where + ", outside the admissible range (" +
                              (sizeof(S) == 4 ? "8e+30 in float)" : "8e+100 in double)"));
}

/// Returns a time, rounded down, until which a vertex with its own plan stays in the range.
template <class S>
double RangeWatch<S>::stays_until(const FlightPlans<S>& plans, std::uint32_t vertex) const {
  double until = forever;
  for (int axis = 0; axis < 3; ++axis) {
    const Piece<S> line = last_line(plans, vertex, axis);
    const double velocity = double(line.x1), start = double(line.x0);
    if (velocity == 0) continue;
    const double room = most_ - (velocity > 0 ? start : -start);
    const double seconds = std::max(0.0, room) / std::abs(velocity) * (1 - 1e-12);
    until = std::min(until, std::nextafter(line.t0 + seconds, -forever));
  }
  return until;
}

/// Throws for a vertex that is out of the range at t.
template <class S>
void RangeWatch<S>::check_vertex(const FlightPlans<S>& plans, std::uint32_t body, std::uint32_t vertex,
                                 double t) const {
  for (int axis = 0; axis < 3; ++axis) {
    const Piece<S> line = last_line(plans, vertex, axis);
    if (!(line.t0 < t)) continue;
    // Computed in a wider type: the value may be beyond the range of S, and of double.
    const auto x = static_cast<long double>(line.x0) +
                   static_cast<long double>(line.x1) * (static_cast<long double>(t) - line.t0);
    if (std::abs(x) <= static_cast<long double>(most_)) continue;
    const double shown = std::abs(x) < last_double ? double(x) : x > 0 ? forever : -forever;
    refuse(vertex_text(body, vertex) + " is at " + "xyz"[axis] + " = " + number_text(shown) +
           " at t = " + number_text(t) + " s");
  }
}

template <class S>
void RangeWatch<S>::check_point(const S* point, const std::string& what) const {
  for (int axis = 0; axis < 3; ++axis)
    if (std::abs(double(point[axis])) > most_)
      refuse(what + " is at " + "xyz"[axis] + " = " + number_text(double(point[axis])));
}

template <class S>
void RangeWatch<S>::check_positions(std::uint32_t body, std::uint32_t vertices, const S* positions) const {
  for (std::uint32_t v = 0; narrow() && v < vertices; ++v) {
    const S* const point = positions + std::size_t(3) * v;
    for (int axis = 0; axis < 3; ++axis)
      if (std::abs(double(point[axis])) > most_) check_point(point, vertex_text(body, v));
  }
}

template <class S>
void RangeWatch<S>::check_plans(std::span<const PlanChange<S>> changes) const {
  if (!narrow()) return;
  for (const PlanChange<S>& change : changes)
    for (std::size_t k = 0; 3 * k + 2 < change.positions.size(); ++k)
      check_point(&change.positions[3 * k], vertex_text(change.body, change.vertex) + ", at knot " +
                                                std::to_string(k) + " of its new plan,");
}

template <class S>
void RangeWatch<S>::check_added(const GeometryChange<S>& change) const {
  if (!narrow()) return;
  for (std::size_t i = 0; i < change.vertices.size(); ++i) {
    const std::string what = "new vertex " + std::to_string(i);
    check_point(change.vertices[i].position, what);
    const auto& knots = change.vertices[i].plan.positions;
    for (std::size_t k = 0; 3 * k + 2 < knots.size(); ++k)
      check_point(&knots[3 * k], what + ", at knot " + std::to_string(k) + " of its plan,");
  }
}

template <class S>
void RangeWatch<S>::check_probes(const Probes<S>& probes) const {
  if (!narrow()) return;
  if (const auto* rays = std::get_if<RayProbes<S>>(&probes))
    for (std::size_t i = 0; i < rays->size(); ++i) {
      check_point(rays->rays[i].origin, "the origin of ray " + std::to_string(i));
      check_point(rays->rays[i].direction, "the direction of ray " + std::to_string(i));
    }
  if (const auto* balls = std::get_if<BallProbes<S>>(&probes))
    for (std::size_t i = 0; i < balls->size(); ++i)
      check_point(balls->balls[i].centre, "the centre of ball " + std::to_string(i));
}

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
  std::vector<std::uint32_t> next(playback.body_count());  // the new ids come last, in order
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

namespace {

/// Plays the changes of a script until the last frame, under a watch.
template <class S>
void watch_script(const Scene<S>& scene, const PlanScript<S>& script, double last, RangeWatch<S> watch) {
  Playback<S> playback(scene);
  std::optional<ChangingScene<S>> changing;
  if (script.changes_geometry()) changing.emplace(scene);
  watch.start(playback);
  for (const auto& step : script.steps) {
    if (step.time > last) break;
    watch.check(playback, step.time);
    playback.seek(step.time);
    watch.check_plans(step.changes);
    playback.change_plans(step.time, step.changes);
    for (const PlanChange<S>& change : step.changes) watch.changed(playback, change.body, change.vertex);
    if (step.geometry.empty()) continue;
    watch.check_added(step.geometry);
    changing->apply(step.geometry, playback);
    watch.added(playback, changes_of_bodies(scene, step.geometry));
  }
  watch.check(playback, last);
}

}  // namespace

template <class S>
void check_played(const Scene<S>& scene, const PlanScript<S>& script, std::span<const double> frames) {
  if (frames.empty()) return;
  for (std::size_t f = 0; f < frames.size(); ++f) check_time(frames[f], "frame " + std::to_string(f) + " is");
  if (script.empty()) return;  // keyframes, and so all positions between them, are in the range
  watch_script(scene, script, frames.back(), RangeWatch<S>());
}

template <class S>
std::string out_of_range(const Info& contestant, const Scene<S>& scene, const PlanScript<S>& script,
                         std::span<const double> frames) {
  if (!(contestant.max_coordinate < double(admissible_reach<S>)) || frames.empty()) return {};
  try {
    watch_script(scene, script, frames.back(), RangeWatch<S>(contestant));
  } catch (const BeyondContestant& why) {
    return why.clause;
  }
  return {};
}

template <class S>
std::string out_of_range(const Info& contestant, const Probes<S>& probes) {
  try {
    RangeWatch<S>(contestant).check_probes(probes);
  } catch (const BeyondContestant& why) {
    return why.clause;
  }
  return {};
}

#define KBVH_INSTANTIATE(S)                                                                   \
  template class RangeWatch<S>;                                                               \
  template void check_played(const Scene<S>&, const PlanScript<S>&, std::span<const double>); \
  template std::string out_of_range(const Info&, const Scene<S>&, const PlanScript<S>&,       \
                                    std::span<const double>);                                 \
  template std::string out_of_range(const Info&, const Probes<S>&);
KBVH_INSTANTIATE(float)
KBVH_INSTANTIATE(double)
#undef KBVH_INSTANTIATE

}  // namespace kbvh
