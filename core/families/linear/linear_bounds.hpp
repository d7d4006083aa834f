#pragma once
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include "core/contract/strategy.hpp"
#include "core/families/linear/bounds_cache.hpp"
#include "core/families/linear/linear_segment.hpp"
#include "core/families/linear/linear_settings.hpp"
#include "core/families/wide/near_bodies.hpp"

namespace kbvh {

/// Bounds of all bodies of a scene over a segment in which every vertex of every body keeps to one line:
/// boxes at its begin and at its end, linear in between. A maximum of linear functions is convex and lies
/// below its chord, so they hold every vertex throughout; at the ends they are tight. Nothing is updated
/// within a segment, and the boxes at its end are those at the begin of the next one.
///
/// Segments are those of all bodies overlaid: from the latest knot of any plan to the next one, cut as
/// `SegmentCuts` says. Every box is larger by a margin of 8 ulps of the largest coordinate of its body, which
/// is more than all roundings between the flight plans and the positions of frames.
///
/// A body that moves as a whole over a segment has its boxes moved and not made anew, as long as what they
/// gain by rounding is less than the margin.
template <class S>
class LinearBounds {
 public:
  /// Needs topologies of one width and leaf size for all bodies of a pair: throws std::invalid_argument.
  LinearBounds(const SceneView<S>& scene, const SegmentMotion<S>& motion, Topologies topologies,
               KernelSet kernels, const LinearSettings& settings);

  /// Makes the bounds of a segment with the motion's present time in it, as if there had been none before.
  void start();
  /// The same if the present time is not in the segment any more. Returns whether it began a new one.
  bool advance();
  /// The bounds of the whole segment, not of a piece of it, that the motion's present time is in and not the
  /// last of: where `advance` would stay at the end of one, this goes on to the next. Segments are whole
  /// until `start`.
  void enter();
  /// Plans have changed at the motion's present time: the rest of the segment is another one.
  void plans_changed();

  /// Begins with the segment after the present one, of which `motion` says what is seen from its begin on.
  /// Returns whether that can be: not where none follows, where segments are cut by looseness, and from
  /// `enter` to `start`. It is forgotten if plans change, or `advance` does not come into it, or it leaves
  /// the range of numbers.
  bool start_ahead(const SegmentMotion<S>& motion);
  /// Makes more of its bounds, as long as less than so many nodes were done by this call. Returns whether all
  /// are there.
  bool step_ahead(std::uint64_t nodes);
  bool has_ahead() const { return ahead_exists_; }
  /// The segment that `step_ahead` has finished.
  const LinearSegment<S>& ahead() const { return segments_[1 - present_]; }
  /// Did the last `advance` come into a segment that had been begun ahead?
  bool came_ahead() const { return came_ahead_; }
  /// Nodes of all bodies that move in the present segment.
  std::uint64_t nodes_of_segment() const;

  const LinearSegment<S>& segment() const { return segments_[present_]; }
  double begin() const { return segment().begin; }
  double end() const { return segment().end; }
  S fraction(double t) const { return segment().fraction(t); }
  const BodySegmentBounds<S>& side(std::uint32_t body) const { return segment().sides[body]; }
  WideHierarchy<S>& hierarchy(std::uint32_t body) { return bodies_[body].hierarchy; }

  std::uint32_t body_count() const { return std::uint32_t(bodies_.size()); }
  std::uint32_t vertex_count(std::uint32_t body) const { return scene_.vertex_count(body); }

  /// Boxes of a body at a time of the segment, one for each node of its topology, in double; larger than
  /// those that a query reads by nothing but rounding.
  std::vector<Box<double>> boxes_at(std::uint32_t body, double t) const;
  /// The same with what there is no box of marked as stale.
  AuditView audit_view(std::uint32_t body, double t) const;

  /// What was done for a body at ends of segments, and how often it was left alone when one began: at rest,
  /// apart and but for one box, moved as it was, or remembered.
  struct Counts {
    std::uint64_t refitted = 0;  ///< wide nodes
    std::uint64_t at_rest = 0, apart = 0, translated = 0, translated_apart = 0, remembered = 0;
  };
  /// Since `start`.
  const Counts& counts(std::uint32_t body) const { return counts_[body]; }

  std::size_t bytes() const;

 private:
  struct Segment : LinearSegment<S> {
    double knot = 0;  ///< end of the whole segment of which it may be a piece
    std::uint32_t pieces = 1;
    bool endless = false;  ///< of lines without an end, and as long as can be told: not to be cut
  };
  /// Boxes that are being made, from the last node to the first.
  struct Refit {
    S *child_bounds = nullptr, *node_bounds = nullptr;
    const S* positions = nullptr;
    std::uint32_t left = 0;  ///< nodes
    typename BoundsCache<S>::Boxes* remembered = nullptr;
  };
  /// Where the work on the segment ahead is.
  struct Ahead {
    std::optional<SegmentMotion<S>> motion;
    std::uint32_t body = 0;  ///< the next one
    Refit refit;             ///< of the one before
    bool finished = false;
  };
  /// What becomes of the segment before the one that is made.
  enum class Before : std::uint8_t { ends, stays };
  static constexpr double none = -std::numeric_limits<double>::infinity();  ///< the end of no segment

  void restart();
  void note_time();
  void next_segment();
  void forget_ahead();
  /// Of what is left alone: in the segment ahead it only counts when that is taken.
  Counts& left_alone(std::uint32_t body) { return ahead_exists_ ? ahead_counts_[body] : counts_[body]; }
  void choose_segment(Segment& segment, const SegmentMotion<S>& motion, double t) const;
  bool begin_side(Segment& segment, const Segment& before, const SegmentMotion<S>& motion, std::uint32_t body,
                  double t, Before what);
  void cut_while_loose(double t);
  double looseness_in_the_middle();
  Refit begin_end(Segment& segment, const SegmentMotion<S>& motion, std::uint32_t body, std::uint32_t end,
                  double t);
  void step_refit(std::uint32_t body, Refit& refit, std::uint64_t nodes);
  bool make_end(Segment& segment, const SegmentMotion<S>& motion, std::uint32_t body, std::uint32_t end,
                double t);
  void finish(Segment& segment, const SegmentMotion<S>& motion);
  void make_margin(BodySegmentBounds<S>& side) const;

  SceneView<S> scene_;
  SegmentMotion<S> motion_;
  SegmentCuts cuts_;
  BoundsCache<S> memory_;
  NearBodies near_bodies_;
  bool whole_ = false;          ///< segments are not to be cut
  double last_ = 0, step_ = 0;  ///< time of the last frame, and from the one before
  double foreseen_ = 1;         ///< frames that a segment without an end is made for
  std::vector<LinearBody<S>> bodies_;
  Segment segments_[2];
  std::uint32_t present_ = 0;
  Ahead ahead_;
  bool ahead_exists_ = false, came_ahead_ = false;
  AlignedArray<S> middle_lanes_, middle_own_;  ///< tight boxes in the middle of a piece, if somebody looks
  std::vector<S> middle_room_;
  std::vector<Counts> counts_, ahead_counts_;  ///< by body
  std::vector<std::uint8_t> near_;             ///< by body: to another one, over the segment
};

/// Counts what bounds do as updates of a strategy.
template <class S>
class LinearCounts {
 public:
  explicit LinearCounts(std::uint32_t bodies) : before_(bodies) {}

  /// Forgets what was done up to now.
  void skip(const LinearBounds<S>& bounds) {
    for (std::uint32_t body = 0; body < bounds.body_count(); ++body) before_[body] = bounds.counts(body);
  }
  /// Counts what was done since it was asked last.
  template <class Count>
  void add_to(Count& count, LinearBounds<S>& bounds) {
    for (std::uint32_t body = 0; body < bounds.body_count(); ++body) {
      const auto& hierarchy = bounds.hierarchy(body);
      const auto now = bounds.counts(body), before = std::exchange(before_[body], now);
      const std::uint64_t nodes = hierarchy.topology().size();
      // Parts of refits, such that they add up to whole ones.
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
      count.add(Counter::bodies_remembered, now.remembered - before.remembered);
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
