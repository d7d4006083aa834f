#include "core/families/choice/choice_candidates.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace kbvh {
namespace {

using Costs = ChoiceCandidate::Costs;
using Prediction = ChoiceCandidate::Prediction;

double update(const Observed& seen, const Costs& costs) {
  return costs.read * seen.reads + costs.body * seen.bodies;
}
/// The same trees without slabs: fewer comparisons, more candidates.
Prediction boxes(const Observed& seen, const Costs& costs) {
  return {update(seen, costs) + 0.95 * seen.search, update(seen, costs) + 0.6 * seen.search};
}
/// New trees, whose boxes have the surfaces of the start.
Prediction new_trees(const Observed& seen, const Costs& costs) {
  const double work = 1.05 * update(seen, costs) + 1.05 * seen.search / seen.growth +
                      upkeep(costs.build * seen.primitives, seen.ageing);
  return {work, work};
}
/// Bodies that are apart are only watched. Where bodies deform, more pairs come near in the frames that one
/// search serves than a query takes to find.
Prediction drift(const Observed& seen, const Costs& costs) {
  const double watch = update(seen, costs);
  if (seen.candidates == 0) return {watch, watch};
  const double work = seen.translates ? watch + 0.6 * seen.search : 1.5 * seen.refit;
  return {work, work};
}
/// One search serves a segment; its boxes contain the motion of several frames.
Prediction join(const Observed& seen, const Costs& /*costs*/) {
  const double share = seen.candidates == 0 ? 1.5 / seen.frames : 0.12 + 5 / (seen.frames + 1);
  return {share * seen.refit, 0.5 * share * seen.refit};
}

}  // namespace

const std::vector<ChoiceCandidate>& choice_candidates() {
  using enum ChoiceUnit;
  // The first is the refit with which others are compared.
  // clang-format off
  static const std::vector<ChoiceCandidate> list{
      //                                       read body  box  cand. span  tri. fetch build start
      {"leaf_slabs",    {},         frame,   {0.45, 100, 1.65,   18,   0,   0,   0,    0,   2}, nullptr},
      {"bottom_up",     {},         frame,   {0.45, 100, 1.1,    13,   0,   0,   0,    0,   2}, &boxes},
      {"lbvh_drift",    {},         frame,   {1.5,  100, 0.9,    13,   0,   0,   0,    9,  20}, &new_trees},
      {"drift_rebuild", {{"start", "sorted"}},
                                    frame,   {0.5,  100, 0.9,    13,   0,   0,   0,   70,  75}, &new_trees},
      {"drift_boxes",   {},         frames,  {0.2,  140, 1.1,    22,   0,   0,   0,    0,   3}, &drift},
      {"interval_join", {},         segment, {3.05,   0, 2.42,    0,  92,  64, 3.3,    0,   0}, &join},
  };
  // clang-format on
  return list;
}

double upkeep(double build, double ageing) {
  return std::min(build, std::sqrt(2 * build * ageing));
}

std::string last_seen(const Observed& seen) {
  char segments[48] = "one segment", text[200];
  if (std::isfinite(seen.frames))
    std::snprintf(segments, sizeof segments, "%.3g frames per segment", seen.frames);
  std::snprintf(
      text, sizeof text,
      " (last seen: %s, %.0f candidates, boxes %.3g times their first surface, plans changed at %.2g "
      "of frames)",
      segments, seen.candidates, seen.growth, seen.changes_per_frame);
  return text;
}

}  // namespace kbvh
