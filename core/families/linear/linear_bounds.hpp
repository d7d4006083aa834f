#pragma once
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include "core/contract/strategy.hpp"
#include "core/families/linear/change_horizon.hpp"
#include "core/families/linear/changed_parts.hpp"
#include "core/families/linear/linear_segment.hpp"
#include "core/families/linear/linear_settings.hpp"
#include "core/families/wide/near_bodies.hpp"
#include "core/families/wide/shared_refit.hpp"

namespace kbvh {

/// Bounds of all bodies of a scene over a segment in which every vertex of every body stays on one line:
/// boxes at its start and at its end, linear in between. A maximum of linear functions is convex and lies
/// below its chord, so the boxes contain every vertex throughout; at the ends they are tight. A segment needs
/// no updates, and the boxes at its end are those at the start of the next one. Prior art:
/// core/adr/0010-prior-art-of-answering-intervals.md.
///
/// Segments overlay those of all bodies: each lasts from the latest knot of any plan to the next one, cut as
/// configured by `SegmentCuts`. Every side of a box is inflated by the largest rounding error between the
/// flight plans and the positions of frames (WideEnds): about two ulps of its own coordinate.
///
/// Vertices may move on curves: the boxes are then those of two points for each vertex, its ends moved by as
/// much as the curve may leave their chord (FlightPlans::evaluate_hull). Only the boxes follow: joins and
/// their tests of triangles over time are for lines.
///
/// The boxes of a body that translates over a segment are translated instead of refitted, as long as no side
/// exceeds the tight one by more than 4 epsilons of its coordinate (TranslatedBoxes).
template <class S>
class LinearBounds {
 public:
  /// Throws std::invalid_argument unless the topologies of the bodies of each pair have the same width and
  /// leaf size.
  LinearBounds(const SceneView<S>& scene, const SegmentMotion<S>& motion, Topologies topologies,
               KernelSet kernels, const LinearSettings& settings);

  /// Makes the bounds of a segment that contains the motion's current time, without reusing earlier segments.
  void start();
  /// Does the same if the current time is outside the segment. Returns whether a new segment began.
  bool advance();
  /// Uses the whole segment that contains the current time; at a segment's end, the next one. (`advance`
  /// stays in the segment at its end.) Segments are not cut into pieces until the next `start`.
  void enter();
  /// Registers that plans changed at the motion's current time: the rest of the segment is a new one.
  void plans_changed();
  /// Follows changes of plans at the motion's current time within the segment. Only leaves with a changed
  /// vertex, and the boxes above them, are recomputed, from lines that are extended back to the segment's
  /// begin. Boxes hold from the current time on. Returns false if the segment cannot be kept: call
  /// `plans_changed` then. Later calls of `advance` follow the later knots of these plans in the segment.
  /// O(changes x (primitives of a vertex + height)); the first call for a body is linear in its size.
  bool repair(std::span<const PlanChange<S>> changes);
  /// Returns the parts of each body that changed since the segment began or `clear_changed` was called.
  std::span<const ChangedParts> changed() const { return changed_; }
  bool any_changed() const {
    return std::any_of(changed_.begin(), changed_.end(),
                       [](const ChangedParts& one) { return !one.empty(); });
  }
  void clear_changed();
  /// Counts work since `start`: plan changes after which the segment was kept, or not; leaves and wide nodes
  /// that were recomputed in these segments.
  struct Repairs {
    std::uint64_t kept = 0, restarted = 0, leaves = 0, nodes = 0;
  };
  const Repairs& repairs() const { return repairs_; }

  /// Starts building the next segment; `motion` is the view from the current segment's end. Returns false if
  /// this is not possible: no segment follows, segments are cut by looseness, plans changed recently, or
  /// `enter` was called after the last `start`. The work is discarded if plans change, if `advance` does not
  /// reach the segment, or if the segment leaves the range of numbers.
  bool start_ahead(const SegmentMotion<S>& motion);
  /// Continues building until this call has processed at least `nodes` nodes. Returns whether all bounds are
  /// complete.
  bool step_ahead(std::uint64_t nodes);
  bool has_ahead() const { return ahead_exists_; }
  /// Returns the segment that `step_ahead` has completed.
  const LinearSegment<S>& ahead() const { return segments_[1 - present_]; }
  /// Returns whether the last `advance` entered a segment that was started ahead.
  bool came_ahead() const { return came_ahead_; }
  /// Returns the number of nodes of all bodies that move in the current segment.
  std::uint64_t nodes_of_segment() const;

  const LinearSegment<S>& segment() const { return segments_[present_]; }
  double begin() const { return segment().begin; }
  double end() const { return segment().end; }
  S fraction(double t) const { return segment().fraction(t); }
  const BodySegmentBounds<S>& side(std::uint32_t body) const { return segment().sides[body]; }
  WideHierarchy<S>& hierarchy(std::uint32_t body) { return bodies_[body].hierarchy; }
  const WideHierarchy<S>& hierarchy(std::uint32_t body) const { return bodies_[body].hierarchy; }

  std::uint32_t body_count() const { return std::uint32_t(bodies_.size()); }
  std::uint32_t vertex_count(std::uint32_t body) const { return scene_.vertex_count(body); }

  /// Returns the boxes of a body at a time of the segment, one per node of its topology, in double; they
  /// exceed the boxes that a query reads only by rounding.
  std::vector<Box<double>> boxes_at(std::uint32_t body, double t) const;
  /// Returns the same, with missing boxes marked as stale.
  AuditView audit_view(std::uint32_t body, double t) const;

  /// Counts the work on a body at ends of segments, and the segments in which it was skipped: at rest, apart
  /// with only one box, or translated.
  struct Counts {
    std::uint64_t refitted = 0;  ///< wide nodes
    std::uint64_t at_rest = 0, apart = 0, translated = 0, translated_apart = 0;
  };
  /// Returns the counts since `start`.
  const Counts& counts(std::uint32_t body) const { return counts_[body]; }

  std::size_t bytes() const;

 private:
  struct Segment : LinearSegment<S> {
    double knot = 0;  ///< end of the whole segment, of which this may be a piece
    std::uint32_t pieces = 1;
    bool endless = false;  ///< lines have no end: the length is estimated, and must not be cut
  };
  /// Boxes under construction, from the last node to the first.
  struct Refit {
    const WideHierarchy<S>* hierarchy = nullptr;
    S *child_bounds = nullptr, *node_bounds = nullptr;
    const S* positions = nullptr;
    std::uint32_t left = 0;  ///< remaining nodes
  };
  /// The progress of the work on the next segment.
  struct Ahead {
    std::optional<SegmentMotion<S>> motion;
    std::uint32_t body = 0;  ///< the next body
    Refit refit;             ///< of the preceding body
    bool finished = false;
  };
  /// A knot of a changed plan within the segment.
  struct Knot {
    double time;
    std::uint32_t body, vertex;
  };
  /// Whether the preceding segment ends or stays in use.
  enum class Before : std::uint8_t { ends, stays };
  static constexpr double none = -std::numeric_limits<double>::infinity();  ///< the end of no segment

  void restart();
  void note_time();
  void next_segment();
  void forget_ahead();
  /// Returns the skip counts to increase; those of a segment built ahead are added when it becomes current.
  Counts& skip_counts(std::uint32_t body) { return ahead_exists_ ? ahead_counts_[body] : counts_[body]; }
  void choose_segment(Segment& segment, const SegmentMotion<S>& motion, double t) const;
  bool begin_side(Segment& segment, const Segment& before, const SegmentMotion<S>& motion, std::uint32_t body,
                  double t, Before what);
  void cut_while_loose(double t);
  double looseness_in_the_middle();
  Refit begin_end(Segment& segment, const SegmentMotion<S>& motion, std::uint32_t body, std::uint32_t end,
                  double t);
  /// Makes all boxes of a body, in new memory, empty.
  void make_empty(std::uint32_t body, S* child_bounds, S* node_bounds) {
    shared_refit_.start();
    shared_refit_.add(hierarchy(body), nullptr, child_bounds, node_bounds);
    shared_refit_.make_empty(motion_.workers());
  }
  void step_refit(std::uint32_t body, Refit& refit, std::uint64_t nodes);
  bool make_end(Segment& segment, const SegmentMotion<S>& motion, std::uint32_t body, std::uint32_t end,
                double t);
  void finish(Segment& segment, const SegmentMotion<S>& motion);
  bool take_over(std::uint32_t body);
  void follow_change(const PlanChange<S>& change);
  void follow_pieces(std::uint32_t body, std::uint32_t vertex);
  void follow_line(std::uint32_t body, std::uint32_t vertex, double t, const S* from, const S* last);
  bool pass_knots();
  bool remake_boxes();
  bool is_near_as_before();
  double share_remade();

  SceneView<S> scene_;
  SegmentMotion<S> motion_;
  SegmentCuts cuts_;
  NearBodies near_bodies_;
  bool whole_ = false;          ///< segments are not cut
  double last_ = 0, step_ = 0;  ///< time of the last frame, and the step to it
  double foreseen_ = 1;         ///< length in frames of a segment without an end
  ChangeHorizon horizon_;
  std::vector<ChangedParts> changed_;    ///< [body]
  std::vector<std::uint8_t> to_remake_;  ///< [body]
  /// A changed vertex leaves the range of numbers within the segment, or the segment's end is not known well
  /// enough.
  bool lost_ = false;
  std::vector<Knot> knots_;  ///< a heap
  Repairs repairs_;
  std::uint64_t leaves_before_ = 0;  ///< of repairs_.leaves, when the segment began
  std::vector<LinearBody<S>> bodies_;
  Segment segments_[2];
  std::uint32_t present_ = 0;
  Ahead ahead_;
  bool ahead_exists_ = false, came_ahead_ = false;
  AlignedArray<S> middle_lanes_,
      middle_own_;  ///< tight boxes in the middle of a piece, if looseness is measured
  std::vector<S> middle_room_;
  SharedRefit<S> shared_refit_;
  std::vector<Counts> counts_, ahead_counts_;  ///< by body
  std::vector<std::uint8_t> near_;             ///< by body: whether it is near another one during the segment
};

/// Counts the work of bounds as updates of a strategy.
template <class S>
class LinearCounts {
 public:
  explicit LinearCounts(std::uint32_t bodies) : before_(bodies) {}

  /// Skips all work done so far.
  void skip(const LinearBounds<S>& bounds) {
    for (std::uint32_t body = 0; body < bounds.body_count(); ++body) before_[body] = bounds.counts(body);
  }
  /// Adds the work since then.
  void add_to(Counters& count, const LinearBounds<S>& bounds) const {
    for (std::uint32_t body = 0; body < bounds.body_count(); ++body) {
      const auto& hierarchy = bounds.hierarchy(body);
      const auto &now = bounds.counts(body), &before = before_[body];
      const std::uint64_t nodes = hierarchy.topology().size();
      // Counts parts of refits such that they add up to whole refits.
      const auto refitted = [&](std::uint64_t all) {
        return hierarchy.empty() ? 0
                                 : all * now.refitted / hierarchy.node_count() -
                                       all * before.refitted / hierarchy.node_count();
      };
      const std::uint64_t made = refitted(nodes) + (now.translated - before.translated) * nodes;
      count.add(Counter::nodes_visited, made);
      count.add(Counter::values_written, 6 * made);
      count.add(Counter::vertex_reads, refitted(hierarchy.leaf_vertex_count()) +
                                           (now.apart - before.apart) * bounds.vertex_count(body));
      count.add(Counter::bodies_translated,
                now.translated - before.translated + now.translated_apart - before.translated_apart);
      const std::uint64_t skipped = now.at_rest - before.at_rest + now.apart - before.apart +
                                    now.translated_apart - before.translated_apart;
      count.add(Counter::bodies_skipped, skipped);
      count.add(Counter::nodes_skipped, skipped * nodes);
    }
  }

 private:
  std::vector<typename LinearBounds<S>::Counts> before_;
};

extern template class LinearBounds<float>;
extern template class LinearBounds<double>;

}  // namespace kbvh
