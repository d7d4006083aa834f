#pragma once
#include <algorithm>
#include <cstdint>
#include <limits>
#include <string_view>
#include <vector>

#include "core/base/assert.hpp"
#include "core/families/events/event_queue.hpp"
#include "core/families/events/kinetic_forest.hpp"
#include "core/families/separation/overlapping_leaves.hpp"
#include "core/families/separation/pair_events.hpp"
#include "core/families/separation/pair_outlook.hpp"
#include "core/families/separation/pair_tree.hpp"

namespace kbvh {

/// The work of a separation list after a change of geometry, in pairs.
struct ListEdit {
  std::uint64_t removed = 0;  ///< removed from the tree of pairs
  std::uint64_t decided = 0;  ///< decided again: new pairs, pairs with other children, pairs with other boxes
};

/// The separation list of kinetic incremental collision detection (Z&W s.7), for body pairs of a scene: the
/// pairs of boxes at which a simultaneous traversal would stop now, maintained from event to event.
///
/// The pairs form a tree: a pair's parent is the pair of their parents (a leaf against an inner node descends
/// on one side only). The list consists of the pairs that do not overlap and the overlapping pairs of leaves;
/// overlapping inner pairs are their ancestors. Each pair has at most one event in the queue:
///   apart: the boxes begin to overlap ("BV-overlap"). An inner pair gets children, which may overlap in
///     turn.
///   inner, overlapping: the boxes separate ("parents do not overlap"). All pairs below are removed. The
///     paper schedules this event with each child and has to insert the parent once; here the event belongs
///     to the parent.
///   leaves, overlapping: the boxes separate ("leaves do not overlap").
/// If the event is too far ahead, the pair has a review instead, at which only its next event is searched
/// (OverlapClock). A review counts as an operation on the queue.
/// When a box changes ("BV change": a new realiser, or a new plan of a realiser), the pairs that have the box
/// are decided again, unless the change cannot affect their decision.
///
/// Insertions and deletions change the trees below a few nodes. The pairs of such a node stay, the pairs
/// below them are removed, and the remaining pairs are decided again on the changed trees. A pair of a
/// removed node lies below a pair of the node's former parent, which counts as changed. No other pair is
/// examined.
///
/// Within one body, a node always overlaps itself, which needs no event. Below such a self pair there is one
/// pair for every two of the node's children. These pairs are roots of the tree of pairs; the list is
/// therefore never shorter than the number of inner nodes of the tree. The pair of a leaf with itself is in
/// no list.
///
/// Body pairs have numbers. A list of all pairs of a scene numbers them as the scene does. In a scene of many
/// pairs only those that may meet are entered (`enter`), and pairs whose roots are apart can be removed
/// (`leave`). The numbers of removed pairs are reused.
///
/// Boxes are compared on the flight plans with the margin of OverlapClock. The list may contain a pair of
/// boxes that are apart by some ulps, and contains all pairs whose rounded boxes touch. Boxes of a body on
/// curves follow the chains of CurveHulls, which are linear between keyframes: the list may contain pairs of
/// boxes that are apart by as much as a curve leaves its chord.
///
/// With a queue that orders events by segments, a pair has an event only if its boxes begin or cease to
/// overlap before the current segment ends. `open_segment` checks all pairs without an event when the next
/// segment begins. Most of them are decided by the signs of their gaps at the segment's ends
/// (SegmentOverlap).
template <class S, template <class> class Queue>
class SeparationList {
  using Event = OverlapEvent<S>;

 public:
  static constexpr std::uint32_t none = PairTree::none;

  /// The body pairs with which a list begins.
  enum class BodyPairs : std::uint8_t { all, none };

  /// `queue` names the kind of queue, where `Queue` offers a choice.
  template <class Forest>
  SeparationList(const SceneView<S>& scene, const Forest& forest, Counters& count, int look_ahead,
                 BodyPairs pairs, std::string_view queue = {})
      : tree_(forest_topologies(scene, forest), scene.pairs()),
        outlook_(scene, forest, tree_,
                 stores_by_segments<Queue<OverlapClock<S>>>(queue) ? LookAhead::segment : LookAhead::pieces,
                 look_ahead),
        queue_(outlook_.clock(), 0),
        count_(&count) {
    if constexpr (requires { queue_.choose(queue); }) queue_.choose(queue);
    if constexpr (requires { queue_.serve(*this); }) {
      queue_.split_at(forest.clock().keyframe_times());
      queue_.serve(*this);
    }
    read_trees(forest);
    if (pairs == BodyPairs::none) return;
    for (const BodyPair& pair : scene.pairs()) number(pair);
  }
  SeparationList(const SeparationList&) = delete;
  SeparationList& operator=(const SeparationList&) = delete;

  /// Restarts at t, by one traversal per body pair.
  void reset(double t) {
    clear(t);
    for (std::uint32_t i = 0; i < tree_.body_pair_count(); ++i)
      if (tree_.both_have_nodes(i)) start_pair(i, Moment<S>::at(t));
  }

  /// Enters a body pair at t, by one traversal. Returns the number of the body pair.
  std::uint32_t enter(const BodyPair& pair, double t) {
    time_ = end_ = t;
    const std::uint32_t bodies = number(pair);
    if (tree_.both_have_nodes(bodies)) start_pair(bodies, Moment<S>::at(t));
    return bodies;
  }
  /// Removes a pair of two bodies whose root boxes are apart. Returns false, and removes nothing, if they
  /// overlap.
  bool leave(std::uint32_t bodies) {
    const std::uint32_t root = roots_[bodies];
    if (root != none) {
      if (tree_[root].overlapping) return false;
      list_changed(-1);
      remove(root);
      tree_.free_block(root);
      roots_[bodies] = none;
    }
    tree_.leave(bodies);
    return true;
  }
  /// Removes all body pairs, and restarts at t.
  void leave_all(double t) {
    clear(t);
    tree_.leave_all();
    roots_.clear();
    self_roots_.clear();
  }
  /// Returns the number of body-pair numbers, including unused ones.
  std::uint32_t body_pair_count() const { return tree_.body_pair_count(); }
  bool is_entered(std::uint32_t bodies) const { return tree_.is_entered(bodies); }
  const BodyPair& body_pair(std::uint32_t bodies) const { return tree_.body_pair(bodies); }

  bool due(double t) const {
    if constexpr (requires { queue_.due(t); })
      return queue_.due(t);
    else
      return !queue_.empty() && clock().due(queue_.top(), t);
  }
  bool empty() const { return queue_.empty(); }
  decltype(auto) top() const { return queue_.top(); }

  /// Removes the first event from the queue and handles it.
  void handle_next() {
    const Event event = queue_.top();
    queue_.pop();
    count_->add(Counter::queue_operations);
    BoxPair& pair = tree_[event.slot];
    pair.scheduled = false;
    if (event.review) {
      put(event.slot, predict(event.slot, Moment<S>::at(event.hint), state(pair)));
      return;
    }
    count_->add(Counter::certificates_failed);
    count_->add(pair.overlapping ? kind_of_separation(pair) : Counter::overlap_events);
    time_ = event.not_after();
    end_ = event.not_before();
    const Moment<S> now{{time_, end_, &event.crossing}, event.hint, event.error};
    turn(event.slot, now, predict(event.slot, now, pair.overlapping ? State::apart : State::overlapping));
  }

  /// Prefetches the data that an event of a pair will read (PairOutlook).
  void fetch_ahead(const Event& /*event*/, std::uint32_t slot, int step) const {
    outlook_.fetch_ahead(slot, step);
  }
  /// Does nothing: pairs without an event are checked again at the begin of the next segment.
  void review(const Event& /*event*/, double /*t*/) {}
  /// Prefetches the data that a change of a node's box will read; in step 0 also the positions of the vertex
  /// that will realise a bound.
  void fetch_ahead(std::uint32_t body, std::uint32_t node, std::uint32_t vertex, int step) const {
    outlook_.fetch_ahead(body, node, step);
    if (step == 0) outlook_.prefetch_vertex(body, vertex);
  }

  /// Returns the end of the current segment; infinite if there is none. `open_segment` is due at that time,
  /// before any event at or after it.
  double segment_end() const { return outlook_.segment_end(); }
  /// Advances to the next segment, and schedules the pairs that have an event in it.
  void open_segment() {
    const Moment<S> now = Moment<S>::at(outlook_.open_segment());
    const std::uint32_t slots = tree_.slots();
    constexpr std::uint32_t ahead = 12;
    for (std::uint32_t slot = 0; slot < slots; ++slot) {
      if (slot + ahead < slots) outlook_.prefetch(tree_[slot + ahead]);
      const BoxPair& pair = tree_[slot];
      if (pair.used && !pair.scheduled) put(slot, predict(slot, now, state(pair)));
    }
  }

  /// Updates the boxes whose realisers, or whose realisers' plans, have changed. Returns whether any of the
  /// boxes is in a pair; if so, the caller must call `boxes_changed`.
  bool take_over(std::span<const ChangedBoxes::Box> boxes) {
    outlook_.take_over(boxes);
    return std::any_of(boxes.begin(), boxes.end(),
                       [&](const auto& box) { return tree_.has_pairs(box.body, box.node); });
  }
  /// Decides again the pairs of boxes that have changed at `now`, if the change affects their decision. Boxes
  /// may be listed twice.
  void boxes_changed(std::span<const ChangedBoxes::Box> boxes, const Moment<S>& now) {
    time_ = now.instant.begin;
    end_ = now.instant.end;
    // A node that a change of geometry removed no longer has pairs.
    for (const auto& box : boxes) {
      affected_.clear();
      std::size_t pairs = 0;
      for (const int side : {0, 1}) {
        const auto row = tree_.row(box.body, side, box.node);
        const std::uint8_t gaps = outlook_.changed_gaps(box, side);
        pairs += row.size();
        for (const std::uint32_t slot : row)
          if (outlook_.depends_on(slot, gaps)) affected_.push_back(slot);
      }
      if (pairs == 0) continue;
      count_->add(Counter::bound_change_events);
      count_->add(Counter::nodes_visited, pairs);
      for (const std::uint32_t slot : affected_) outlook_.prefetch(tree_[slot]);
      for (const std::uint32_t slot : affected_) {
        // Skips a pair that a collapse has removed, and a slot that an expansion has reused for other nodes.
        if (!tree_[slot].used || !tree_.has_node(slot, box.body, box.node)) continue;
        ++work_done_.decided;
        const Outlook outlook = predict(slot, now, State::unknown);
        if (outlook.overlapping != tree_[slot].overlapping)
          turn(slot, now, outlook);
        else
          put(slot, outlook);
      }
    }
  }

  /// Applies a change of geometry at t, after all edits of the trees of `forest`. `nodes` and `boxes` are the
  /// notices of the trees, in their order; this function sorts `boxes`. Visits the pairs below those of
  /// changed nodes, and the pairs of changed boxes; if a root changes, the whole list of the body pair.
  /// Memory is O(nodes) the first time, then amortised O(change). Pairs within one body are all rebuilt. Not
  /// allowed between start_spans and stop_spans.
  template <class Forest>
  ListEdit geometry_changed(double t, const Forest& forest, std::span<const ChangedBoxes::Node> nodes,
                            std::vector<ChangedBoxes::Box>& boxes) {
    KBVH_ASSERT(!is_recording());
    const auto now = Moment<S>::at(t);
    time_ = t;
    work_done_ = {};
    read_trees(forest);
    for (auto& box : boxes) box.side = ChangedBoxes::all_sides;
    take_over(boxes);
    for (std::uint32_t i = 0; i < tree_.body_pair_count(); ++i) remove_self_pairs(i);
    remove_changed(nodes);
    for (const std::uint32_t slot : tops_) {
      work_.assign(1, slot);
      settle_new(now);
    }
    for (std::uint32_t i = 0; i < tree_.body_pair_count(); ++i)
      if (roots_[i] == none && self_roots_[i].empty() && tree_.both_have_nodes(i)) start_pair(i, now);
    std::sort(boxes.begin(), boxes.end());
    boxes.erase(std::unique(boxes.begin(), boxes.end()), boxes.end());
    boxes_changed(boxes, now);
    leaves_.reread_primitives(tree_);
    return work_done_;
  }

  /// Describes an event of the list in the contract's terms.
  ScheduledEvent<S> described(const Event& event) const { return kbvh::described(tree_, event); }
  /// Appends all scheduled events, earliest first.
  void list_events(std::vector<ScheduledEvent<S>>& out) const { append_events(queue_, clock(), tree_, out); }

  /// Returns the overlapping leaves of one body pair, unordered.
  std::span<const OverlappingLeaves> leaf_pairs(std::size_t body_pair) const { return leaves_.of(body_pair); }
  /// Returns the primitive pairs of these leaves, in the same order, if every leaf of both bodies has exactly
  /// one primitive; otherwise nothing.
  std::span<const PrimitivePair> primitive_pairs(std::size_t body_pair) const {
    return leaves_.primitives_of(body_pair);
  }
  /// Returns the number of pairs in the list: pairs that are apart, and overlapping leaves.
  std::size_t size() const { return list_size_; }
  /// Returns all pairs by slot, for audits.
  std::span<const BoxPair> pairs() const { return tree_.pairs(); }
  const OverlapClock<S>& clock() const { return outlook_.clock(); }
  /// Returns the box of a node that is compared with others.
  RealisedBox<S> box(std::uint32_t body, std::uint32_t node) const { return outlook_.box(body, node); }

  /// Starts recording ended overlaps of leaves. Overlaps that last already count from t.
  void start_spans(double t) { leaves_.start_spans(t); }
  bool is_recording() const { return leaves_.is_recording(); }
  /// Stops recording, and returns the overlaps that ended since `start_spans`. Overlaps that last are in
  /// `leaf_pairs`.
  std::span<const EndedOverlap> stop_spans() { return leaves_.stop_spans(); }
  /// Returns the overlapping leaves, which can note changes of the pairs that `primitive_pairs` returns.
  LeafOverlaps& overlaps() { return leaves_; }

  std::uint64_t steps() const { return queue_.steps(); }
  std::size_t bytes() const {
    return queue_.bytes() + tree_.bytes() + outlook_.bytes() + leaves_.bytes() +
           (work_.capacity() + affected_.capacity() + roots_.capacity() + tops_.capacity()) *
               sizeof(std::uint32_t) +
           self_roots_.capacity() * sizeof(self_roots_[0]);
  }

 private:
  using State = typename PairOutlook<S>::State;
  using Outlook = typename PairOutlook<S>::Outlook;

  template <class Forest>
  static std::vector<const Topology*> forest_topologies(const SceneView<S>& scene, const Forest& forest) {
    std::vector<const Topology*> topologies;
    for (std::uint32_t body = 0; body < scene.body_count(); ++body)
      topologies.push_back(&forest.tree(body).topology());
    return topologies;
  }
  /// Rereads the addresses of the trees' realisers, and makes room for all their nodes.
  template <class Forest>
  void read_trees(const Forest& forest) {
    tree_.follow_topologies();
    outlook_.read_trees(forest);
  }
  void clear(double t) {
    queue_.clear();
    tree_.clear();
    outlook_.start(t);
    time_ = t;
    list_size_ = 0;
    leaves_.clear();
    std::fill(roots_.begin(), roots_.end(), none);
    for (auto& roots : self_roots_) roots.clear();
  }
  std::uint32_t number(const BodyPair& pair) {
    const std::uint32_t bodies = tree_.enter(pair);
    if (bodies == roots_.size()) {
      roots_.push_back(none);
      self_roots_.emplace_back();
      leaves_.resize(roots_.size());
    }
    return bodies;
  }
  /// Builds the list of a body pair that has none.
  void start_pair(std::uint32_t bodies, const Moment<S>& now) {
    work_.clear();
    if (tree_.body_pair(bodies).first == tree_.body_pair(bodies).second) {
      tree_.insert_self_roots(
          bodies, [&](std::uint32_t block) { self_roots_[bodies].push_back(block); },
          [&](std::uint32_t slot) { work_.push_back(slot); });
    } else {
      roots_[bodies] = tree_.new_block();
      tree_.insert(roots_[bodies], bodies, 0, 0, none, 0);
      work_.push_back(roots_[bodies]);
    }
    settle_new(now);
  }
  /// Removes all pairs within a body, if there are any.
  void remove_self_pairs(std::uint32_t bodies) {
    for (const std::uint32_t block : self_roots_[bodies]) {
      tree_.for_block(block, [&](std::uint32_t slot) {
        unsettle(slot);
        remove(slot);
      });
      tree_.free_block(block);
    }
    self_roots_[bodies].clear();
  }
  /// Removes all pairs below those of changed nodes. Leaves the highest of the latter in `tops_`, undecided.
  /// Removes the root pairs of a body without nodes.
  void remove_changed(std::span<const ChangedBoxes::Node> nodes) {
    tree_.find_highest_changed(nodes, tops_);
    for (const std::uint32_t slot : tops_) unsettle(slot);
    for (std::uint32_t i = 0; i < tree_.body_pair_count(); ++i) {
      const std::uint32_t root = roots_[i];
      if (root == none || tree_.both_have_nodes(i)) continue;
      // The body's last node was its root. This pair is therefore one of `tops_`, and the only pair of its
      // list.
      [[maybe_unused]] const std::size_t found = std::erase(tops_, root);
      KBVH_ASSERT(found == 1);
      remove(root);
      tree_.free_block(root);
      roots_[i] = none;
    }
  }
  /// Resets a pair to undecided, for `settle_new`.
  void unsettle(std::uint32_t slot) {
    tree_[slot].overlapping = false;
    if (tree_[slot].place != none) leaves_.end(tree_, slot, end_);
    if (tree_[slot].children != none)
      remove_below(slot);
    else
      list_changed(-1);
  }

  static State state(const BoxPair& pair) { return pair.overlapping ? State::overlapping : State::apart; }
  Counter kind_of_separation(const BoxPair& pair) const {
    return tree_.both_leaves(pair) ? Counter::leaves_apart_events : Counter::parents_apart_events;
  }
  void remove(std::uint32_t slot) {
    tree_.remove(slot);
    cancel(slot);
    ++work_done_.removed;
  }
  void cancel(std::uint32_t slot) {
    if (!tree_[slot].scheduled) return;
    tree_[slot].scheduled = false;
    queue_.cancel(slot);
    count_->add(Counter::certificates_discarded);
    count_->add(Counter::queue_operations);
  }

  /// Decides the new pairs in `work_`, and makes all pairs below them that have to exist.
  void settle_new(const Moment<S>& now) {
    grow();
    while (!work_.empty()) {
      const std::uint32_t slot = work_.back();
      work_.pop_back();
      count_->add(Counter::nodes_visited);
      ++work_done_.decided;
      list_changed(1);
      const Outlook outlook = predict(slot, now, State::unknown);
      put(slot, outlook);
      if (outlook.overlapping) begin_overlap(slot);
    }
  }

  /// Marks a pair of the list as overlapping. Leaves its new children, if there are any, in `work_`.
  void begin_overlap(std::uint32_t slot) {
    tree_[slot].overlapping = true;
    if (tree_.both_leaves(tree_[slot])) return leaves_.begin(tree_, slot, time_);
    list_changed(-1);
    tree_.insert_children(slot, [&](std::uint32_t child) { work_.push_back(child); });
    grow();
  }

  /// Switches a pair between apart and overlapping at `now`, and schedules its next event from `outlook`.
  void turn(std::uint32_t slot, const Moment<S>& now, const Outlook& outlook) {
    put(slot, outlook);
    if (!tree_[slot].overlapping) {
      work_.clear();
      begin_overlap(slot);
      settle_new(now);
      return;
    }
    tree_[slot].overlapping = false;
    if (tree_[slot].place != none) {
      leaves_.end(tree_, slot, end_);
    } else {
      remove_below(slot);
      list_changed(1);
    }
  }

  void remove_below(std::uint32_t top) {
    work_.assign(1, tree_[top].children);
    tree_[top].children = none;
    while (!work_.empty()) {
      const std::uint32_t block = work_.back();
      work_.pop_back();
      tree_.for_block(block, [&](std::uint32_t slot) {
        count_->add(Counter::nodes_visited);
        if (tree_[slot].place != none) leaves_.end(tree_, slot, end_);
        if (tree_[slot].children != none)
          work_.push_back(tree_[slot].children);
        else
          list_changed(-1);
        remove(slot);
      });
      tree_.free_block(block);
    }
  }

  Outlook predict(std::uint32_t slot, const Moment<S>& now, State known) {
    count_->add(Counter::certificates_made);
    return outlook_.predict(slot, now, known);
  }
  /// Replaces the pair's event in the queue by its next one.
  void put(std::uint32_t slot, const Outlook& outlook) {
    cancel(slot);
    if (!outlook.changes) return;
    tree_[slot].scheduled = true;
    queue_.schedule(outlook_.event());
    count_->add(Counter::queue_operations);
    count_->peak(Counter::queue_peak, queue_.size());
  }

  /// Makes room for all pairs of the tree.
  void grow() {
    queue_.grow(tree_.slot_capacity());
    outlook_.grow(tree_.slot_capacity());
  }
  void list_changed(int by) {
    list_size_ += std::size_t(by);
    count_->peak(Counter::list_peak, list_size_);
  }

  PairTree tree_;
  PairOutlook<S> outlook_;
  Queue<OverlapClock<S>> queue_;
  Counters* count_;
  LeafOverlaps leaves_;
  std::size_t list_size_ = 0;
  std::vector<std::uint32_t> roots_;                    ///< slot of each body pair's root pair, or none
  std::vector<std::vector<std::uint32_t>> self_roots_;  ///< [body pair] blocks of roots within one body
  std::vector<std::uint32_t> work_, affected_, tops_;
  ListEdit work_done_;         ///< since the last change of geometry began
  double time_ = 0, end_ = 0;  ///< doubles before and after the current event
};

}  // namespace kbvh
