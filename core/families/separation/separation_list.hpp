#pragma once
#include <algorithm>
#include <cstdint>
#include <limits>
#include <vector>

#include "core/base/assert.hpp"
#include "core/families/events/kinetic_forest.hpp"
#include "core/families/separation/changed_boxes.hpp"
#include "core/families/separation/overlap_clock.hpp"

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
template <class S, template <class> class Queue, class Count>
class SeparationList {
  using Event = OverlapEvent<S>;

 public:
  static constexpr std::uint32_t none = std::numeric_limits<std::uint32_t>::max();

  /// Two boxes of a body pair and where they stand in the tree of pairs.
  struct Pair {
    std::uint32_t a, b;                  ///< nodes of the first and the second body
    std::uint32_t parent = none;         ///< slot
    std::uint32_t children = none;       ///< first of a block of slots, none of which may be in use
    std::uint32_t next[2], previous[2];  ///< among the pairs linked from a, and from b
    std::uint32_t place = none;          ///< among the overlapping leaves of the body pair
    std::uint32_t depth = 0;
    std::uint32_t bodies = 0;  ///< index of the body pair
    bool used = false, overlapping = false;
    bool dirty = false;  ///< has a node with other children, while a change of geometry is followed
  };
  /// Overlapping leaves, and since when at the earliest.
  struct LeafPair {
    std::uint32_t a, b, slot;
    double since;
  };

  /// An overlap that is over: of which body pair, and until when at the latest.
  struct EndedLeafPair {
    std::uint32_t bodies;
    LeafPair leaf;
    double until;
  };

  /// Which body pairs a list begins with.
  enum class BodyPairs : std::uint8_t { all, none };

  template <class Forest>
  SeparationList(const SceneView<S>& scene, const Forest& forest, Count& count, int look_ahead,
                 BodyPairs pairs)
      : clock_(look_ahead), queue_(clock_, 0), count_(&count) {
    for (std::uint32_t body = 0; body < scene.body_count(); ++body) {
      const auto& tree = forest.tree(body);
      bodies_.push_back({&tree.topology(), nullptr, &forest.clock().plans(body), {}, {}});
      block_ = std::max(block_, tree.topology().width * tree.topology().width);
    }
    if constexpr (requires { queue_.split_at(forest.clock().keyframe_times()); })
      queue_.split_at(forest.clock().keyframe_times());
    read_trees(forest);
    if (pairs == BodyPairs::none) return;
    for (const BodyPair& pair : scene.pairs()) number(pair);
  }
  SeparationList(const SeparationList&) = delete;
  SeparationList& operator=(const SeparationList&) = delete;

  /// Starts over at t by one traversal.
  void reset(double t) {
    clear();
    time_ = t;
    for (std::uint32_t i = 0; i < body_pairs_.size(); ++i)
      if (both_have_nodes(i)) start_pair(i, Instant<S>::at(t));
  }

  /// Enters a body pair at `now`, decided by one traversal; returns its number.
  std::uint32_t enter(const BodyPair& pair, const Instant<S>& now) {
    time_ = now.begin;
    end_ = now.end;
    const std::uint32_t bodies = number(pair);
    if (both_have_nodes(bodies)) start_pair(bodies, now);
    return bodies;
  }
  /// Takes out a pair of two bodies whose boxes are apart. Returns whether it did: not while its roots
  /// overlap.
  bool leave(std::uint32_t bodies) {
    const std::uint32_t root = roots_[bodies];
    if (root != none) {
      if (pairs_[root].overlapping) return false;
      list_changed(-1);
      remove(root);
      free_blocks_.push_back(root);
      roots_[bodies] = none;
    }
    body_pairs_[bodies] = unused;
    free_numbers_.push_back(bodies);
    return true;
  }
  /// Takes out all body pairs.
  void leave_all() {
    clear();
    body_pairs_.clear();
    roots_.clear();
    self_roots_.clear();
    leaves_.clear();
    free_numbers_.clear();
  }
  /// Numbers of body pairs, some of which may not be in use.
  std::uint32_t body_pair_count() const { return std::uint32_t(body_pairs_.size()); }
  bool is_entered(std::uint32_t bodies) const { return body_pairs_[bodies].first != unused.first; }
  const BodyPair& body_pair(std::uint32_t bodies) const { return body_pairs_[bodies]; }

  bool due(double t) const { return !queue_.empty() && clock_.due(queue_.top(), t); }
  bool empty() const { return queue_.empty(); }
  const Event& top() const { return queue_.top(); }

  /// Takes the first event off the queue and handles it.
  void handle_next() {
    const Event event = queue_.top();
    queue_.pop();
    count_->add(Counter::queue_operations);
    if (event.review) {
      schedule(event.slot, Instant<S>::at(event.hint));
      return;
    }
    count_->add(Counter::certificates_failed);
    count_->add(pairs_[event.slot].overlapping ? kind_of_separation(event.slot) : Counter::overlap_events);
    time_ = event.not_after();
    end_ = event.not_before();
    turn(event.slot, event.instant());
  }

  /// These boxes have other realisers, or realisers with other plans, from `now` on. Boxes may be named
  /// twice.
  void boxes_changed(std::span<const ChangedBoxes::Box> boxes, const Instant<S>& now) {
    time_ = now.begin;
    end_ = now.end;
    // Of a node that went while the geometry changed, no pair is left.
    for (const auto& box : boxes) {
      linked_.clear();
      for (std::uint32_t slot = bodies_[box.body].first_pair[box.node]; slot != none;
           slot = pairs_[slot].next[side_of(slot, box.body, box.node)])
        linked_.push_back(slot);
      if (linked_.empty()) continue;
      count_->add(Counter::bound_change_events);
      for (const std::uint32_t slot : linked_) {
        // What a collapse has removed, or an expansion made anew in its place, needs nothing.
        if (!pairs_[slot].used || !has_node(slot, box.body, box.node)) continue;
        count_->add(Counter::nodes_visited);
        ++work_done_.decided;
        if (overlap_after(slot, now) != pairs_[slot].overlapping)
          turn(slot, now);
        else
          schedule(slot, now);
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
    KBVH_ASSERT(!recording_);
    const auto now = Instant<S>::at(t);
    time_ = t;
    work_done_ = {};
    read_trees(forest);
    for (std::uint32_t i = 0; i < body_pairs_.size(); ++i) remove_self_pairs(i);
    remove_changed(nodes);
    for (const std::uint32_t slot : tops_) {
      work_.assign(1, slot);
      settle_new(now);
    }
    for (std::uint32_t i = 0; i < body_pairs_.size(); ++i)
      if (roots_[i] == none && self_roots_[i].empty() && both_have_nodes(i)) start_pair(i, now);
    std::sort(boxes.begin(), boxes.end());
    boxes.erase(std::unique(boxes.begin(), boxes.end()), boxes.end());
    boxes_changed(boxes, now);
    return work_done_;
  }

  /// An event of the list as the contract describes it.
  ScheduledEvent<S> described(const Event& event) const {
    const Pair& pair = pairs_[event.slot];
    ScheduledEvent<S> out;
    out.kind = event.review       ? EventKind::review
               : pair.overlapping ? EventKind::boxes_separate
                                  : EventKind::boxes_meet;
    out.body = body_of(pair, 0);
    out.node = pair.a;
    out.other_body = body_of(pair, 1);
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
              [&](const Event& a, const Event& b) { return clock_.earlier(a, b); });
    for (const Event& event : events) out.push_back(described(event));
  }

  /// The overlapping leaves of one body pair, in no order.
  std::span<const LeafPair> leaf_pairs(std::size_t body_pair) const { return leaves_[body_pair]; }
  /// Pairs in the list: apart, or overlapping leaves.
  std::size_t size() const { return list_size_; }
  /// All pairs by slot, for audits.
  std::span<const Pair> pairs() const { return pairs_; }
  const OverlapClock<S>& clock() const { return clock_; }
  RealisedBox<S> box(std::uint32_t body, std::uint32_t node) const {
    return {bodies_[body].plans, bodies_[body].realisers + std::size_t(6) * node};
  }

  /// From now on ended overlaps of leaves are kept; those that last already count from t.
  void start_spans(double t) {
    for (auto& leaves : leaves_)
      for (LeafPair& leaf : leaves) leaf.since = t;
    ended_.clear();
    recording_ = true;
  }
  bool is_recording() const { return recording_; }
  /// The overlaps that ended since `start_spans`; those that last are the leaf pairs.
  std::span<const EndedLeafPair> stop_spans() {
    recording_ = false;
    return ended_;
  }

  std::uint64_t steps() const { return queue_.steps(); }
  std::size_t bytes() const {
    std::size_t total =
        queue_.bytes() + pairs_.capacity() * sizeof(Pair) +
        (free_blocks_.capacity() + work_.capacity() + linked_.capacity() + roots_.size() + tops_.capacity()) *
            4;
    for (const auto& body : bodies_) total += body.first_pair.size() * 4 + body.gone.size();
    for (const auto& leaves : leaves_) total += leaves.capacity() * sizeof(LeafPair);
    return total + body_pairs_.capacity() * (sizeof(BodyPair) + sizeof(leaves_[0]) + sizeof(self_roots_[0]));
  }

 private:
  static constexpr BodyPair unused{none, none};

  struct BodyBoxes {
    const Topology* topology;
    const std::uint32_t* realisers;
    const FlightPlans<S>* plans;
    std::vector<std::uint32_t> first_pair;  ///< linked from each node, or none
    std::vector<std::uint8_t> gone;         ///< nodes, while a change of geometry is followed
  };

  /// Where the trees keep their realisers now, and room for all their nodes; ids are never given up.
  template <class Forest>
  void read_trees(const Forest& forest) {
    for (std::uint32_t body = 0; body < bodies_.size(); ++body) {
      BodyBoxes& own = bodies_[body];
      own.realisers = own.topology->empty() ? nullptr : forest.tree(body).realisers(0);
      if (own.first_pair.size() < own.topology->size()) own.first_pair.resize(own.topology->size(), none);
    }
  }
  void clear() {
    queue_.clear();
    pairs_.clear();
    free_blocks_.clear();
    list_size_ = 0;
    for (auto& leaves : leaves_) leaves.clear();
    for (auto& body : bodies_) std::fill(body.first_pair.begin(), body.first_pair.end(), none);
    std::fill(roots_.begin(), roots_.end(), none);
    for (auto& roots : self_roots_) roots.clear();
  }
  std::uint32_t number(const BodyPair& pair) {
    if (!free_numbers_.empty()) {
      const std::uint32_t bodies = free_numbers_.back();
      free_numbers_.pop_back();
      body_pairs_[bodies] = pair;
      return bodies;
    }
    body_pairs_.push_back(pair);
    roots_.push_back(none);
    self_roots_.emplace_back();
    leaves_.emplace_back();
    return std::uint32_t(body_pairs_.size() - 1);
  }
  bool both_have_nodes(std::uint32_t bodies) const {
    return is_entered(bodies) && !bodies_[body_pairs_[bodies].first].topology->empty() &&
           !bodies_[body_pairs_[bodies].second].topology->empty();
  }
  /// Makes the list of a body pair that has none.
  void start_pair(std::uint32_t bodies, const Instant<S>& now) {
    if (body_pairs_[bodies].first == body_pairs_[bodies].second) {
      start_self_pairs(bodies, now);
      return;
    }
    roots_[bodies] = new_block();
    insert(roots_[bodies], bodies, 0, 0, none, 0);
    work_.assign(1, roots_[bodies]);
    settle_new(now);
  }

  /// Each two children of each inner node, in a block for each.
  void start_self_pairs(std::uint32_t bodies, const Instant<S>& now) {
    const Topology& topology = *bodies_[body_pairs_[bodies].first].topology;
    std::vector<std::uint32_t> inner;
    if (!topology.nodes[0].is_leaf()) inner.push_back(0);
    work_.clear();
    while (!inner.empty()) {
      const TopologyNode parent = topology.nodes[inner.back()];
      inner.pop_back();
      const std::uint32_t end = parent.first() + parent.count();
      for (std::uint32_t child = parent.first(); child < end; ++child)
        if (!topology.nodes[child].is_leaf()) inner.push_back(child);
      if (parent.count() < 2) continue;
      std::uint32_t slot = new_block();
      self_roots_[bodies].push_back(slot);
      for (std::uint32_t a = parent.first(); a < end; ++a)
        for (std::uint32_t b = a + 1; b < end; ++b) {
          insert(slot, bodies, a, b, none, 0);
          work_.push_back(slot++);
        }
    }
    settle_new(now);
  }
  /// Removes all pairs within a body, as far as there are any.
  void remove_self_pairs(std::uint32_t bodies) {
    for (const std::uint32_t block : self_roots_[bodies]) {
      for (std::uint32_t slot = block; slot < block + block_ && pairs_[slot].used; ++slot) {
        unsettle(slot);
        remove(slot);
      }
      free_blocks_.push_back(block);
    }
    self_roots_[bodies].clear();
  }

  bool has_gone_node(const Pair& pair) const {
    const auto gone = [&](std::uint32_t body, std::uint32_t node) {
      return node < bodies_[body].gone.size() && bodies_[body].gone[node] != 0;
    };
    return gone(body_of(pair, 0), pair.a) || gone(body_of(pair, 1), pair.b);
  }
  /// Removes all pairs below those of changed nodes, and leaves the highest of these in `tops_`, as pairs of
  /// which nothing is known. Root pairs of a body that has nothing left go.
  ///
  /// All goes by the tree of pairs, which is that of the trees before the change, whatever the ids mean now:
  /// an id that lost its meaning lay, then, below a node that the trees named.
  void remove_changed(std::span<const ChangedBoxes::Node> nodes) {
    for (const auto& changed : nodes) {
      BodyBoxes& body = bodies_[changed.body];
      if (!changed.gone) continue;
      body.gone.resize(body.first_pair.size(), 0);
      body.gone[changed.node] = 1;
    }
    linked_.clear();
    for (const auto& changed : nodes)
      for (std::uint32_t slot = bodies_[changed.body].first_pair[changed.node]; slot != none;
           slot = pairs_[slot].next[side_of(slot, changed.body, changed.node)]) {
        std::uint32_t top = slot;
        while (pairs_[top].parent != none && has_gone_node(pairs_[top])) top = pairs_[top].parent;
        if (pairs_[top].dirty) continue;
        pairs_[top].dirty = true;
        linked_.push_back(top);
      }
    tops_.clear();
    for (const std::uint32_t slot : linked_) {
      std::uint32_t above = pairs_[slot].parent;
      while (above != none && !pairs_[above].dirty) above = pairs_[above].parent;
      if (above == none) tops_.push_back(slot);
    }
    for (const std::uint32_t slot : linked_) pairs_[slot].dirty = false;
    for (const std::uint32_t slot : tops_) unsettle(slot);
    for (const auto& changed : nodes)
      if (changed.gone) bodies_[changed.body].gone[changed.node] = 0;
    for (std::uint32_t i = 0; i < body_pairs_.size(); ++i) {
      const std::uint32_t root = roots_[i];
      if (root == none || both_have_nodes(i)) continue;
      // The body's last node was its root, so this pair is one of them, and the only one of its list.
      [[maybe_unused]] const std::size_t found = std::erase(tops_, root);
      KBVH_ASSERT(found == 1);
      remove(root);
      free_blocks_.push_back(root);
      roots_[i] = none;
    }
  }
  /// Makes a pair one that `settle_new` has still to decide.
  void unsettle(std::uint32_t slot) {
    pairs_[slot].overlapping = false;
    if (pairs_[slot].place != none) end_leaf(slot);
    if (pairs_[slot].children != none)
      remove_below(slot);
    else
      list_changed(-1);
  }

  std::uint32_t body_of(const Pair& pair, int side) const {
    return side == 0 ? body_pairs_[pair.bodies].first : body_pairs_[pair.bodies].second;
  }
  /// Of a pair that has the node.
  int side_of(std::uint32_t slot, std::uint32_t body, std::uint32_t node) const {
    return body_pairs_[pairs_[slot].bodies].first == body && pairs_[slot].a == node ? 0 : 1;
  }
  bool has_node(std::uint32_t slot, std::uint32_t body, std::uint32_t node) const {
    const BodyPair& bodies = body_pairs_[pairs_[slot].bodies];
    return (bodies.first == body && pairs_[slot].a == node) ||
           (bodies.second == body && pairs_[slot].b == node);
  }
  TopologyNode node(const Pair& pair, int side) const {
    return bodies_[body_of(pair, side)].topology->nodes[side == 0 ? pair.a : pair.b];
  }
  bool both_leaves(const Pair& pair) const { return node(pair, 0).is_leaf() && node(pair, 1).is_leaf(); }
  Counter kind_of_separation(std::uint32_t slot) const {
    return both_leaves(pairs_[slot]) ? Counter::leaves_apart_events : Counter::fathers_apart_events;
  }
  RealisedBox<S> box_a(const Pair& pair) const { return box(body_of(pair, 0), pair.a); }
  RealisedBox<S> box_b(const Pair& pair) const { return box(body_of(pair, 1), pair.b); }
  bool overlap_after(std::uint32_t slot, const Instant<S>& now) const {
    return clock_.overlap_after(box_a(pairs_[slot]), box_b(pairs_[slot]), now);
  }

  std::uint32_t new_block() {
    if (!free_blocks_.empty()) {
      const std::uint32_t block = free_blocks_.back();
      free_blocks_.pop_back();
      return block;
    }
    const std::size_t block = pairs_.size();
    if (block + block_ >= none) throw std::length_error("a separation list of more than 2^32 pairs");
    pairs_.resize(block + block_);
    queue_.grow(std::uint32_t(pairs_.capacity()));
    return std::uint32_t(block);
  }

  void insert(std::uint32_t slot, std::uint32_t bodies, std::uint32_t a, std::uint32_t b,
              std::uint32_t parent, std::uint32_t depth) {
    Pair& pair = pairs_[slot];
    pair = {};
    pair.a = a;
    pair.b = b;
    pair.parent = parent;
    pair.depth = depth;
    pair.bodies = bodies;
    pair.used = true;
    for (const int side : {0, 1}) {
      const std::uint32_t own = side == 0 ? a : b;
      std::uint32_t& first = bodies_[body_of(pair, side)].first_pair[own];
      pair.previous[side] = none;
      pair.next[side] = first;
      if (first != none) pairs_[first].previous[side_of(first, body_of(pair, side), own)] = slot;
      first = slot;
    }
  }
  void remove(std::uint32_t slot) {
    Pair& pair = pairs_[slot];
    for (const int side : {0, 1}) {
      const std::uint32_t body = body_of(pair, side), next = pair.next[side], previous = pair.previous[side];
      const std::uint32_t own = side == 0 ? pair.a : pair.b;
      if (next != none) pairs_[next].previous[side_of(next, body, own)] = previous;
      if (previous != none)
        pairs_[previous].next[side_of(previous, body, own)] = next;
      else
        bodies_[body].first_pair[own] = next;
    }
    cancel(slot);
    pair.used = false;
    ++work_done_.removed;
  }
  void cancel(std::uint32_t slot) {
    if (!queue_.cancel(slot)) return;
    count_->add(Counter::certificates_discarded);
    count_->add(Counter::queue_operations);
  }

  /// Decides the pairs in `work_`, which are new, and all below them that have to be there.
  void settle_new(const Instant<S>& now) {
    while (!work_.empty()) {
      const std::uint32_t slot = work_.back();
      work_.pop_back();
      count_->add(Counter::nodes_visited);
      ++work_done_.decided;
      list_changed(1);
      if (overlap_after(slot, now))
        begin_overlap(slot, now);
      else
        schedule(slot, now);
    }
  }

  /// A pair in the list overlaps: notes it, schedules its end, and leaves its new children, if there are any,
  /// in `work_`.
  void begin_overlap(std::uint32_t slot, const Instant<S>& now) {
    pairs_[slot].overlapping = true;
    schedule(slot, now);
    const Pair pair = pairs_[slot];  // by value: blocks move
    const TopologyNode a = node(pair, 0), b = node(pair, 1);
    if (a.is_leaf() && b.is_leaf()) {
      auto& leaves = leaves_[pair.bodies];
      pairs_[slot].place = std::uint32_t(leaves.size());
      leaves.push_back({pair.a, pair.b, slot, time_});
      return;
    }
    list_changed(-1);
    const std::uint32_t block = new_block();
    pairs_[slot].children = block;
    const std::uint32_t begin_a = a.is_leaf() ? pair.a : a.first(), count_a = a.is_leaf() ? 1 : a.count();
    const std::uint32_t begin_b = b.is_leaf() ? pair.b : b.first(), count_b = b.is_leaf() ? 1 : b.count();
    std::uint32_t child = block;
    for (std::uint32_t i = begin_a; i < begin_a + count_a; ++i)
      for (std::uint32_t j = begin_b; j < begin_b + count_b; ++j) {
        insert(child, pair.bodies, i, j, slot, pair.depth + 1);
        work_.push_back(child++);
      }
  }

  /// A pair changes between apart and overlapping at `now`.
  void turn(std::uint32_t slot, const Instant<S>& now) {
    if (!pairs_[slot].overlapping) {
      work_.clear();
      begin_overlap(slot, now);
      settle_new(now);
      return;
    }
    pairs_[slot].overlapping = false;
    if (pairs_[slot].place != none)
      end_leaf(slot);
    else {
      remove_below(slot);
      list_changed(1);
    }
    schedule(slot, now);
  }

  void end_leaf(std::uint32_t slot) {
    Pair& pair = pairs_[slot];
    auto& leaves = leaves_[pair.bodies];
    if (recording_) ended_.push_back({pair.bodies, leaves[pair.place], end_});
    pairs_[leaves.back().slot].place = pair.place;
    leaves[pair.place] = leaves.back();
    leaves.pop_back();
    pair.place = none;
  }

  void remove_below(std::uint32_t top) {
    work_.assign(1, pairs_[top].children);
    pairs_[top].children = none;
    while (!work_.empty()) {
      const std::uint32_t block = work_.back();
      work_.pop_back();
      for (std::uint32_t slot = block; slot < block + block_ && pairs_[slot].used; ++slot) {
        count_->add(Counter::nodes_visited);
        if (pairs_[slot].place != none) end_leaf(slot);
        if (pairs_[slot].children != none)
          work_.push_back(pairs_[slot].children);
        else
          list_changed(-1);
        remove(slot);
      }
      free_blocks_.push_back(block);
    }
  }

  /// Puts the pair's next event into the queue, in place of the one that stood.
  void schedule(std::uint32_t slot, const Instant<S>& now) {
    cancel(slot);
    Event event;
    event.slot = slot;
    event.depth = pairs_[slot].depth;
    count_->add(Counter::certificates_made);
    const RealisedBox<S> a = box_a(pairs_[slot]), b = box_b(pairs_[slot]);
    const bool found = pairs_[slot].overlapping ? clock_.next_separation(a, b, now, event)
                                                : clock_.next_overlap(a, b, now, event);
    if (!found) return;
    queue_.schedule(event);
    count_->add(Counter::queue_operations);
    count_->peak(Counter::queue_peak, queue_.size());
  }

  void list_changed(int by) {
    list_size_ += std::size_t(by);
    count_->peak(Counter::list_peak, list_size_);
  }

  OverlapClock<S> clock_;
  Queue<OverlapClock<S>> queue_;
  Count* count_;
  std::vector<BodyBoxes> bodies_;
  std::vector<BodyPair> body_pairs_;  ///< by number
  std::vector<std::uint32_t> free_numbers_;
  std::uint32_t block_ = 4;  ///< most children of a pair
  std::vector<Pair> pairs_;  ///< in blocks of siblings; the used ones come first in a block
  std::vector<std::uint32_t> free_blocks_;
  std::vector<std::vector<LeafPair>> leaves_;  ///< [body pair]
  std::size_t list_size_ = 0;
  std::vector<std::uint32_t> roots_;                    ///< slot of each body pair's root pair, or none
  std::vector<std::vector<std::uint32_t>> self_roots_;  ///< [body pair] blocks of roots within one body
  std::vector<std::uint32_t> work_, linked_, tops_;
  ListEdit work_done_;         ///< since the last change of geometry began
  double time_ = 0, end_ = 0;  ///< around the instant of the event at hand
  bool recording_ = false;
  std::vector<EndedLeafPair> ended_;
};

}  // namespace kbvh
