#pragma once
#include <cstdint>
#include <limits>
#include <span>
#include <string>

#include "core/contract/strategy.hpp"
#include "core/judge/plan_script.hpp"
#include "core/motion/admissible.hpp"

namespace kbvh {

/// Tracks the time until which every vertex whose plan has no further knot stays within a range:
/// admissible_reach, or the narrower one of a contestant (Info::max_coordinate).
template <class S>
class RangeWatch {
 public:
  /// Watches the range that is admissible for all contestants.
  RangeWatch() = default;
  /// Watches the range of a contestant.
  explicit RangeWatch(const Info& contestant);

  /// Starts with the current plans. O(1) if no vertex has its own plan.
  void start(const Playback<S>& playback);
  /// Registers a new plan of a vertex. O(log knots).
  void changed(const Playback<S>& playback, std::uint32_t body, std::uint32_t vertex);
  /// Registers added vertices; takes `changes_of_bodies`. O(change).
  void added(const Playback<S>& playback, const GeometryChange<S>& change);
  /// Throws std::invalid_argument with body, vertex, time and value if a vertex has left the range at t. O(1)
  /// before the earliest time at which a vertex may leave it. O(vertices) after that time, if the plan that
  /// gave this time has been replaced.
  void check(const Playback<S>& playback, double t);

  // Check what is given at run time, before it is applied. Each throws std::invalid_argument with place and
  // value if something is beyond the range of the contestant. O(1) for a contestant that takes everything
  // admissible.
  void check_positions(std::uint32_t body, std::uint32_t vertices, const S* positions) const;
  void check_plans(std::span<const PlanChange<S>> changes) const;
  void check_added(const GeometryChange<S>& change) const;
  void check_probes(const Probes<S>& probes) const;

 private:
  bool narrow() const { return !contestant_.empty(); }
  void check_point(const S* point, const std::string& what) const;
  /// Throws for something at `where` that is out of the range.
  [[noreturn]] void refuse(const std::string& where) const;
  double stays_until(const FlightPlans<S>& plans, std::uint32_t vertex) const;
  void check_vertex(const FlightPlans<S>& plans, std::uint32_t body, std::uint32_t vertex, double t) const;

  double most_ = double(admissible_reach<S>);
  std::string contestant_;                                       ///< empty: the admissible range
  double safe_until_ = std::numeric_limits<double>::infinity();  ///< an upper limit; plans may have changed
};

/// Throws std::invalid_argument if the scene cannot be played at these times (ascending) with these changes:
/// for a time beyond admissible_time, an invalid change, or a vertex that is out of the admissible range when
/// its plan is changed or at the last frame. Names vertex, time and value. Steps after the last frame are
/// ignored. O(keyframes + changes), plus all positions of a body at times of many changes.
template <class S>
void check_played(const Scene<S>& scene, const PlanScript<S>& script, std::span<const double> frames);

/// Returns why the whole motion of a scene that `check_played` accepts does not fit into the range of a
/// contestant, as the end of a sentence that begins with its id; empty if it does. O(1) for a contestant that
/// takes everything admissible.
template <class S>
std::string out_of_range(const Info& contestant, const Scene<S>& scene, const PlanScript<S>& script,
                         std::span<const double> frames);

/// Does the same for probes.
template <class S>
std::string out_of_range(const Info& contestant, const Probes<S>& probes);

extern template class RangeWatch<float>;
extern template class RangeWatch<double>;

}  // namespace kbvh
