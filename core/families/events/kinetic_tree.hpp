#pragma once
#include <algorithm>
#include <cstdint>
#include <numeric>
#include <optional>
#include <span>
#include <stdexcept>
#include <type_traits>
#include <vector>

#include "core/base/assert.hpp"
#include "core/base/counters.hpp"
#include "core/contract/event_source.hpp"
#include "core/families/events/certificate_slots.hpp"
#include "core/families/events/certifier.hpp"
#include "core/families/events/event.hpp"
#include "core/families/events/leaf_vertex_lists.hpp"
#include "core/families/events/observer.hpp"
#include "core/families/events/realiser_boxes.hpp"
#include "core/geometry/lane_box.hpp"
#include "core/geometry/volumes/dop.hpp"
#include "core/scene/pairs.hpp"
#include "core/topology/topology_edit.hpp"

namespace kbvh {

/// The kinetic tree of one body (Z&W s.4) over bounding volumes whose K sides have fixed directions: 6 for
/// boxes, 14, 18 or 26 for k-DOPs (`slab_directions`). For each node and side the tree stores the realiser of
/// the bound, and a certificate that the realiser is extremal. The earliest failure of each certificate is
/// scheduled in a queue, which several structures may share. Nodes have any width, leaves any size. A leaf's
/// certificate compares the realiser with the leaf's unique vertices, an inner node's with the realisers of
/// its children.
///
/// The clock must have the tree's directions. Along the axes, realisers and events are exact for the flight
/// plans; along other directions they are exact for the projected plans (projected_plan.hpp).
///
/// Slots of the queue are first_slot + K * node + side for the initial nodes; later nodes get slots in
/// chunks. Observer::realiser_changed(body, node, side, old, new, instant) is called at every change of a
/// realiser, deeper nodes first. Observer::realiser_plan_changed(body, node) is called for every node with a
/// realiser whose plan changed.
///
/// Primitives can be inserted and removed at any time (as the paper claims). The topology is edited locally.
/// Certificates are recomputed for the few nodes whose candidates changed, and for their ancestors as long as
/// realisers change.
template <class S, class Queue, class Observer, int K>
class KineticTree {
  /// One bit for each side, and one more.
  using SideBits = std::conditional_t<K <= 7, std::uint8_t, std::uint32_t>;
  using Now = typename InstantOf<typename Queue::ClockType, S>::type;

 public:
  static constexpr Side sides = K;
  /// The directions of the sides: side = 2 * direction + (0 lower, 1 upper).
  static constexpr const auto& directions = Dop<S, K>::directions;

  KineticTree(Topology topology, const Primitives& primitives, std::uint32_t body, std::uint32_t first_slot,
              typename Queue::ClockType& clock, Queue& queue, Counters& count, Observer observer = {})
      : topology_(std::move(topology)),
        leaf_vertices_(topology_, primitives),
        body_(body),
        slots_(first_slot, std::uint32_t(slot_count(topology_))),
        clock_(&clock),
        queue_(&queue),
        count_(&count),
        observer_(observer),
        certifier_(clock, queue, count),
        realisers_(std::size_t(sides) * topology_.size(), 0) {}

  static std::uint64_t slot_count(const Topology& topology) { return std::uint64_t(sides) * topology.size(); }
  /// Returns the current topology. After insertions or deletions it has the layout of TopologyEditor, and its
  /// ids have no order.
  const Topology& topology() const { return topology_; }
  /// Returns the topology in a builder's layout, for audits. Its node i is node order[i] of the tree.
  Topology compacted_topology(std::vector<std::uint32_t>& order) const {
    if (editor_) return compacted(topology_, order);
    order.resize(topology_.size());
    std::iota(order.begin(), order.end(), 0u);
    return topology_;
  }
  /// Returns the unique vertices of a leaf, ascending.
  std::span<const std::uint32_t> leaf_vertices(std::uint32_t node) const { return leaf_vertices_[node]; }
  std::uint32_t slot(std::uint32_t node, Side side) const { return slots_.slot(sides * node + side); }
  /// Returns the node of a slot of the queue.
  std::uint32_t node_of(std::uint32_t slot) const { return slots_.place(slot) / sides; }
  /// Returns the other node whose certificate is affected when a realiser of `node` changes. Not for the
  /// root.
  std::uint32_t certificate_above(std::uint32_t node, Side /*side*/) const { return topology_.parents[node]; }
  std::uint32_t realiser(std::uint32_t node, Side side) const {
    return realisers_[std::size_t(sides) * node + side];
  }
  const std::uint32_t* realisers(std::uint32_t node) const {
    return realisers_.data() + std::size_t(sides) * node;
  }

  /// Finds every realiser at t and schedules every certificate. O(nodes log nodes + vertices of leaves).
  void initialise(double t) {
    const auto now = Now::at(t);
    const auto start = [&](std::uint32_t node) {
      for (Side side = 0; side < sides; ++side) {
        realisers_[std::size_t(sides) * node + side] = best_at(node, side, t, candidate(node, side, 0));
        certify(node, side, now);
      }
    };
    if (editor_) {  // a child may have a smaller id than its parent
      std::vector<std::uint32_t> order;
      compacted(topology_, order);
      for (std::size_t i = order.size(); i-- > 0;) start(order[i]);
      return;
    }
    for (std::uint32_t node = topology_.size(); node-- > 0;) start(node);
  }

  /// Handles a failure that was popped from the queue: the loser becomes the realiser here and in every
  /// ancestor that the winner realises (leaf and tree events, Z&W s.4). O(depth) certificates.
  void handle(const Event& event) {
    KBVH_ASSERT(event.body == body_);
    typename Now::Exact crossing;
    const Now now = certifier_.instant_of(event, reads_instants(observer_), crossing);
    const Side side = event.side;
    std::uint32_t node = node_of(event.slot);
    KBVH_ASSERT(realiser(node, side) == event.winner);
    count_->add(Counter::certificates_failed);
    count_->event_at(topology_.depths[node]);
    for (;;) {
      replace(node, side, event.loser, now);
      certify(node, side, now);
      if (node == 0) return;
      node = topology_.parents[node];
      count_->add(Counter::nodes_visited);
      if (realiser(node, side) != event.winner) break;
    }
    certify(node, side, now);  // one of its candidates changed
  }

  /// Searches the next failure of a certificate that holds at t, a keyframe time.
  void review(const Event& event, double t) {
    count_->add(Counter::queue_operations);
    certify(node_of(event.slot), event.side, Now::at(t));
  }
  /// Prefetches the data that handling the event will read: in step 0 that of the node, in step 1 that of its
  /// parent, in step 2 the keyframes of the other vertices.
  template <class StoredEvent>
  void fetch_ahead(const StoredEvent& event, std::uint32_t slot_of_event, int step) const {
    const std::uint32_t node = node_of(slot_of_event);
    const Side side = event.side;
    if (step == 0) {
      __builtin_prefetch(realisers(node) + side);
      __builtin_prefetch(topology_.nodes.data() + node);
      __builtin_prefetch(topology_.parents.data() + node);
      return;
    }
    if (step == 2 && topology_.nodes[node].is_leaf())
      for (const std::uint32_t vertex : leaf_vertices_[node]) clock_->fetch_ahead(event, vertex);
    if (node == 0) return;
    const std::uint32_t parent = topology_.parents[node];
    if (step == 1) {
      __builtin_prefetch(realisers(parent) + side);
      __builtin_prefetch(topology_.nodes.data() + parent);
      __builtin_prefetch(topology_.parents.data() + parent);
      if constexpr (requires { queue_->prefetch(0); }) queue_->prefetch(slot(parent, side));
      return;
    }
    if (realiser(parent, side) != event.winner) {
      clock_->fetch_ahead(event, realiser(parent, side));
      return;
    }
    const TopologyNode siblings = topology_.nodes[parent];
    for (std::uint32_t i = 0; i < siblings.count(); ++i)
      clock_->fetch_ahead(event, realiser(siblings.first() + i, side));
    if constexpr (requires { queue_->prefetch(0); }) queue_->prefetch(slot(topology_.parents[parent], side));
  }

  /// Applies new plans of `vertices` (ascending, unique) from t on, each from its stored position. Rechecks
  /// every certificate with one of these vertices, or with a realiser that changes in consequence.
  void plans_changed(double t, std::span<const std::uint32_t> vertices) {
    leaf_vertices_.index(vertex_count());
    touched_.clear();
    leaf_vertices_.add_leaves_of(vertices, touched_);
    repair(t, vertices);
  }

  /// Inserts a primitive of the body at t, into the leaf whose boxes on the path from the root grow least.
  /// O(depth) certificates, and O(nodes) at the first edit. If a leaf gets deeper than 2 log2(leaves), a
  /// subtree is rebalanced: O(its leaves), amortised O(log) per insertion.
  void insert(double t, std::uint32_t primitive, const Primitives& primitives,
              const SampledMotion<S>& motion) {
    start_editing(primitives);
    const auto vertices = primitives[primitive];
    motion.fetch(body_, vertices);
    const auto box_of = [&](std::uint32_t node) { return box_of_realisers(realisers(node), motion, body_); };
    const std::uint32_t old_leaf =
        leaf_for(topology_, primitive_box(vertices, motion.positions(body_)), box_of);
    const std::uint32_t leaf = editor_->insert(topology_, old_leaf, primitive, edit_);
    follow_edit();
    unique_.assign(leaf_vertices_[leaf].begin(), leaf_vertices_[leaf].end());
    unique_.insert(unique_.end(), vertices.begin(), vertices.end());
    leaf_vertices_.assign(leaf, unique_, vertex_count());
    if (leaf != old_leaf && old_leaf != TopologyEditor::none)
      notify_split(old_leaf, leaf - 1);
    else
      notify_leaf_changed(leaf);
    repair(t, {});
    for (std::uint32_t top;
         (top = editor_->unbalanced_above(topology_, primitive)) != TopologyEditor::none;) {
      editor_->rebalance(topology_, top, edit_, [&](std::uint32_t node) { return to_double(box_of(node)); });
      follow_edit();
      if constexpr (requires { observer_.subtree_rebuilt(body_, top); })
        observer_.subtree_rebuilt(body_, top);
      repair(t, {});
    }
  }

  /// Removes a primitive at t. O(depth) certificates, and O(nodes) at the first edit.
  void remove(double t, std::uint32_t primitive, const Primitives& primitives) {
    start_editing(primitives);
    const std::uint32_t leaf = editor_->leaf_of(primitive);
    const bool removed = topology_.nodes[leaf].count() == 1;
    unique_.clear();
    if (removed) leaf_vertices_.assign(leaf, unique_, vertex_count());
    editor_->remove(topology_, primitive, edit_);
    follow_edit();
    if (removed) {
      notify_removed(leaf);
    } else {
      const TopologyNode content = topology_.nodes[leaf];
      for (std::uint32_t k = content.first(); k < content.first() + content.count(); ++k) {
        const auto vertices = primitives[topology_.primitives[k]];
        unique_.insert(unique_.end(), vertices.begin(), vertices.end());
      }
      leaf_vertices_.assign(leaf, unique_, vertex_count());
      notify_leaf_changed(leaf);
    }
    repair(t, {});
  }

  std::size_t bytes() const {
    return topology_.bytes() + leaf_vertices_.bytes() + moved_.capacity() * sizeof(SideBits) +
           slots_.bytes() +
           (realisers_.capacity() + touched_.capacity() + marked_.capacity() + affected_.capacity() +
            unique_.capacity()) *
               sizeof(std::uint32_t) +
           (editor_ ? editor_->bytes() : 0);
  }

 private:
  std::uint32_t candidate_count(std::uint32_t node) const {
    const TopologyNode n = topology_.nodes[node];
    return n.is_leaf() ? std::uint32_t(leaf_vertices_[node].size()) : n.count();
  }
  /// Returns a candidate for a side: a vertex of the leaf, or the realiser of a child.
  std::uint32_t candidate(std::uint32_t node, Side side, std::uint32_t i) const {
    const TopologyNode n = topology_.nodes[node];
    return n.is_leaf() ? leaf_vertices_[node][i] : realiser(n.first() + i, side);
  }
  bool old_is_candidate(std::uint32_t node, Side side, std::uint32_t vertex) const {
    for (std::uint32_t i = 0; i < candidate_count(node); ++i)
      if (candidate(node, side, i) == vertex) return true;
    return false;
  }
  std::uint32_t best_at(std::uint32_t node, Side side, double t, std::uint32_t best) {
    const std::uint32_t n = candidate_count(node);
    count_->add(Counter::vertex_reads, n);
    for (std::uint32_t i = 0; i < n; ++i) {
      const std::uint32_t challenger = candidate(node, side, i);
      if (challenger != best && clock_->compare_values(body_, side, challenger, best, t) > 0)
        best = challenger;
    }
    return best;
  }

  void replace(std::uint32_t node, Side side, std::uint32_t vertex, const Now& now) {
    std::uint32_t& realiser = realisers_[std::size_t(sides) * node + side];
    const std::uint32_t old = realiser;
    realiser = vertex;
    count_->add(Counter::values_written);
    observer_.template realiser_changed<S>(body_, node, side, old, vertex, now);
  }

  /// Schedules the earliest failure of the side's certificate from `now` on, and replaces the scheduled one.
  void certify(std::uint32_t node, Side side, const Now& now) {
    Event event;
    event.winner = realiser(node, side);
    event.slot = slot(node, side);
    event.body = body_ % Event::most_bodies;
    event.side = side & 31U;
    event.depth = topology_.depths[node];
    const TopologyNode n = topology_.nodes[node];
    if (n.is_leaf()) {
      const std::span<const std::uint32_t> vertices = leaf_vertices_[node];
      KBVH_ASSERT(std::binary_search(vertices.begin(), vertices.end(), event.winner));
      return certifier_.certify(event, now, vertices, vertices.size() - 1);
    }
    std::uint32_t candidates[8];  // of the children, without the winner: it may realise several
    std::size_t others = 0;
    for (std::uint32_t i = 0; i < n.count(); ++i) {
      candidates[others] = realiser(n.first() + i, side);
      if (candidates[others] != event.winner) ++others;
    }
    certifier_.certify(event, now, {candidates, others}, others);
  }

  std::uint32_t vertex_count() const { return clock_->plans(body_).vertex_count(); }

  void start_editing(const Primitives& primitives) {
    if (!editor_) editor_.emplace(topology_, primitives.count());
  }
  /// Updates all data stored per node after an edit, and collects the nodes to recheck in `touched_`.
  void follow_edit() {
    for (const std::uint32_t node : edit_.vacated) {
      for (Side side = 0; side < sides; ++side) {
        certifier_.withdraw(slot(node, side));
        clock_->remember(slot(node, side), {});
        realisers_[std::size_t(sides) * node + side] = no_vertex;
      }
    }
    const std::uint32_t nodes = topology_.size();
    slots_.grow(sides * nodes, *queue_);
    realisers_.resize(std::size_t(sides) * nodes, no_vertex);
    leaf_vertices_.follow(edit_, nodes, vertex_count());
    touched_ = edit_.fresh;
    touched_.insert(touched_.end(), edit_.changed.begin(), edit_.changed.end());
  }
  void notify_split(std::uint32_t node, std::uint32_t first_child) {
    if constexpr (requires { observer_.leaf_split(body_, node, first_child); })
      observer_.leaf_split(body_, node, first_child);
  }
  void notify_leaf_changed(std::uint32_t leaf) {
    if constexpr (requires { observer_.leaf_changed(body_, leaf); }) observer_.leaf_changed(body_, leaf);
  }
  void notify_removed(std::uint32_t leaf) {
    if constexpr (requires { observer_.node_removed(body_, leaf); }) observer_.node_removed(body_, leaf);
    if constexpr (requires { observer_.node_moved(body_, leaf, leaf); })
      for (const TopologyEdit::Move& move : edit_.moved) observer_.node_moved(body_, move.from, move.to);
  }

  /// Restores realisers and certificates at t, from `touched_` upwards, after changes of plans (`vertices`,
  /// ascending) or of candidates.
  void repair(double t, std::span<const std::uint32_t> vertices) {
    const auto now = Now::at(t);
    marked_.resize(topology_.size(), 0);
    moved_.resize(topology_.size(), 0);
    ++mark_;
    for (const std::uint32_t start : touched_) {
      moved_[start] |= other_candidates;
      for (std::uint32_t node = start; marked_[node] != mark_; node = topology_.parents[node]) {
        marked_[node] = mark_;
        if (node == 0) break;
      }
    }
    affected_.clear();
    if (!touched_.empty()) affected_.push_back(0);
    for (std::size_t i = 0; i < affected_.size(); ++i) {
      const TopologyNode node = topology_.nodes[affected_[i]];
      if (node.is_leaf()) continue;
      for (std::uint32_t child = node.first(); child < node.first() + node.count(); ++child)
        if (marked_[child] == mark_) affected_.push_back(child);
    }
    const auto changed = [&](std::uint32_t v) {
      return std::binary_search(vertices.begin(), vertices.end(), v);
    };
    // The list goes level by level from the root; its reverse is bottom-up.
    for (std::size_t i = affected_.size(); i-- > 0;) {
      const std::uint32_t node = affected_[i];
      for (Side side = 0; side < sides; ++side) {
        const std::uint32_t old = realiser(node, side);
        bool concerned = (moved_[node] & other_candidates) != 0 || changed(old);
        const TopologyNode content = topology_.nodes[node];
        for (std::uint32_t c = 0; !concerned && c < candidate_count(node); ++c)
          concerned = changed(candidate(node, side, c)) ||
                      (!content.is_leaf() && side_moved(content.first() + c, side));
        if (!concerned) continue;
        count_->add(Counter::nodes_visited);
        const bool still_there = old_is_candidate(node, side, old);
        const std::uint32_t best = best_at(node, side, t, still_there ? old : candidate(node, side, 0));
        if (best != old) {
          replace(node, side, best, now);
          moved_[node] = SideBits(moved_[node] | (1u << side));
        }
        certify(node, side, now);
      }
      if (!vertices.empty() && std::any_of(realisers(node), realisers(node) + sides, changed))
        observer_.realiser_plan_changed(body_, node);
    }
    for (std::uint32_t node : affected_) moved_[node] = 0;
  }
  bool side_moved(std::uint32_t node, Side side) const { return (moved_[node] >> side) & 1; }

  static constexpr SideBits other_candidates = SideBits(1u << sides);  ///< in `moved_`

  Topology topology_;
  LeafVertexLists leaf_vertices_;
  std::uint32_t body_;
  CertificateSlots slots_;
  typename Queue::ClockType* clock_;
  Queue* queue_;
  Counters* count_;
  Observer observer_;
  Certifier<S, Queue> certifier_;
  std::vector<std::uint32_t> realisers_;  ///< [node][side]
  // Allocated at the first change of plans.
  std::vector<std::uint32_t> touched_, marked_, affected_;
  std::vector<SideBits> moved_;  ///< sides whose realiser changed in this pass, one bit each
  std::uint32_t mark_ = 0;
  // Allocated at the first change of geometry.
  std::optional<TopologyEditor> editor_;
  TopologyEdit edit_;
  std::vector<std::uint32_t> unique_;
};

/// The kinetic AABB tree of the paper.
template <class S, class Queue, class Observer = NoObserver>
using KineticAabbTree = KineticTree<S, Queue, Observer, 6>;

/// The kinetic k-DOP tree, as a template argument of KineticForest: KineticDop<18>::Tree.
template <int K>
struct KineticDop {
  template <class S, class Queue, class Observer = NoObserver>
  using Tree = KineticTree<S, Queue, Observer, K>;
};

}  // namespace kbvh
