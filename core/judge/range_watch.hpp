#pragma once
#include <cstdint>
#include <limits>
#include <span>

#include "core/judge/plan_script.hpp"
#include "core/motion/admissible.hpp"

namespace kbvh {

/// Tracks the time until which every vertex whose plan has no further knot stays within admissible_reach.
template <class S>
class RangeWatch {
 public:
  /// Starts with the current plans. O(1) if no vertex has its own plan.
  void start(const Playback<S>& playback);
  /// Registers a new plan of a vertex. O(log knots).
  void changed(const Playback<S>& playback, std::uint32_t body, std::uint32_t vertex);
  /// Registers added vertices. O(change).
  void added(const Playback<S>& playback, const GeometryChange<S>& change);
  /// Throws std::invalid_argument with body, vertex, time and value if a vertex has left the range at t. O(1)
  /// before the earliest time at which one may leave it; O(vertices) after that time, if the plan concerned
  /// has been replaced.
  void check(const Playback<S>& playback, double t);

 private:
  double safe_until_ = std::numeric_limits<double>::infinity();  ///< an upper limit; plans may have changed
};

/// Throws std::invalid_argument if the scene cannot be played at these times (ascending) with these changes:
/// a time beyond admissible_time, an invalid change, a vertex out of the admissible range when its plan is
/// changed or at the last frame. Names vertex, time and value. Steps after the last frame are ignored.
/// O(keyframes + changes), plus all positions of a body at times of many changes.
template <class S>
void check_played(const Scene<S>& scene, const PlanScript<S>& script, std::span<const double> frames);

extern template class RangeWatch<float>;
extern template class RangeWatch<double>;

}  // namespace kbvh
