#include "core/families/choice/choice_candidates.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace kbvh {
namespace {

using Costs = ChoiceCandidate::Costs;
using Prediction = ChoiceCandidate::Prediction;

double update(const Observed& seen, const Costs& costs) {
  return costs.frame + costs.body * seen.bodies + costs.read * seen.reads;
}
/// The same trees without slabs: fewer comparisons, more candidates.
Prediction boxes(const Observed& seen, const Costs& costs) {
  return {update(seen, costs) + seen.search, update(seen, costs) + 0.8 * seen.search};
}
/// New trees, whose boxes have the surfaces of the start.
Prediction new_trees(const Observed& seen, const Costs& costs) {
  const double work = update(seen, costs) + 1.3 * seen.search / seen.growth +
                      upkeep(costs.build * seen.primitives, seen.ageing);
  return {work, work};
}
/// Bodies that are apart are only watched. Where they meet, more pairs come near in the frames that one
/// search serves than a query takes to find.
Prediction drift(const Observed& seen, const Costs& costs) {
  const double work = seen.candidates == 0 ? update(seen, costs) : 1.5 * seen.refit;
  return {work, work};
}
/// One search serves a segment; its boxes contain the motion of several frames.
Prediction join(const Observed& seen, const Costs& /*costs*/) {
  const double apart = 1.5 / seen.frames * seen.refit, near = (0.12 + 5 / (seen.frames + 1)) * seen.refit;
  return seen.candidates == 0 ? Prediction{apart, apart} : Prediction{near, 0.5 * near};
}

}  // namespace

const std::vector<ChoiceCandidate>& choice_candidates() {
  using enum ChoiceUnit;
  // Fitted to the times of eleven small scenes at l = 1 and 7, on one core of a busy AMD EPYC (AVX-512): fox
  // running, tablecloth, running figures, mixing swarms, passing spheres, waving sheet, shirt, robot falling,
  // mannequin punching, flowing soup, sheet over box. The sums differ from the times by 15 %, root mean
  // square. Builds and starts: from plan `auto` at 42dc54a and 19cb3bc. The first is the refit.
  // clang-format off
  static const std::vector<ChoiceCandidate> list{
      //                                      frame body read   box  cand. span tri. build cold
      {"leaf_slabs",    {},         frame,   {1500, 100, 0.6,  1.05,   15,   0,   0,    0,   0}, nullptr},
      {"bottom_up",     {},         frame,   {1200, 100, 0.4,  1.08, 13.2,   0,   0,    0,  10}, &boxes},
      {"lbvh_drift",    {},         frame,   {1500, 100, 4.2,  0.9,    17,   0,   0,    9,  45}, &new_trees},
      {"drift_rebuild", {{"start", "sorted"}},
                                    frame,   {1300, 100, 0.45, 1.1,  13.5,   0,   0,   70,  45}, &new_trees},
      {"drift_boxes",   {},         frames,  {2500, 140, 0.3,  1.25,   18,   0,   0,    0, 100}, &drift},
      {"interval_join", {},         segment, {1000,   0, 3.3,  3.7,     0,  45,  61,    0,  30}, &join},
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
