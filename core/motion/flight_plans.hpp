#pragma once
#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "core/motion/curved_piece.hpp"
#include "core/motion/piece.hpp"
#include "core/motion/round_positions.hpp"

namespace kbvh {

/// A vertex's own plan, valid from the time of `flight_plans_changed`: straight lines through
/// `times`/`positions` (after the starting knot, which is the stored position at the change), then `velocity`
/// for ever. The common velocity field has no knots.
template <class S>
struct PlanChange {
  std::uint32_t body = 0, vertex = 0;
  std::vector<double> times;  ///< seconds, strictly increasing, later than the change
  std::vector<S> positions;   ///< [times.size()][3]
  S velocity[3] = {0, 0, 0};  ///< units per second, after the last knot
};

/// The step of a body's vertices over a segment, but for rounding; `lower` and `upper` are the same.
template <class S>
struct Translation {
  std::array<S, 3> lower, upper;
  bool exact;  ///< all steps are one vector that, added to a position at the start, gives the position at the
               ///< end without rounding
};

/// The curves of one segment between two keyframes: the coefficients of curved_piece.hpp, [vertex][3]. An
/// empty list means zeros: without `twist` all vertices are on parabolas, without both on lines.
template <class S>
struct SegmentBends {
  std::vector<S> bend, twist;
};

/// The flight plans of one body's vertices: exact functions of the stored numbers (truth A) over keyframes at
/// arbitrary times, with exceptions for vertices whose plan changed at run time. The pieces between keyframes
/// are lines, or curves of degree 2 or 3. Before its first and after its last keyframe a body rests.
/// Positions are truth A, correctly rounded (truth B). Copies share the keyframes; plan changes belong to one
/// copy.
template <class S>
class FlightPlans {
 public:
  FlightPlans() : FlightPlans(0, {0.0}, {}) {}
  /// Takes `positions` as [keyframe][vertex][3]. Throws std::invalid_argument that names the error: no
  /// keyframe, sizes that do not match, times that do not strictly increase, values that are not finite or
  /// beyond the admissible range.
  /// `bends` has an entry for each segment, or none: all vertices then move on lines. Numbers of curves are
  /// limited like coordinates. Plans of bodies with curves cannot change at run time.
  FlightPlans(std::uint32_t vertex_count, std::vector<double> times, std::vector<S> positions,
              std::vector<SegmentBends<S>> bends = {});
  /// Makes the plans of a body whose positions are handed in frame by frame (Playback::hand_in): its motion
  /// is unknown. `positions` [vertex][3] hold until the first hand-in. Throws std::invalid_argument like the
  /// constructor.
  static FlightPlans handed_in(std::uint32_t vertex_count, std::vector<S> positions) {
    FlightPlans plans(vertex_count, {0.0}, std::move(positions));
    plans.handed_in_ = true;
    return plans;
  }
  bool is_handed_in() const { return handed_in_; }

  /// Returns the number of all vertices, including those added at run time.
  std::uint32_t vertex_count() const { return vertex_count_; }
  /// Returns the number of vertices with keyframes, which come first. The others have their own plans.
  std::uint32_t keyframed_count() const { return keyframed_count_; }
  std::size_t keyframe_count() const { return keyframes_->times.size(); }
  std::span<const double> keyframe_times() const { return keyframes_->times; }
  /// Returns the positions of keyframe k, [keyframed vertex][3], without the vertices' own plans. One scalar
  /// past the end may be read.
  const S* keyframe(std::size_t k) const { return keyframes_->positions.data() + 3 * k * keyframed_count_; }
  /// Returns whether a vertex moves on a curve in some segment; in the segment k; at t and right after it.
  bool curved() const { return !keyframes_->bends.empty(); }
  bool curved_in(std::size_t k) const { return curved() && k + 1 < keyframe_count() && bends(k) != nullptr; }
  bool curved_at(double t) const {
    return curved() && t >= keyframes_->times.front() && curved_in(segment_at(t));
  }
  /// Return the coefficients of the curves in segment k, [vertex][3]; null: all zero. `curved` must hold.
  const S* bends(std::size_t k) const { return coefficients(keyframes_->bends[k].bend); }
  const S* twists(std::size_t k) const { return coefficients(keyframes_->bends[k].twist); }
  /// Returns one coordinate's piece in segment k, which may be a chord.
  CurvedPiece<S> curved_piece(std::uint32_t vertex, int axis, std::size_t k) const;
  bool moving() const { return handed_in_ || keyframe_count() > 1 || !own_plans_.empty(); }
  /// Returns whether lines end at keyframes; a body with a single keyframe rests there at all times.
  bool has_knots() const { return keyframed_count_ > 0 && keyframe_count() > 1; }
  bool has_own_plans() const { return !own_plans_.empty(); }
  bool has_own_plan(std::uint32_t vertex) const {
    return !own_plans_.empty() && own_of_vertex_[vertex] != none;
  }

  /// Writes the position of every vertex at t: out[3 * vertex + axis]. O(vertices).
  void evaluate(double t, S* out) const;
  /// Does the same for the listed vertices only, into the same layout.
  void evaluate(double t, std::span<const std::uint32_t> vertices, S* out) const;
  /// Do the same in parts that threads can share. The first writes the positions of the keyframed vertices
  /// [begin, end) as their keyframes say; the second, once these are written, part `part` of `parts` of the
  /// vertices with plans of their own.
  void evaluate_keyframed(double t, std::uint32_t begin, std::uint32_t end, S* out) const;
  void evaluate_own_plans(double t, std::size_t part, std::size_t parts, S* out) const;

  /// Returns the index k of the segment [times[k], times[k+1]) that contains t; 0 before the first, the last
  /// index past the end.
  std::size_t segment_at(double t) const;
  /// Returns the linear piece that holds at t and right after it. `t1` is its end (infinity: never). Throws
  /// std::logic_error on a curve: who asks takes linear motion only (`Info::can`).
  Piece<S> piece_after(std::uint32_t vertex, int axis, double t) const;
  /// Returns the end of that piece without building it.
  double piece_end(std::uint32_t vertex, double t) const;

  /// Return the time from which and the time until which every vertex stays on the piece that it is on at t
  /// and right after it; infinite if there is no such limit. O(own plans).
  double lines_begin(double t) const;
  double lines_end(double t) const;
  /// Returns whether the body rests from t until `lines_end(t)`. False for bodies with vertices' own plans.
  bool at_rest(double t) const;
  /// Returns the common translation of the body over the keyframe segment that contains t: a step that, added
  /// to each coordinate, gives that at the end but for an epsilon of the larger of these two. Returns nothing
  /// if there is none, without a segment, with curves, or with vertices' own plans. O(vertices) at the first
  /// call per segment; it stops early at the first vertices that differ.
  std::optional<Translation<S>> translation(double t) const;

  /// Returns an upper bound of every vertex's speed on the segment that holds at t (units per second), own
  /// plans included. O(vertices) at the first call per segment; O(own plans) after a change or a knot of an
  /// own plan.
  double speed_bound(double t) const;
  /// Returns an upper bound of every vertex's Euclidean displacement between t0 and t1, over any number of
  /// segments; 0 only if no vertex moves. Not valid for times before the last change. Costs as much as
  /// `speed_bound`.
  double displacement_bound(double t0, double t1) const;

  /// Writes two points for each keyframed vertex, out[3 * vertex] and out[3 * (vertex_count + vertex)]: its
  /// position at t, which is `begin` or `end`, moved down and up along every axis by as much as its curve may
  /// lie below and above the chord between `begin` and `end`. Boxes around these points that are linear in
  /// time contain the curves throughout, but for half a unit of rounding. Requires begin < end in one
  /// segment. O(vertices).
  void evaluate_hull(double begin, double end, double t, S* out) const;

  /// Throws std::invalid_argument if there is no such vertex.
  void check_vertex(std::uint32_t vertex) const;
  /// Throws the std::invalid_argument that `change` would throw.
  void check_change(double t, const PlanChange<S>& change, const S* position) const;
  /// Starts the vertex's new plan at t from its stored position at t (`position`, 3 scalars). Throws
  /// std::invalid_argument and changes nothing on values that are not finite or beyond the admissible range
  /// (the position, too: a vertex may have left it), knots not after t, or an unknown vertex.
  void change(double t, const PlanChange<S>& change, const S* position);
  /// Adds a vertex with the next free id that is at `position` (3 scalars) at t and follows the plan from
  /// there. Before t its first piece is defined but meaningless. `plan.body` and `plan.vertex` are ignored.
  /// Throws std::invalid_argument like `change`, and on an inadmissible position. Amortised O(knots).
  void add_vertex(double t, const PlanChange<S>& plan, const S* position);
  /// Throws the std::invalid_argument that `add_vertex` would throw for a vertex with that id; changes
  /// nothing.
  static void check_new_vertex(double t, const PlanChange<S>& plan, const S* position, std::uint32_t vertex);

  std::size_t bytes() const;

 private:
  static constexpr std::uint32_t none = std::numeric_limits<std::uint32_t>::max();
  struct Keyframes {
    std::vector<double> times;
    std::vector<S> positions;
    std::vector<SegmentBends<S>> bends;  ///< by segment; empty if no segment is curved
  };
  static const S* coefficients(const std::vector<S>& values) {
    return values.empty() ? nullptr : values.data();
  }
  struct OwnPlan {
    std::uint32_t vertex;
    std::vector<double> times;  // first knot: the change itself
    std::vector<S> positions;
    S velocity[3];
    std::uint32_t group = none, place = 0;  ///< index into rays_, for plans without a further knot
  };
  /// Vertices that move on rays from one time on, laid out to be evaluated together: a velocity field that
  /// changes at run time has thousands of them.
  struct Rays {
    double t0;
    std::vector<std::uint32_t> vertices;
    std::vector<S> origins, velocities;  ///< [vertex][3]
  };
  void join_rays(OwnPlan& plan);
  void leave_rays(const OwnPlan& plan);
  Piece<S> own_piece(const OwnPlan& plan, int axis, double t) const;
  double longest_step(std::size_t segment) const;
  std::optional<Translation<S>> find_translation(std::size_t segment) const;
  double own_speed(const OwnPlan& plan, double t) const;
  double own_speed_bound(double t) const;
  static void check_plan(double t, const PlanChange<S>& change, std::uint32_t vertex, const S* position);
  static OwnPlan own_plan(double t, const PlanChange<S>& change, std::uint32_t vertex, const S* position);
  void evaluate_listed(double t, std::span<const std::uint32_t> vertices, S* out) const;

  std::uint32_t vertex_count_ = 0, keyframed_count_ = 0;
  bool handed_in_ = false;
  std::shared_ptr<const Keyframes> keyframes_;
  std::vector<std::uint32_t> own_of_vertex_;
  std::vector<OwnPlan> own_plans_;
  std::vector<Rays> rays_;                     ///< none is empty
  mutable std::vector<double> longest_steps_;  // by segment; negative until the first request
  mutable std::vector<std::optional<std::optional<Translation<S>>>> translations_;  // by segment
  mutable double own_speed_ = 0, own_speed_from_ = 0, own_speed_until_ = 0;         // valid in [from, until)
};

extern template class FlightPlans<float>;
extern template class FlightPlans<double>;

}  // namespace kbvh
