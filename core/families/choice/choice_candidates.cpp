#include "core/families/choice/choice_candidates.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace kbvh {
namespace {

using Prediction = ChoiceCandidate::Prediction;

/// Returns the work of a frame with a search of its own. `tests` and `pairs`: box tests and candidates over
/// those of leaf_slabs.
double searching(const Observed& seen, const ChoiceCandidate& own, double tests, double pairs) {
  return own.update(seen) + own.box_test * tests * seen.box_tests + own.pair * pairs * seen.pairs;
}
Prediction slabs(const Observed& seen, const ChoiceCandidate& /*own*/) {
  return {seen.refit, 0.5 * seen.refit};
}
/// The same trees without slabs: usually 1.1 times the box tests, and twice the candidates.
Prediction boxes(const Observed& seen, const ChoiceCandidate& own) {
  return {searching(seen, own, 1.1, 2), searching(seen, own, 0.55, 1.8)};
}
/// New trees, without slabs: the candidates are those of boxes in any tree. The probability that two boxes
/// meet grows with the volume of their sum.
Prediction new_trees(const Observed& seen, const ChoiceCandidate& own) {
  const double tests = 1.6 / (seen.growth * std::sqrt(seen.growth)),
               work = searching(seen, own, tests, 2) + upkeep(own.build * seen.primitives, seen.ageing);
  return {work, work};
}
/// One search serves several frames if bodies move as a whole; otherwise more pairs come near in these frames
/// than a query takes to find.
Prediction drifting(const Observed& seen, const ChoiceCandidate& /*own*/) {
  return {1.2 * seen.refit, (seen.translates ? 0.5 : 1.2) * seen.refit};
}
/// One search serves a segment, with fewer box tests than a refit's; but it finds the pairs that are near at
/// any time of the segment, and decides each of them. Fitted to the same cells as the prices, which take 0.5
/// to 1.9 times as long, and up to five times where bodies pass each other.
Prediction join(const Observed& seen, const ChoiceCandidate& own) {
  const double search = own.update(seen) - own.frame + 0.45 * own.box_test * seen.box_tests,
               work = own.frame + search / seen.frames + (11.5 + 33 / seen.frames) * seen.pairs;
  return {work, 0.6 * work};
}

}  // namespace

const std::vector<ChoiceCandidate>& choice_candidates() {
  using enum ChoiceUnit;
  // Fitted to the times of each fixed candidate on 16 scenes of 4,000 to 8,000 triangles at l = 1 and 7 or 10
  // (one core of an AMD EPYC, AVX-512; update, search and triangle tests without motion): on these 32 cells,
  // work by the table differs from the time by 6 to 15 % (root mean square), and its least entry is at worst
  // 2 % slower than the best candidate. Pairs that a join lists, and pairs of leaves that slabs compare, are
  // no columns: box tests stand for both, and the fit gave the second a price of 0. drift_rebuild has the
  // prices of bottom_up. A build sorts by keys (9 ns a primitive and level of its radix sort) or by medians.
  // clang-format off
  static const std::vector<ChoiceCandidate> list{
      //                                           frame  read body  box   pair  build
      {"leaf_slabs",    {},                    frame,    100, 0.95,  60, 0.75, 15.6,  0, &slabs},  // the refit
      {"bottom_up",     {},                    frame,    100, 0.95,  60, 0.68, 11.4,  0, &boxes},
      {"lbvh_drift",    {},                    frame,    100, 3.5,   60, 0.76, 11.5,  9, &new_trees},
      {"drift_rebuild", {{"start", "sorted"}}, frame,    100, 0.95,  60, 0.68, 11.4, 70, &new_trees},
      {"drift_boxes",   {},                    frames,  1800, 0.6,  100, 0.82, 15.5,  0, &drifting},
      {"interval_join", {},                    segment,  800, 3.2,  150, 2.4,   0,    0, &join},
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
      segments, seen.pairs, seen.growth, seen.changes_per_frame);
  return text;
}

}  // namespace kbvh
