#include "core/families/choice/predicted_costs.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/base/cost_constants.hpp"

namespace kbvh {

using Cost = costs::Choice;

double refit_cost(const Observed& seen) {
  return Cost::refit_read * seen.reads + Cost::refit_candidate * seen.candidates +
         Cost::box_test * seen.surplus;
}

double plain_cost(const Observed& seen) {
  if (!std::isfinite(seen.plain_boxed)) return std::numeric_limits<double>::infinity();
  // What slabs cost and save, as a share of the frame; the sum is closer to measured times than refit_cost,
  // to which the other predictions are fitted.
  const double candidates = std::max(1.0, seen.candidates);
  const double slabs = Cost::slabs_leave * seen.slabs_leave - Cost::slabs_separate * seen.slabs_separate;
  const double frame = Cost::refit_read * seen.reads + Cost::box_test * seen.slab_tests +
                       Cost::slab_candidate * candidates + Cost::slabs_leave * seen.slabs_leave;
  const double gain = slabs - Cost::plain_candidate * (seen.plain_boxed - 1) * candidates;
  return frame > 0 ? refit_cost(seen) * (1 - gain / frame) : refit_cost(seen);
}

double rebuilt_cost(const Observed& seen) {
  const double build = Cost::build_read * seen.reads;
  // The period at which builds and surplus tests cost the least together, for a surplus that grows linearly.
  const double upkeep = std::min(build, std::sqrt(2 * build * Cost::box_test * seen.ageing));
  return Cost::rebuilt_read * seen.reads + Cost::refit_candidate * seen.boxed * seen.candidates + upkeep;
}

double drift_cost(const Observed& seen) {
  const double watching = Cost::watch_read * seen.reads;
  if (!seen.near) return seen.step < 0.2 ? 0.5 * watching : Cost::unfit * refit_cost(seen);
  if (seen.spread > 0.02) return Cost::unfit * refit_cost(seen);
  const double frames = seen.step > 0 ? std::min(0.4 / seen.step, 24.0) : 24;
  if (frames < 3) return Cost::unfit * refit_cost(seen);
  const double search = Cost::search_read * seen.reads + Cost::search_candidate * seen.candidates;
  return watching + search / frames + Cost::kept_candidate * seen.candidates;
}

double join_cost(const Observed& seen) {
  const double l = seen.frames_per_segment, moves = seen.slide * l;
  if (seen.changes_per_frame > 0.02 || !(l < 1e6)) return std::numeric_limits<double>::infinity();
  // In young trees a join makes fewer tests than a refit reads vertices.
  const double least = seen.join_tests > seen.reads ? Cost::join_box_test * seen.join_tests : 0;
  // Bodies apart: one box at each end, unless they come to meet; over a long distance they may pass through
  // each other.
  if (!seen.near) return std::max(least, Cost::join_apart / l * (1 + moves * moves) * refit_cost(seen));
  const double alike = 1 - seen.spread;
  // Small bodies that move past each other meet further bodies on their way, in addition to their current
  // contacts.
  const double others = seen.many_bodies ? 1 + moves : 1 + Cost::join_moves * moves;
  return std::max(
      least, refit_cost(seen) * ((Cost::join_frame + Cost::join_segment / (l + Cost::join_frames) * others) *
                                     (1 + Cost::join_undecided * seen.undecided) +
                                 Cost::join_slide * alike * alike * moves));
}

}  // namespace kbvh
