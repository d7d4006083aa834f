#pragma once
#include <algorithm>
#include <cstdint>
#include <limits>
#include <vector>

#include "core/base/assert.hpp"
#include "core/families/events/kinetic_forest.hpp"
#include "core/families/separation/overlapping_leaves.hpp"
#include "core/families/separation/pair_outlook.hpp"
#include "core/families/separation/pair_tree.hpp"

namespace kbvh {

/// What a change of geometry cost a separation list, in pairs.
struct ListEdit {
  std::uint64_t removed = 0;  ///< taken out of the tree of pairs
  std::uint64_t decided = 0;  ///< decided anew: new ones, those with other children, those with other boxes
};

/// The separation list of kinetic incremental collision detection (Z&W s.7), for body pairs of a scene:
/// the pairs of boxes at which a simultaneous traversal would stop now, kept from event to event.
///
/// The pairs form a tree: a pair's parent is the pair of their parents (a leaf against an inner node
/// descends on one side only). Pairs that do not overlap, and overlapping pairs of leaves, are the list;
/// overlapping inner pairs stand above it. Each has one event in the queue:
///   apart: the boxes overlap ("BV-overlap"): an inner pair gets children, which may overlap in their turn;
///   inner, overlapping: they are apart ("parents do not overlap"): all below goes. The paper schedules this
///     with each child and has to insert the parent once; here it is the parent's own;
///   leaves, overlapping: they are apart ("leaves do not overlap").
/// Or, where that is too far ahead, one at which only its next event is looked for (OverlapClock); it is
/// counted as an operation on the queue.
/// When a box changes ("BV change": another realiser, or another plan of one), the pairs that it takes part
/// in, which are linked from it, are decided anew.
///
/// Insertions and deletions change the trees below a few nodes. The pairs of such a node stay, what is below
/// them goes, and they are decided anew on the trees as they are then; a pair of a node that is gone lies
/// below a pair of its former parent, which counts as changed. Nothing else is looked at.
///
/// Within one body, a node with itself always overlaps and needs no event: below it stand the pairs of two of
/// its children, one for each two, which are roots of the tree of pairs; they keep the list at least as long
/// as the tree has inner nodes. A leaf with itself is in no list.
///
/// Body pairs have numbers. A list of all pairs of a scene numbers them as the scene does; of many pairs
/// those are entered that may meet (`enter`), and those that are apart can be taken out again (`leave`):
/// their numbers are used again.
///
/// Boxes are compared on the flight plans with the margin of OverlapClock: the list may hold a pair of boxes
/// that are apart by some ulps, and misses none whose rounded boxes touch.
///
/// With a queue that orders events by segments, a pair has an event only if its boxes begin or cease to
/// overlap before the present segment ends: `open_segment` looks at all pairs when the next one begins, and
/// most of them are decided by the signs of their gaps at its ends (SegmentOverlap).
template <class S, template <class> class Queue, class Count>
class SeparationList {
  using Event = OverlapEvent<S>;

 public:
  static constexpr std::uint32_t none = PairTree::none;

  /// Which body pairs a list begins with.
  enum class BodyPairs : std::uint8_t { all, none };

  template <class Forest>
  SeparationList(const SceneView<S>& scene, const Forest& forest, Count& count, int look_ahead,
                 BodyPairs pairs)
      : tree_(forest_topologies(scene, forest)),
        outlook_(scene, forest, tree_, by_segments ? LookAhead::segment : LookAhead::pieces, look_ahead),
        queue_(outlook_.clock(), 0),
        count_(&count) {
    if constexpr (by_segments) {
      queue_.split_at(forest.clock().keyframe_times());
      queue_.serve(*this);
    }
    read_trees(forest);
    if (pairs == BodyPairs::none) return;
    for (const BodyPair& pair : scene.pairs()) number(pair);
  }
  SeparationList(const SeparationList&) = delete;
  SeparationList& operator=(const SeparationList&) = delete;

  /// Starts over at t by one traversal.
  void reset(double t) {
    clear(t);
    for (std::uint32_t i = 0; i < tree_.body_pair_count(); ++i)
      if (tree_.both_have_nodes(i)) start_pair(i, Moment<S>::at(t));
  }

  /// Enters a body pair at t, decided by one traversal; returns its number.
  std::uint32_t enter(const BodyPair& pair, double t) {
    time_ = end_ = t;
    const std::uint32_t bodies = number(pair);
    if (tree_.both_have_nodes(bodies)) start_pair(bodies, Moment<S>::at(t));
    return bodies;
  }
  /// Takes out a pair of two bodies whose boxes are apart. Returns whether it did: not while its roots
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
  /// Takes out all body pairs, and starts over at t.
  void leave_all(double t) {
    clear(t);
    tree_.leave_all();
    roots_.clear();
    self_roots_.clear();
  }
  /// Numbers of body pairs, some of which may not be in use.
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

  /// Takes the first event off the queue and handles it.
  void handle_next() {
    const Event event = queue_.top();
    queue_.pop();
    count_->add(Counter::queue_operations);
    BoxPair& pair = tree_[event.slot];
    pair.scheduled = false;
    if (event.review) {
      put(event.slot, look(event.slot, Moment<S>::at(event.hint), state(pair)));
      return;
    }
    count_->add(Counter::certificates_failed);
    count_->add(pair.overlapping ? kind_of_separation(pair) : Counter::overlap_events);
    time_ = event.not_after();
    end_ = event.not_before();
    const Moment<S> now{{time_, end_, &event.crossing}, event.hint, event.error};
    turn(event.slot, now, look(event.slot, now, pair.overlapping ? State::apart : State::overlapping));
  }

  /// Fetches what handling an event of a pair will read: first the pair, then its boxes.
  void fetch_ahead(const Event& /*event*/, std::uint32_t slot, int step) const {
    if (step == 0) tree_.prefetch(slot);
    if (step == 1) outlook_.prefetch(tree_[slot]);
  }
  /// The queue is not asked for reviews: pairs without an event wait for the next segment.
  void review(const Event& /*event*/, double /*t*/) {}
  /// Fetches what a change of a node's box will read: first its boxes and where its pairs are, then the first
  /// of these, then that one's boxes.
  void fetch_ahead(std::uint32_t body, std::uint32_t node, int step) const {
    if (step == 0) {
      tree_.prefetch_first_of(body, node);
      outlook_.prefetch(body, node);
    } else if (const std::uint32_t slot = tree_.first_of(body, node); slot != none) {
      step == 1 ? tree_.prefetch(slot) : outlook_.prefetch(tree_[slot]);
    }
  }

  /// When the present segment ends; infinite if there is none. `open_segment` is due then, before any event
  /// from then on.
  double segment_end() const { return outlook_.segment_end(); }
  /// Goes on to the next segment: looks which pairs have an event in it.
  void open_segment() {
    const Moment<S> now = Moment<S>::at(outlook_.open_segment());
    const std::uint32_t slots = tree_.slots();
    constexpr std::uint32_t ahead = 12;
    for (std::uint32_t slot = 0; slot < slots; ++slot) {
      if (slot + ahead < slots) outlook_.prefetch(tree_[slot + ahead]);
      const BoxPair& pair = tree_[slot];
      if (pair.used && !pair.scheduled) put(slot, look(slot, now, state(pair)));
    }
  }

  /// These boxes have other realisers, or realisers with other plans. Returns whether they are in any pair:
  /// `boxes_changed` is called then.
  bool take_over(std::span<const ChangedBoxes::Box> boxes) {
    outlook_.take_over(boxes);
    return std::any_of(boxes.begin(), boxes.end(),
                       [&](const auto& box) { return tree_.first_of(box.body, box.node) != none; });
  }
  /// Decides anew the pairs of boxes that have changed at `now`. Boxes may be named twice.
  void boxes_changed(std::span<const ChangedBoxes::Box> boxes, const Moment<S>& now) {
    time_ = now.instant.begin;
    end_ = now.instant.end;
    // Of a node that went while the geometry changed, no pair is left.
    for (const auto& box : boxes) {
      linked_.clear();
      for (std::uint32_t slot = tree_.first_of(box.body, box.node); slot != none;
           slot = tree_.next_of(slot, box.body, box.node)) {
        linked_.push_back(slot);
        outlook_.prefetch(tree_[slot]);
      }
      if (linked_.empty()) continue;
      count_->add(Counter::bound_change_events);
      for (const std::uint32_t slot : linked_) {
        // What a collapse has removed, or an expansion made anew in its place, needs nothing.
        if (!tree_[slot].used || !tree_.has_node(slot, box.body, box.node)) continue;
        count_->add(Counter::nodes_visited);
        ++work_done_.decided;
        const Outlook outlook = look(slot, now, State::unknown);
        if (outlook.overlapping != tree_[slot].overlapping)
          turn(slot, now, outlook);
        else
          put(slot, outlook);
      }
    }
  }

  /// Follows a change of geometry at t that the trees of `forest` have made already, all of them: `nodes` and
  /// `boxes` are what they told of it, in their order (boxes are sorted here). Costs what hangs below the
  /// pairs of changed nodes, and the pairs of changed boxes; the whole list of a body pair if a root changes.
  /// O(nodes) room the first time, amortised O(change) after; but what is within one body is made
  /// anew as a whole. Not between start_spans and stop_spans.
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
    return work_done_;
  }

  /// An event of the list as the contract describes it.
  ScheduledEvent<S> described(const Event& event) const {
    const BoxPair& pair = tree_[event.slot];
    ScheduledEvent<S> out;
    out.kind = event.review       ? EventKind::review
               : pair.overlapping ? EventKind::boxes_separate
                                  : EventKind::boxes_meet;
    out.body = tree_.body_of(pair, 0);
    out.node = pair.a;
    out.other_body = tree_.body_of(pair, 1);
    out.other_node = pair.b;
    out.time = {event.hint, event.error};
    out.has_crossing = !event.review;
    if (out.has_crossing) out.crossing = event.crossing;
    return out;
  }
  /// Appends all scheduled events in their order.
  void list_events(std::vector<ScheduledEvent<S>>& out) const {
    std::vector<Event> events;
    for (std::uint32_t slot = 0; slot < queue_.slots(); ++slot)
      if (queue_.scheduled(slot)) events.push_back(queue_.event(slot));
    std::sort(events.begin(), events.end(),
              [&](const Event& a, const Event& b) { return clock().earlier(a, b); });
    for (const Event& event : events) out.push_back(described(event));
  }

  /// The overlapping leaves of one body pair, in no order.
  std::span<const OverlappingLeaves> leaf_pairs(std::size_t body_pair) const { return leaves_.of(body_pair); }
  /// Pairs in the list: apart, or overlapping leaves.
  std::size_t size() const { return list_size_; }
  /// All pairs by slot, for audits.
  std::span<const BoxPair> pairs() const { return tree_.pairs(); }
  const OverlapClock<S>& clock() const { return outlook_.clock(); }

  /// From now on ended overlaps of leaves are kept; those that last already count from t.
  void start_spans(double t) { leaves_.start_spans(t); }
  bool is_recording() const { return leaves_.is_recording(); }
  /// The overlaps that ended since `start_spans`; those that last are the leaf pairs.
  std::span<const EndedOverlap> stop_spans() { return leaves_.stop_spans(); }

  std::uint64_t steps() const { return queue_.steps(); }
  std::size_t bytes() const {
    return queue_.bytes() + tree_.bytes() + outlook_.bytes() + leaves_.bytes() +
           (work_.capacity() + linked_.capacity() + roots_.capacity() + tops_.capacity()) *
               sizeof(std::uint32_t) +
           self_roots_.capacity() * sizeof(self_roots_[0]);
  }

 private:
  using State = typename PairOutlook<S>::State;
  using Outlook = typename PairOutlook<S>::Outlook;
  /// Does the queue keep what waits by segments?
  static constexpr bool by_segments = requires(Queue<OverlapClock<S>> queue) {
    queue.split_at(std::span<const double>());
  };

  template <class Forest>
  static std::vector<const Topology*> forest_topologies(const SceneView<S>& scene, const Forest& forest) {
    std::vector<const Topology*> topologies;
    for (std::uint32_t body = 0; body < scene.body_count(); ++body)
      topologies.push_back(&forest.tree(body).topology());
    return topologies;
  }
  /// Where the trees keep their realisers now, and room for all their nodes.
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
  /// Makes the list of a body pair that has none.
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
  /// Removes all pairs within a body, as far as there are any.
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
  /// Removes all pairs below those of changed nodes, and leaves the highest of these in `tops_`, as pairs of
  /// which nothing is known. Root pairs of a body that has nothing left go.
  void remove_changed(std::span<const ChangedBoxes::Node> nodes) {
    tree_.find_highest_changed(nodes, tops_);
    for (const std::uint32_t slot : tops_) unsettle(slot);
    for (std::uint32_t i = 0; i < tree_.body_pair_count(); ++i) {
      const std::uint32_t root = roots_[i];
      if (root == none || tree_.both_have_nodes(i)) continue;
      // The body's last node was its root, so this pair is one of them, and the only one of its list.
      [[maybe_unused]] const std::size_t found = std::erase(tops_, root);
      KBVH_ASSERT(found == 1);
      remove(root);
      tree_.free_block(root);
      roots_[i] = none;
    }
  }
  /// Makes a pair one that `settle_new` has still to decide.
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
    return tree_.both_leaves(pair) ? Counter::leaves_apart_events : Counter::fathers_apart_events;
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

  /// Decides the pairs in `work_`, which are new, and all below them that have to be there.
  void settle_new(const Moment<S>& now) {
    queue_.grow(tree_.slot_capacity());
    while (!work_.empty()) {
      const std::uint32_t slot = work_.back();
      work_.pop_back();
      count_->add(Counter::nodes_visited);
      ++work_done_.decided;
      list_changed(1);
      const Outlook outlook = look(slot, now, State::unknown);
      put(slot, outlook);
      if (outlook.overlapping) begin_overlap(slot);
    }
  }

  /// A pair in the list overlaps: notes it, and leaves its new children, if there are any, in `work_`.
  void begin_overlap(std::uint32_t slot) {
    tree_[slot].overlapping = true;
    if (tree_.both_leaves(tree_[slot])) {
      leaves_.begin(tree_, slot, time_);
      return;
    }
    list_changed(-1);
    tree_.insert_children(slot, [&](std::uint32_t child) { work_.push_back(child); });
    queue_.grow(tree_.slot_capacity());
  }

  /// A pair changes between apart and overlapping at `now`; what lies ahead of it is given.
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

  Outlook look(std::uint32_t slot, const Moment<S>& now, State known) {
    count_->add(Counter::certificates_made);
    return outlook_.look(slot, now, known);
  }
  /// Puts the pair's next event into the queue, in place of the one that stood.
  void put(std::uint32_t slot, const Outlook& outlook) {
    cancel(slot);
    if (!outlook.changes) return;
    tree_[slot].scheduled = true;
    queue_.schedule(outlook_.event());
    count_->add(Counter::queue_operations);
    count_->peak(Counter::queue_peak, queue_.size());
  }

  void list_changed(int by) {
    list_size_ += std::size_t(by);
    count_->peak(Counter::list_peak, list_size_);
  }

  PairTree tree_;
  PairOutlook<S> outlook_;
  Queue<OverlapClock<S>> queue_;
  Count* count_;
  LeafOverlaps leaves_;
  std::size_t list_size_ = 0;
  std::vector<std::uint32_t> roots_;                    ///< slot of each body pair's root pair, or none
  std::vector<std::vector<std::uint32_t>> self_roots_;  ///< [body pair] blocks of roots within one body
  std::vector<std::uint32_t> work_, linked_, tops_;
  ListEdit work_done_;         ///< since the last change of geometry began
  double time_ = 0, end_ = 0;  ///< around the instant of the event at hand
};

}  // namespace kbvh
