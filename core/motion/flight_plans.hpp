#pragma once
#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "core/motion/piece.hpp"
#include "core/motion/round_positions.hpp"

namespace kbvh {

/// A vertex's plan of its own, from the moment `flight_plans_changed` gave it: straight lines through
/// `times`/`positions` (after the starting knot, which is the stored position at the change), then
/// `velocity` for ever. The common velocity field has no knots.
template <class S>
struct PlanChange {
  std::uint32_t body = 0, vertex = 0;
  std::vector<double> times;  ///< seconds, strictly increasing, later than the change
  std::vector<S> positions;   ///< [times.size()][3]
  S velocity[3] = {0, 0, 0};  ///< units per second, after the last knot
};

/// Between which vectors, per axis, the steps of a body's vertices over a segment lie.
template <class S>
struct Translation {
  std::array<S, 3> lower, upper;
  bool exact;  ///< one vector: adding it to a position at the begin gives that at the end without rounding
};

/// The flight plans of one body's vertices: exact piecewise-linear functions of the stored numbers (truth A)
/// over keyframes at arbitrary times, with exceptions for vertices whose plan changed at run time.
/// Before its first and after its last keyframe a body rests. Positions are A rounded correctly (truth B).
/// Keyframes are shared between copies; plan changes belong to a copy.
template <class S>
class FlightPlans {
 public:
  FlightPlans() : FlightPlans(0, {0.0}, {}) {}
  /// `positions` is [keyframe][vertex][3]. Throws std::invalid_argument naming what is wrong: no keyframe,
  /// sizes that do not match, times not strictly increasing, values not finite or beyond the admissible
  /// range.
  FlightPlans(std::uint32_t vertex_count, std::vector<double> times, std::vector<S> positions);
  /// The plans of a body whose positions are handed in frame by frame (Playback::hand_in), so that nothing is
  /// known of its motion but that it moves. `positions` [vertex][3] are those until the first are handed in.
  /// Throws std::invalid_argument as the constructor does.
  static FlightPlans handed_in(std::uint32_t vertex_count, std::vector<S> positions) {
    FlightPlans plans(vertex_count, {0.0}, std::move(positions));
    plans.handed_in_ = true;
    return plans;
  }
  bool is_handed_in() const { return handed_in_; }

  /// All vertices, those added at run time included.
  std::uint32_t vertex_count() const { return vertex_count_; }
  /// Vertices that have keyframes: the first ones. The others have plans of their own.
  std::uint32_t keyframed_count() const { return keyframed_count_; }
  std::size_t keyframe_count() const { return keyframes_->times.size(); }
  std::span<const double> keyframe_times() const { return keyframes_->times; }
  /// Positions of keyframe k, [keyframed vertex][3]; own plans are not in them. One scalar past the end may
  /// be read.
  const S* keyframe(std::size_t k) const { return keyframes_->positions.data() + 3 * k * keyframed_count_; }
  bool moving() const { return handed_in_ || keyframe_count() > 1 || !own_.empty(); }
  /// Do its keyframes end lines? A single one is where the body is at all times.
  bool has_knots() const { return keyframed_count_ > 0 && keyframe_count() > 1; }
  bool has_own_plans() const { return !own_.empty(); }
  bool has_own_plan(std::uint32_t vertex) const { return !own_.empty() && own_of_vertex_[vertex] != none; }

  /// Writes the position of every vertex at t: out[3 * vertex + axis]. O(vertices).
  void evaluate(double t, S* out) const;
  /// The same for the listed vertices only, into the same layout.
  void evaluate(double t, std::span<const std::uint32_t> vertices, S* out) const;

  /// Index k of the segment [times[k], times[k+1]) with t in it; 0 before the first, last index past the end.
  std::size_t segment_at(double t) const;
  /// The linear piece that holds at t and right after it. `t1` is where it ends (infinity: never).
  Piece<S> piece_after(std::uint32_t vertex, int axis, double t) const;
  /// The end of that piece, without building it.
  double piece_end(std::uint32_t vertex, double t) const;

  /// From when on, and until when, every vertex is on the lines that it is on at t and right after it;
  /// infinite where that is for ever. O(own plans).
  double lines_begin(double t) const;
  double lines_end(double t) const;
  /// Nothing moves at t, and not before `lines_end(t)`. False if there are plans of their own.
  bool at_rest(double t) const;
  /// How the body moves as a whole over the keyframes' segment that t is in: the steps of all its vertices,
  /// which differ by no more than the rounding of stored coordinates (4 ulps of the largest). Nothing if they
  /// differ by more (the first by much more), without a segment, or with plans of its own. O(vertices) the
  /// first time a segment is asked for, or as many as move alike.
  std::optional<Translation<S>> translation(double t) const;

  /// No vertex is faster than this on the segment that holds at t (units per second, rounded up); own plans
  /// included. O(vertices) the first time a segment is asked for; O(own plans) after a change, or a knot of
  /// one.
  double speed_bound(double t) const;
  /// No vertex moves further than this on its way from t0 to t1 (Euclidean, rounded up), whatever segments
  /// lie between; 0 only if none moves at all. Not for times before the last change. Costs as `speed_bound`.
  double displacement_bound(double t0, double t1) const;

  /// Throws std::invalid_argument if there is no such vertex.
  void check_vertex(std::uint32_t vertex) const;
  /// Throws std::invalid_argument, saying what is wrong, if `change` would.
  void check_change(double t, const PlanChange<S>& change, const S* position) const;
  /// Starts the vertex's new plan at t from its stored position at t (`position`, 3 scalars). Throws
  /// std::invalid_argument, with nothing changed: on values that are not finite or beyond the admissible
  /// range (the position, too: a vertex can have flown out of it), knots not after t, or an unknown vertex.
  void change(double t, const PlanChange<S>& change, const S* position);
  /// Adds a vertex, with the next free id, that is at `position` (3 scalars) at t and follows the plan from
  /// there (before t its first piece is defined, and means nothing). `plan.body` and `plan.vertex` are
  /// ignored. Throws std::invalid_argument like `change`, and on a position that is not admissible. Amortised
  /// O(knots).
  void add_vertex(double t, const PlanChange<S>& plan, const S* position);
  /// Throws what `add_vertex` would throw for a vertex with that id, and does nothing else.
  static void check_new_vertex(double t, const PlanChange<S>& plan, const S* position, std::uint32_t vertex);

  std::size_t bytes() const;

 private:
  static constexpr std::uint32_t none = std::numeric_limits<std::uint32_t>::max();
  struct Keyframes {
    std::vector<double> times;
    std::vector<S> positions;
  };
  struct OwnPlan {
    std::uint32_t vertex;
    std::vector<double> times;  // first knot: the change itself
    std::vector<S> positions;
    S velocity[3];
    std::uint32_t group = none, place = 0;  ///< in rays_, of plans without a further knot
  };
  /// Vertices that fly on for ever from one time on, laid out to be evaluated together: a field of velocities
  /// that change at run time has thousands of them.
  struct Rays {
    double t0;
    std::vector<std::uint32_t> vertices;
    std::vector<S> origins, velocities;  ///< [vertex][3]
  };
  void join_rays(OwnPlan& plan);
  void leave_rays(const OwnPlan& plan);
  void evaluate_rays(double t, S* out) const;
  Piece<S> own_piece(const OwnPlan& plan, int axis, double t) const;
  double longest_step(std::size_t segment) const;
  std::optional<Translation<S>> find_translation(std::size_t segment) const;
  double own_speed(const OwnPlan& plan, double t) const;
  double own_speed_bound(double t) const;
  static void check_plan(double t, const PlanChange<S>& change, std::uint32_t vertex, const S* position);
  static OwnPlan own_plan(double t, const PlanChange<S>& change, std::uint32_t vertex, const S* position);
  void evaluate_keyframed(double t, std::span<const std::uint32_t> vertices, S* out) const;

  std::uint32_t vertex_count_ = 0, keyframed_count_ = 0;
  bool handed_in_ = false;
  std::shared_ptr<const Keyframes> keyframes_;
  std::vector<std::uint32_t> own_of_vertex_;
  std::vector<OwnPlan> own_;
  std::vector<Rays> rays_;                     ///< none is empty
  mutable std::vector<double> longest_steps_;  // by segment; negative until it is asked for
  mutable std::vector<std::optional<std::optional<Translation<S>>>> translations_;  // likewise
  mutable double own_speed_ = 0, own_speed_from_ = 0, own_speed_until_ = 0;         // holds in [from, until)
};

extern template class FlightPlans<float>;
extern template class FlightPlans<double>;

}  // namespace kbvh
