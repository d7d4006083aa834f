#pragma once
#include <utility>
#include <vector>

#include "core/hierarchy/wide_hierarchy.hpp"
#include "core/kernels/wide_linear.hpp"
#include "core/strategy.hpp"

namespace kbvh {

/// How segments between knots are cut: into pieces of one length, or, where boxes are looser than a bound,
/// into more.
struct SegmentCuts {
  static constexpr std::uint32_t most = 64;
  std::uint32_t pieces = 1;  ///< 1 to `most`
  /// Summed surface of boxes over that of tight ones, minus one, in the middle of a piece, for all bodies
  /// that move; twice as many pieces until it is kept. 0: nobody looks.
  double max_looseness = 0;
};

/// Bounds of all bodies of a scene over a segment in which every vertex of every body keeps to one line:
/// boxes at its begin and at its end, linear in between. A maximum of linear functions is convex and lies
/// below its chord, so they hold every vertex throughout; they are tight at the ends. Nothing is updated
/// within a segment, and the boxes at its end are those at the begin of the next one.
///
/// Segments are those of all bodies overlaid: from the latest knot of any plan to the next one, cut into
/// `pieces` of one length. Every box is larger by a margin of 8 ulps of the largest coordinate of its body,
/// which is more than all roundings between the flight plans and the positions of frames.
template <class S>
class LinearBounds {
 public:
  /// One body over the present segment; index 0 is its begin, 1 its end. A body at rest has one and the same.
  struct Side {
    WideHierarchy<S> hierarchy;  ///< its topology; its boxes are free to be used
    AlignedArray<S> lanes[2], own[2];
    std::vector<S> room[2];
    const S* positions[2] = {nullptr, nullptr};  ///< by end
    std::uint32_t made[2] = {0, 0};  ///< how often each array's positions were made, both counted as one
    std::uint32_t first = 0;         ///< which array holds the begin
    bool at_rest = false, current = false;
    /// It met no other body's box over this segment: of its boxes there is the root's and no other.
    bool apart = false;
    S margin = 0;

    std::uint32_t array(std::uint32_t end) const { return at_rest ? first : (first + end) % 2; }
    WideEnds<S> ends() const {
      return {{lanes[array(0)].data(), lanes[array(1)].data()},
              {own[array(0)].data(), own[array(1)].data()},
              margin};
    }
  };

  /// Needs topologies of one width and leaf size for all bodies of a pair: throws std::invalid_argument.
  LinearBounds(const SceneView<S>& scene, const SegmentMotion<S>& motion, Topologies topologies,
               KernelSet kernels, const SegmentCuts& cuts);

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

  /// First and last time of the segment; its end may be infinite if nothing moves.
  double begin() const { return begin_; }
  double end() const { return end_; }
  /// Where the segment a time lies in it, from 0 to 1.
  S fraction(double t) const;

  const SceneView<S>& scene() const { return scene_; }
  std::uint32_t body_count() const { return std::uint32_t(sides_.size()); }
  std::uint32_t vertex_count(std::uint32_t body) const { return scene_.vertex_count(body); }
  Side& side(std::uint32_t body) { return sides_[body]; }
  const Side& side(std::uint32_t body) const { return sides_[body]; }

  /// Boxes of a body at a time of the segment, one for each node of its topology, in double; larger than
  /// those that a query reads by nothing but rounding.
  std::vector<Box<double>> boxes_at(std::uint32_t body, double t) const;
  /// The same with what there is no box of marked as stale.
  AuditView audit_view(std::uint32_t body, double t) const;

  /// How often a body was left alone when a segment began, since this was asked last: at rest, or apart and
  /// but for one box.
  struct Skipped {
    std::uint64_t at_rest = 0, apart = 0;
  };
  Skipped take_skipped(std::uint32_t body) { return std::exchange(skipped_[body], {}); }
  /// How often boxes were made at an end of a segment, since this was asked last.
  std::uint64_t take_refits(std::uint32_t body) { return std::exchange(refits_[body], 0); }

  std::size_t bytes() const;

 private:
  void restart();
  void note_time();
  void go_on();
  void choose_segment(double t);
  void cut_while_loose(double t);
  double looseness_in_the_middle();
  bool make_end(std::uint32_t body, std::uint32_t end, double t);
  void part_bodies();
  Box<S> swept(const Side& side) const;
  void make_margin(Side& side) const;

  SceneView<S> scene_;
  SegmentMotion<S> motion_;
  SegmentCuts cuts_;
  std::uint32_t pieces_;
  bool whole_ = false;                         ///< segments are not to be cut
  double begin_ = 0, end_ = 0, knot_ = 0;      ///< of the piece; end of the whole segment
  AlignedArray<S> middle_lanes_, middle_own_;  ///< tight boxes in the middle of a piece, if somebody looks
  std::vector<S> middle_room_;
  double last_ = 0, step_ = 0;  ///< time of the last frame, and from the one before
  double foreseen_ = 1;         ///< frames that a segment without an end is made for
  std::vector<Side> sides_;
  std::vector<std::uint64_t> refits_;
  std::vector<Skipped> skipped_;
  std::vector<std::uint8_t> near_;  ///< by body: to another one, over the segment
};

/// The parameters `pieces` and `max_looseness` of strategies with linear bounds, and what they say. Throws
/// ConfigError.
std::vector<Parameter> segment_cut_parameters();
SegmentCuts segment_cuts(const Params& params);

/// Counts the ends that were made since `bounds` was asked last, as updates.
template <class S, class Count>
void count_linear_update(LinearBounds<S>& bounds, Count& count) {
  for (std::uint32_t body = 0; body < bounds.body_count(); ++body) {
    const auto& hierarchy = bounds.side(body).hierarchy;
    const std::uint64_t ends = bounds.take_refits(body), nodes = hierarchy.topology().size();
    count.add(Counter::nodes_visited, ends * nodes);
    count.add(Counter::values_written, 6 * ends * nodes);
    count.add(Counter::vertex_reads, ends * hierarchy.leaf_vertex_count());
    const auto skipped = bounds.take_skipped(body);
    count.add(Counter::vertex_reads, skipped.apart * bounds.vertex_count(body));
    count.add(Counter::bodies_skipped, skipped.at_rest + skipped.apart);
    count.add(Counter::nodes_skipped, (skipped.at_rest + skipped.apart) * nodes);
  }
}

extern template class LinearBounds<float>;
extern template class LinearBounds<double>;

}  // namespace kbvh
