#pragma once
#include <cstdint>
#include <limits>
#include <span>

#include "core/judge/plan_script.hpp"
#include "core/motion/admissible.hpp"

namespace kbvh {

/// Knows until when every vertex whose plan has no further knot stays within admissible_reach.
template <class S>
class RangeWatch {
 public:
  /// Begins with the plans as they are. O(1) if none is a vertex's own.
  void start(const Playback<S>& playback);
  /// A vertex has a new plan. O(log knots).
  void changed(const Playback<S>& playback, std::uint32_t body, std::uint32_t vertex);
  /// Vertices were added. O(change).
  void added(const Playback<S>& playback, const GeometryChange<S>& change);
  /// Throws std::invalid_argument with body, vertex, time and value if a vertex has left the range at t. O(1)
  /// before the earliest time at which one may, O(vertices) after it, if that plan is none any more.
  void check(const Playback<S>& playback, double t);

 private:
  double safe_until_ = std::numeric_limits<double>::infinity();  ///< at the latest; plans may have changed
};

/// Throws std::invalid_argument if the scene cannot be played at these times (ascending) with these changes:
/// a time beyond admissible_time, a change that is not valid, a vertex out of the admissible range when its
/// plan is changed or at the last frame. Names vertex, time and value. Steps after the last frame do not
/// count. O(keyframes + changes), and all positions of a body at times of many changes.
template <class S>
void check_played(const Scene<S>& scene, const PlanScript<S>& script, std::span<const double> frames);

extern template class RangeWatch<float>;
extern template class RangeWatch<double>;

}  // namespace kbvh
