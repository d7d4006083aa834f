#pragma once
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "core/families/blend/blend_source.hpp"
#include "core/families/blend/field_rows.hpp"
#include "core/motion/precise_quotient.hpp"

namespace kbvh {

/// The boxes of one body at each of its keyframes, and their blend at any time (Larsson & Akenine-Möller
/// 2003): a convex combination of boxes contains the same combination of points. Memory: 6 scalars for each
/// node and keyframe. Build O(keyframes x (nodes + vertices of leaves)).
template <class S>
class TargetBoxes : public BlendSource<S> {
 public:
  TargetBoxes(const WideHierarchy<S>& hierarchy, const FlightPlans<S>& plans)
      : plans_(&plans), scalars_(lane_scalars(hierarchy.width())), targets_(plans.keyframe_count()) {
    for (std::size_t k = 0; k < targets_.size(); ++k) {
      Target& target = targets_[k];
      target.rows.fit(hierarchy, plans.keyframe(k));
      for (std::size_t i = 0; i < 8; ++i)
        if (i % 4 != 3) target.largest = std::max(target.largest, std::abs(target.rows.node_bounds[i]));
      target.rows.node_bounds = {};  // unions of blended children are smaller
    }
  }

  void blend_at(double t, BlendTerms<S>& out) const override {
    const auto times = plans_->keyframe_times();
    const std::size_t k = plans_->segment_at(t);
    const Target& first = targets_[k];
    out.stride = scalars_;
    out.terms.assign(1, {first.rows.child_bounds.data(), 1, 0});
    std::fill_n(out.offset, 6, S(0));
    out.rounding = 0;
    if (k + 1 == times.size() || !(t > times[k])) return;
    const Target& last = targets_[k + 1];
    const auto share = [&](double from, double to) {
      return S(std::max(precise_quotient(two_diff(to, from), two_diff(times[k + 1], times[k])).hi, 0.0));
    };
    // Not 0: empty lanes are infinite, and 0 times infinity is NaN. The offset covers the difference.
    const S least = std::numeric_limits<S>::min();
    out.terms[0].weight = std::max(share(t, times[k + 1]), least);
    out.terms.push_back({last.rows.child_bounds.data(), std::max(share(times[k], t), least), 0});
    // Roundings, in shares of the terms: half a unit each for the weight, two products and the sum. The
    // offset is added monotonically, with the same rounding as the frame's position.
    out.rounding = S(2.5) * std::numeric_limits<S>::epsilon();
    std::fill_n(out.offset, 6, -4 * least * std::max({S(1), first.largest, last.largest}));
  }

  std::size_t bytes() const override {
    std::size_t total = targets_.capacity() * sizeof(Target);
    for (const Target& target : targets_) total += target.rows.bytes();
    return total;
  }

 private:
  struct Target {
    FieldRows<S> rows;
    S largest = 0;  ///< coordinate
  };
  const FlightPlans<S>* plans_;
  std::size_t scalars_;
  std::vector<Target> targets_;  ///< [keyframe]
};

}  // namespace kbvh
