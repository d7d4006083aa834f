#pragma once
#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include "core/geometry/volumes/outward.hpp"
#include "core/motion/flight_plans.hpp"

namespace kbvh {

/// Chains of line segments below and above the curves of each body's vertices, which separation lists compare
/// instead of the curves. At every keyframe a coordinate is moved down and up by as much as the curves on
/// both sides of the keyframe may lie below and above their chords (`bulge`), and rounded outwards. The
/// chains are continuous. A box whose lower sides follow the lower chains of its realisers, and whose upper
/// sides follow the upper ones, contains the box of the curves at every time.
template <class S>
class CurveHulls {
 public:
  /// Computes nothing yet.
  explicit CurveHulls(std::vector<const FlightPlans<S>*> plans)
      : plans_(std::move(plans)), chains_(plans_.size()) {}

  /// Computes the chains when a clip begins, again if they were computed before. O(keyframes) of bodies on
  /// curves.
  void start() {
    for (std::size_t body = 0; body < plans_.size(); ++body)
      if (plans_[body]->curved()) compute(*plans_[body], chains_[body]);
  }
  /// Return the values of the chains at the keyframes, [keyframe][vertex][3]; null for a body without curves,
  /// whose boxes are those of its plans.
  const S* lower(std::uint32_t body) const { return chains_[body].empty() ? nullptr : chains_[body].data(); }
  const S* upper(std::uint32_t body) const {
    return chains_[body].empty() ? nullptr : chains_[body].data() + chains_[body].size() / 2;
  }
  std::size_t bytes() const {
    std::size_t total = 0;
    for (const std::vector<S>& chains : chains_) total += chains.capacity() * sizeof(S);
    return total;
  }

 private:
  static void compute(const FlightPlans<S>& plans, std::vector<S>& chains) {
    const std::size_t keyframes = plans.keyframe_count(), scalars = std::size_t(3) * plans.keyframed_count();
    chains.resize(2 * keyframes * scalars);
    const auto bulge_of = [&](std::size_t k, std::size_t i) -> Bulge<S> {
      if (!plans.curved_in(k)) return {0, 0};
      const S *const twists = plans.twists(k), bend = plans.bends(k)[i],
                     twist = twists == nullptr ? S(0) : twists[i];
      Bulge<S> bounds = bulge(bend, twist);
      // A quarter of the least numbers is rounded to zero.
      const double end = double(bend) + double(twist);
      if (bend < 0 || end < 0) bounds.lower -= outward::least;
      if (bend > 0 || end > 0) bounds.upper += outward::least;
      return bounds;
    };
    for (std::size_t k = 0; k < keyframes; ++k)
      for (std::size_t i = 0; i < scalars; ++i) {
        Bulge<S> both = bulge_of(k, i);
        if (k > 0) {
          const Bulge<S> before = bulge_of(k - 1, i);
          both = {std::min(both.lower, before.lower), std::max(both.upper, before.upper)};
        }
        const S x = plans.keyframe(k)[i];
        chains[k * scalars + i] =
            both.lower < 0 ? outward::down<S>(outward::two_sum(double(x), both.lower)) : x;
        chains[(keyframes + k) * scalars + i] =
            both.upper > 0 ? outward::up<S>(outward::two_sum(double(x), both.upper)) : x;
      }
  }

  std::vector<const FlightPlans<S>*> plans_;
  std::vector<std::vector<S>> chains_;  ///< [body][lower, upper][keyframe][vertex][3]
};

}  // namespace kbvh
