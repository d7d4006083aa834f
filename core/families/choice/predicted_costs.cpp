#include "core/families/choice/predicted_costs.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include "core/base/cost_constants.hpp"

namespace kbvh {

using Cost = costs::Choice;

namespace {

/// Returns the cost per frame of building and ageing trees, for the period between builds that minimises it.
/// The surplus of box tests is assumed to grow linearly with age. `build`: the cost of one build.
double upkeep(double build, double ageing) {
  return std::min(build, std::sqrt(2 * build * Cost::surplus_test * ageing));
}
/// Returns the cost of a frame in refitted trees without slabs.
double without_slabs(const Observed& seen) {
  return seen.plain_known ? plain_cost(seen) : refit_cost(seen);
}
/// Returns the cost of a refit's update.
double refit_update(const Observed& seen) {
  return costs::Work::plain.read * seen.reads + costs::Work::body * seen.bodies;
}
double new_search(const Observed& seen) {
  return (1 - seen.aged) * (without_slabs(seen) - refit_update(seen));
}

}  // namespace

std::string last_seen(const Observed& seen) {
  char segments[48] = "one segment", text[160];
  if (std::isfinite(seen.frames_per_segment))
    std::snprintf(segments, sizeof segments, "%.3g frames per segment", seen.frames_per_segment);
  std::snprintf(
      text, sizeof text,
      " (last seen: %s, steps of %.2g leaves, %.2g between candidates, %.0f candidates, plans changed at "
      "%.2g of frames)",
      segments, seen.step, seen.slide, seen.candidates, seen.changes_per_frame);
  return text;
}

double refit_cost(const Observed& seen) {
  return costs::Work::body * seen.bodies +
         costs::Work::slabs.of(seen.reads, seen.slab_tests, seen.candidates);
}

double plain_cost(const Observed& seen) {
  if (!std::isfinite(seen.plain_boxed)) return std::numeric_limits<double>::infinity();
  return costs::Work::body * seen.bodies +
         costs::Work::plain.of(seen.reads, seen.plain_tests, seen.candidates) +
         costs::Work::plain_candidate * (seen.plain_boxed - 1) * std::max(1.0, seen.candidates);
}

double rebuilt_cost(const Observed& seen) {
  return costs::Work::rebuilt_primitive * seen.primitives +
         upkeep(Cost::build_primitive * seen.primitives, seen.ageing) + Cost::built_tests * new_search(seen);
}

double sorted_cost(const Observed& seen) {
  return Cost::sorts * (refit_update(seen) + new_search(seen)) +
         upkeep(Cost::sort_primitive * seen.primitives, seen.sorted_ageing);
}

double drift_cost(const Observed& seen) {
  if (seen.rays_only) return std::numeric_limits<double>::infinity();
  const double watching = Cost::watch_read * seen.reads + Cost::watch_body * seen.bodies;
  if (!seen.near)
    return seen.step < 0.2 ? (1 + Cost::watch_step * seen.step) * watching : Cost::unfit * refit_cost(seen);
  if (seen.spread > 0.02) return Cost::unfit * refit_cost(seen);
  const double frames = seen.step > 0 ? std::min(0.4 / seen.step, 24.0) : 24;
  if (frames < 3) return Cost::unfit * refit_cost(seen);
  const double search = Cost::search_read * seen.reads + Cost::search_candidate * seen.candidates;
  return watching + search / frames + Cost::kept_candidate * seen.boxed * seen.candidates;
}

double join_cost(const Observed& seen) {
  const double l = seen.frames_per_segment, moves = seen.slide * l;
  if (seen.rays_only || seen.changes_per_frame > 0.02 || !(l < 1e6))
    return std::numeric_limits<double>::infinity();
  // Bodies apart: one box at each end, unless the bodies come to meet; over a long distance they may pass
  // through each other.
  if (!seen.near) return seen.apart_factor * Cost::join_apart / l * (1 + moves * moves) * refit_cost(seen);
  const double alike = 1 - seen.spread;
  // Small bodies that move past each other meet further bodies on their way, in addition to their current
  // contacts.
  const double others = seen.many_bodies ? 1 + moves : 1 + Cost::join_moves * moves;
  return seen.join_factor * refit_cost(seen) *
         (Cost::join_frame + Cost::join_segment / (l + Cost::join_frames) * others +
          Cost::join_slide * alike * alike * moves);
}

}  // namespace kbvh
