#pragma once
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "core/families/separation/pair_tree.hpp"
#include "core/families/separation/segment_overlap.hpp"

namespace kbvh {

/// How far ahead the next event of a pair of boxes is searched.
enum class LookAhead : std::uint8_t {
  pieces,  ///< a fixed number of linear pieces (OverlapClock)
  /// Until the current segment ends. Requires keyframe times that all moving bodies share; otherwise `pieces`
  /// applies. When the next segment begins, all pairs without an event are checked again.
  segment,
};

/// Decides whether pairs of boxes overlap, and when that changes. Uses the signs of their gaps at both ends
/// of the segment where these signs suffice (SegmentOverlap), and OverlapClock otherwise.
template <class S>
class PairOutlook {
 public:
  /// The known state of a pair right after an instant.
  enum class State : std::uint8_t { unknown, apart, overlapping };
  /// Whether boxes overlap right after an instant, and whether that changes later. `event()` is the instant
  /// of the change.
  struct Outlook {
    bool overlapping, changes;
  };

  template <class Forest>
  PairOutlook(const SceneView<S>& scene, const Forest& forest, const PairTree& tree, LookAhead look_ahead,
              int pieces)
      : clock_(pieces),
        tree_(&tree),
        hulls_(plans_of(scene, forest)),
        boxes_(plans_of(scene, forest), scene.pairs(), hulls_) {
    for (std::uint32_t body = 0; body < scene.body_count(); ++body)
      bodies_.push_back({nullptr, &forest.clock().plans(body)});
    by_segments_ = look_ahead == LookAhead::segment && boxes_.usable();
  }

  const OverlapClock<S>& clock() const { return clock_; }
  RealisedBox<S> box(std::uint32_t body, std::uint32_t node) const {
    return {bodies_[body].plans, bodies_[body].realisers + std::size_t(6) * node, hulls_.lower(body),
            hulls_.upper(body)};
  }

  /// Rereads the addresses of the trees' realisers, and makes room for all their nodes.
  template <class Forest>
  void read_trees(const Forest& forest) {
    for (std::uint32_t body = 0; body < bodies_.size(); ++body) {
      const Topology& topology = tree_->topology(body);
      bodies_[body].realisers = topology.empty() ? nullptr : forest.tree(body).realisers(0);
      if (by_segments_) boxes_.follow_tree(body, topology.size(), bodies_[body].realisers);
    }
  }
  /// Restarts at t.
  void start(double t) {
    hulls_.start();
    if (by_segments_) boxes_.start(t);
  }
  /// Returns the end of the current segment; infinite if there is none.
  double segment_end() const { return by_segments_ ? boxes_.end() : std::numeric_limits<double>::infinity(); }
  /// Advances to the next segment, and returns its begin.
  double open_segment() {
    boxes_.next_segment();
    for (std::uint32_t body = 0; body < bodies_.size(); ++body)
      boxes_.make_all(body, [&](std::uint32_t node) { return tree_->has_pairs(body, node); });
    return boxes_.begin();
  }
  /// Updates the boxes whose realisers, or whose realisers' plans, have changed.
  void take_over(std::span<const ChangedBoxes::Box> boxes) {
    if (!by_segments_) return;
    for (const auto& box : boxes)
      if (box.side == ChangedBoxes::all_sides)
        boxes_.node_changed(box.body, box.node);
      else
        boxes_.side_changed(box.body, box.node, box.side);
  }
  /// Prefetches the boxes of a pair.
  void prefetch(const BoxPair& pair) const {
    if (!by_segments_ || !pair.used) return;
    boxes_.prefetch(tree_->body_of(pair, 0), BoxRole::first, pair.a);
    boxes_.prefetch(tree_->body_of(pair, 1), BoxRole::second, pair.b);
  }
  /// Prefetches the data that an event of a pair will read: in step 0 the pair; in step 1 its boxes, and its
  /// nodes or the pairs below it; in step 2 the boxes and rows of the pairs that it will make, or the rows of
  /// the pairs below it.
  void fetch_ahead(std::uint32_t slot, int step) const {
    if (step == 0) return tree_->prefetch(slot);
    const BoxPair& pair = (*tree_)[slot];
    if (!pair.used) return;
    if (step == 1) {
      prefetch(pair);
      pair.children != PairTree::none ? tree_->prefetch_block(pair.children) : tree_->prefetch_nodes(pair);
    } else if (pair.children != PairTree::none) {
      tree_->for_block(pair.children, [&](std::uint32_t child) { tree_->prefetch_rows((*tree_)[child]); });
    } else if (!pair.overlapping) {
      tree_->for_children(pair, [&](std::uint32_t body, std::uint32_t node) { fetch_ahead(body, node, 0); });
    }
  }
  /// Prefetches the data that a change of a node's box will read: in step 0 its boxes and its rows of pairs,
  /// in step 1 the pairs in the rows.
  void fetch_ahead(std::uint32_t body, std::uint32_t node, int step) const {
    if (!by_segments_) return;
    if (step == 0) {
      tree_->prefetch_rows(body, node);
      boxes_.prefetch(body, BoxRole::first, node);
      boxes_.prefetch(body, BoxRole::second, node);
    } else {
      for (const int side : {0, 1}) __builtin_prefetch(tree_->row(body, side, node).data());
    }
  }
  /// Prefetches the positions of a vertex at the ends of the segment.
  void prefetch_vertex(std::uint32_t body, std::uint32_t vertex) const {
    if (by_segments_) boxes_.prefetch_vertex(body, vertex);
  }

  /// Makes room for pairs.
  void grow(std::uint32_t slots) {
    if (slots > gaps_.size()) gaps_.resize(slots, all_reasons);
  }
  /// Returns the gaps (SegmentOverlap) that a changed box may have shrunk, seen from the pairs that have the
  /// box on the given side. Between changes of plans, a new realiser is ahead of the old one until the
  /// segment ends. It can therefore shrink a gap only by the rounding of the inflation, or before the current
  /// time. In a body with plans of its own, or on curves, any gap may shrink or grow.
  std::uint8_t changed_gaps(const ChangedBoxes::Box& box, int side) const {
    const FlightPlans<S>& plans = *bodies_[box.body].plans;
    if (!by_segments_ || box.side == ChangedBoxes::all_sides || plans.has_own_plans() || plans.curved())
      return all_reasons;
    return std::uint8_t(1U << SegmentBoxes<S>::lane_of(BoxRole(side), box.side));
  }
  /// Returns whether the last decision about a pair depends on one of the given gaps.
  bool depends_on(std::uint32_t slot, std::uint8_t gaps) const { return (gaps_[slot] & gaps) != 0; }

  /// Finds the state of a pair right after `now`, unless `known` gives it, and the next change of that state.
  Outlook predict(std::uint32_t slot, const Moment<S>& now, State known) {
    using Kind = typename SegmentOverlap<S>::Kind;
    const BoxPair& pair = (*tree_)[slot];
    const std::uint32_t body_a = tree_->body_of(pair, 0), body_b = tree_->body_of(pair, 1);
    if (by_segments_) {
      const SegmentBox<S>&a = boxes_.box(body_a, BoxRole::first, pair.a),
            &b = boxes_.box(body_b, BoxRole::second, pair.b);
      const auto [kind, gaps] = SegmentOverlap<S>::decide(a, b);
      gaps_[slot] = gaps | other_reasons;
      if (kind == Kind::apart || kind == Kind::overlapping)
        return {known == State::unknown ? kind == Kind::overlapping : known == State::overlapping, false};
      if (kind == Kind::changes) {
        const SegmentOverlap<S> overlap(boxes_, body_a, a, body_b, b);
        return predict(
            pair, slot, known, [&] { return overlap.overlap_after(now); },
            [&] { return overlap.next_separation(event_); },
            [&] { return overlap.next_overlap(now, event_); });
      }
    }
    const RealisedBox<S> a = box(body_a, pair.a), b = box(body_b, pair.b);
    const Instant<S>& instant = now.instant;
    return predict(
        pair, slot, known, [&] { return clock_.overlap_after(a, b, instant); },
        [&] { return clock_.next_separation(a, b, instant, event_); },
        [&] { return clock_.next_overlap(a, b, instant, event_); });
  }
  /// Returns the event of the last pair that `predict` examined. Valid only if the state of the pair changes.
  const OverlapEvent<S>& event() const { return event_; }

  std::size_t bytes() const { return boxes_.bytes() + hulls_.bytes() + gaps_.capacity(); }

 private:
  struct BodyPlans {
    const std::uint32_t* realisers;
    const FlightPlans<S>* plans;
  };

  template <class OverlapAfter, class NextSeparation, class NextOverlap>
  Outlook predict(const BoxPair& pair, std::uint32_t slot, State known, const OverlapAfter& overlap_after,
                  const NextSeparation& next_separation, const NextOverlap& next_overlap) {
    event_.slot = slot;
    event_.depth = pair.depth;
    const bool overlapping = known == State::unknown ? overlap_after() : known == State::overlapping;
    return {overlapping, overlapping ? next_separation() : next_overlap()};
  }
  template <class Forest>
  static std::vector<const FlightPlans<S>*> plans_of(const SceneView<S>& scene, const Forest& forest) {
    std::vector<const FlightPlans<S>*> plans;
    for (std::uint32_t body = 0; body < scene.body_count(); ++body)
      plans.push_back(&forest.clock().plans(body));
    return plans;
  }

  OverlapClock<S> clock_;
  const PairTree* tree_;
  CurveHulls<S> hulls_;
  SegmentBoxes<S> boxes_;
  bool by_segments_ = false;
  std::vector<BodyPlans> bodies_;
  /// In a set of gaps: the bit of all other reasons to decide a pair again; every decision depends on it.
  static constexpr std::uint8_t other_reasons = 0x40;
  static constexpr std::uint8_t all_reasons = other_reasons | SegmentOverlap<S>::all_gaps;

  std::vector<std::uint8_t> gaps_;  ///< [slot] on which the last decision about a pair depends
  OverlapEvent<S> event_;
};

}  // namespace kbvh
