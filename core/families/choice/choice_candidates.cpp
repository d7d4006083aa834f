#include "core/families/choice/choice_candidates.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace kbvh {
namespace {

using Prediction = ChoiceCandidate::Prediction;

/// The same trees without slabs: usually a fifth of the box tests was made with slabs, which left out half of
/// the candidates; at best half of the tests, which left out none.
Prediction boxes(const Observed& seen, const ChoiceCandidate& own) {
  const auto work = [&](double tests, double pairs) {
    return own.update(seen) + own.box_test * tests * seen.box_tests + own.pair * pairs * seen.pairs;
  };
  return {work(0.8, 2), work(0.5, 1)};
}
/// New trees: boxes of the surfaces at the start, in a tree that is a little worse than that of the start.
/// The probability that two boxes meet grows with the volume of their sum.
Prediction new_trees(const Observed& seen, const ChoiceCandidate& own) {
  const double search = own.box_test * seen.box_tests + own.pair * seen.pairs;
  const double work = own.update(seen) + 1.3 * search / std::pow(seen.growth, 1.5) +
                      upkeep(own.build * seen.primitives, seen.ageing);
  return {work, work};
}
/// One search serves several frames if bodies move as a whole; otherwise more pairs come near in these frames
/// than a query takes to find.
Prediction drift(const Observed& seen, const ChoiceCandidate& /*own*/) {
  return {1.2 * seen.refit, (seen.translates ? 0.5 : 1.2) * seen.refit};
}
/// One search serves a segment, with fewer box tests than a refit's; but it finds the pairs that are near at
/// any time of the segment, and decides each of them. On the best scenes seen it takes 0.4 of this.
Prediction join(const Observed& seen, const ChoiceCandidate& own) {
  const double search = own.body * seen.bodies + own.read * seen.reads + 0.7 * own.box_test * seen.box_tests;
  const double work = ChoicePrices::frame + search / seen.frames + (20 + 100 / seen.frames) * seen.pairs;
  return {work, 0.4 * work};
}

}  // namespace

const std::vector<ChoiceCandidate>& choice_candidates() {
  using enum ChoiceUnit;
  // One core of an AMD EPYC (AVX-512), rounded. A box test takes 1 ns, its boxes are compared eight at once;
  // a pair 14 ns, most of it the gathering of two triangles. A read is 12 bytes of a position, where it is
  // made and where it is read. Where a line differs, it does more:
  // - lbvh_drift makes a box for each primitive, about 100 bytes; its searches use the same kernels.
  // - drift_boxes compares all vertices of a body with where they were, and looks at each listed pair.
  // - interval_join makes boxes for both ends of a segment, with slabs; a test compares them at both ends, in
  //   a margin. What it decides is counted apart (ChoicePrices). Its list of pairs is not counted.
  // A build sorts by keys (9 ns a primitive and level of its radix sort) or by medians.
  // clang-format off
  static const std::vector<ChoiceCandidate> list{
      //                                           read body  box pair build
      {"leaf_slabs",    {},                    frame,   0.5,  50, 1,   14,   0, nullptr},  // the refit
      {"bottom_up",     {},                    frame,   0.5,  50, 1,   14,   0, &boxes},
      {"lbvh_drift",    {},                    frame,   4,    50, 1,   14,   9, &new_trees},
      {"drift_rebuild", {{"start", "sorted"}}, frame,   0.5,  50, 1,   14,  70, &new_trees},
      {"drift_boxes",   {},                    frames,  0.4, 190, 1.3, 18,   0, &drift},
      {"interval_join", {},                    segment, 3.3, 120, 3.7,  0,   0, &join},
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
