#pragma once
#include <algorithm>
#include <cmath>

#include "core/families/choice/predicted_costs.hpp"

namespace kbvh {

/// A choice's knowledge about the age of refitted trees. While these answer, the surfaces of their boxes
/// indicate how many of the box tests new trees may save; the first search in rebuilt trees shows how many
/// they do save. Later choices slowly forget this result, so that a tree is tried again if its bodies may
/// have returned to their first shape.
class ObservedAgeing {
 public:
  /// `surface`: of the refitted trees, see ReportsWork.
  void start_over(double surface) {
    *this = {};
    new_surface_ = surface;
  }
  /// Registers this frame's search of the refitted trees, by slabs or by boxes alone, as `seen` states.
  void refitted(double tests, double candidates, int frame, const Observed& seen) {
    tests_ = estimate_ = tests;
    found_ = candidates == seen.candidates ? seen.boxed * candidates : candidates;
    frame_ = frame;
  }
  /// Registers this frame's search of rebuilt trees; `frame` counts from the start.
  void rebuilt(double tests, double candidates, int frame, Observed& seen) {
    if (!known_ && tests > 0 && frame_ != frame - 1) {  // too long ago for a comparison
      known_ = compared_ = true;
      factor_ = 1 / (1 - std::min(seen.aged, 0.99));
    } else if (!known_ && tests > 0) {
      known_ = true;
      // Compares both searches per candidate; `quiet` stands for the traversal of bodies without contact.
      factor_ = std::max(1.0, tests_ / tests * (candidates + quiet) / (found_ + quiet));
      if (factor_ > 1.5) kept_ = std::sqrt(kept_);
      compared_ = true;
      realised_share_ = possible() > 0 ? (factor_ - 1) * tests / possible() : 1;
      seen.ageing = seen.sorted_ageing = (factor_ - 1) * tests / frame;
      if (seen.candidates > 0) seen.boxed = std::max(1.0, candidates / seen.candidates);
    }
    seen.aged = 1 - 1 / factor_;
    if (estimate_ > 0)
      for (double* refitted : {&seen.slab_tests, &seen.plain_tests}) *refitted *= factor_ * tests / estimate_;
    estimate_ = factor_ * tests;
    seen.candidates = candidates / seen.boxed;
  }
  /// Updates the observations at a choice while the refitted trees answer. `frame` as above.
  void look_at_refitted(double surface, int frame, Observed& seen) {
    known_ = false;
    growth_ = new_surface_ > 0 ? std::max(1.0, surface / new_surface_) : 1;
    const double surplus = realised_share_ * possible();
    seen.aged = tests_ > 0 ? std::min(0.99, surplus / tests_) : 0;
    seen.ageing = seen.sorted_ageing = surplus / std::max(1, frame);
  }
  /// Does the same while the rebuilt trees answer. `growth`: of their surplus, see ReportsWork. `sorted`: the
  /// trees are those of drift_rebuild, which last longer, so that their surplus grows faster.
  void look_at_rebuilt(double growth, bool sorted, Observed& seen) {
    factor_ = 1 + kept_ * (factor_ - 1);
    if (!sorted) {
      built_growth_ = seen.ageing = growth;
      seen.sorted_ageing = longer_ * growth;
      return;
    }
    if (built_growth_ > 0) longer_ = std::clamp(growth / built_growth_, 1.0, 10.0);
    built_growth_ = 0;
    seen.sorted_ageing = growth;
    seen.ageing = growth / longer_;
  }
  /// Whether rebuilt trees were ever compared with refitted ones.
  bool compared() const { return compared_; }
  /// Returns the box tests of the last search of the refitted trees.
  double tests() const { return tests_; }

 private:
  /// Returns the tests that new trees save if the growth of the boxes affects searches in full.
  double possible() const { return tests_ * (1 - 1 / growth_); }

  static constexpr double quiet = 1000;

  double new_surface_ = 0;
  double growth_ = 1;    // of the surfaces, at the last choice
  double tests_ = 0;     // of the last search of the refitted trees
  double found_ = 0;     // candidates of boxes alone in that search
  int frame_ = 0;        // of that search
  double kept_ = 0.8;    // kept of factor_ - 1 at each choice; approaches 1 with trials that new trees win
  double estimate_ = 0;  // estimated tests of the refitted trees in this frame
  double realised_share_ = 1;  // share of the possible saving that rebuilt trees achieved
  double factor_ = 1;          // tests of refitted over those of rebuilt trees
  double longer_ = 2.5;        // growth of drift_rebuild's surplus over that of lbvh_drift
  double built_growth_ = 0;    // of lbvh_drift's surplus, not yet compared with drift_rebuild's
  bool compared_ = false;
  bool known_ = false;  // the factor was measured after the last answer of the refitted trees
};

}  // namespace kbvh
