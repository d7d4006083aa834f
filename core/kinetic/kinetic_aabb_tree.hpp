#pragma once
#include <algorithm>
#include <cstdint>
#include <vector>

#include "core/assert.hpp"
#include "core/counters.hpp"
#include "core/hierarchy/topology.hpp"
#include "core/kinetic/event.hpp"

namespace kbvh {

/// Change notices for a kinetic tree that nobody watches.
struct NoObserver {
  template <class S>
  void realiser_changed(std::uint32_t /*body*/, std::uint32_t /*node*/, Side /*side*/,
                        std::uint32_t /*old_vertex*/, std::uint32_t /*new_vertex*/,
                        const Instant<S>& /*now*/) {}
  void realiser_plan_changed(std::uint32_t /*body*/, std::uint32_t /*node*/) {}
};

/// The kinetic AABB tree of one body (Z&W s.4): per node and side the vertex that realises the bound, and one
/// certificate that it does; the earliest failure of each certificate is scheduled in a queue that several
/// structures may share. Any width and leaf size: a leaf's certificate is the earliest overtaker among its
/// unique vertices, an inner node's the earliest among its other children's realisers.
///
/// Slots of the queue are first_slot + 6 * node + side. Observer::realiser_changed(body, node, side, old,
/// new, instant) is called at every change of a bound's realiser, deeper nodes first, and
/// Observer::realiser_plan_changed(body, node) for a node of which a realiser has another plan from now on.
template <class S, class Queue, class Count, class Observer = NoObserver>
class KineticAabbTree {
 public:
  KineticAabbTree(Topology topology, const Primitives& primitives, std::uint16_t body,
                  std::uint32_t first_slot, EventClock<S>& clock, Queue& queue, Count& count,
                  Observer observer = {})
      : topology_(std::move(topology)),
        leaf_vertices_(unique_leaf_vertices(topology_, primitives)),
        body_(body),
        first_slot_(first_slot),
        clock_(&clock),
        queue_(&queue),
        count_(&count),
        observer_(observer),
        realisers_(std::size_t(6) * topology_.size(), 0) {}

  static std::uint64_t slot_count(const Topology& topology) { return std::uint64_t(6) * topology.size(); }
  std::uint32_t first_slot() const { return first_slot_; }
  const Topology& topology() const { return topology_; }
  const LeafVertices& leaf_vertices() const { return leaf_vertices_; }
  std::uint32_t realiser(std::uint32_t node, Side side) const {
    return realisers_[std::size_t(6) * node + side];
  }
  const std::uint32_t* realisers(std::uint32_t node) const {
    return realisers_.data() + std::size_t(6) * node;
  }

  /// Finds every realiser at t and schedules every certificate. O(nodes log nodes + vertices of leaves).
  void initialise(double t) {
    const auto now = Instant<S>::at(t);
    for (std::uint32_t node = topology_.size(); node-- > 0;)
      for (Side side = 0; side < 6; ++side) {
        realisers_[std::size_t(6) * node + side] = best_at(node, side, t, candidate(node, side, 0));
        certify(node, side, now);
      }
  }

  /// Handles a failure that was popped from the queue: the loser takes over, here and in every ancestor that
  /// the winner realises (leaf and tree events, Z&W s.4). O(depth) certificates.
  void handle(const Event& event) {
    KBVH_ASSERT(event.body == body_);
    const Crossing<S> crossing = clock_->crossing(event);
    const Instant<S> now{event.begin, event.end, &crossing};
    const Side side = event.side;
    std::uint32_t node = (event.slot - first_slot_) / 6;
    KBVH_ASSERT(realiser(node, side) == event.winner);
    count_->add(Counter::certificates_failed);
    for (;;) {
      replace(node, side, event.loser, now);
      certify(node, side, now);
      if (node == 0) return;
      node = topology_.parents[node];
      count_->add(Counter::nodes_visited);
      if (realiser(node, side) != event.winner) break;
    }
    certify(node, side, now);  // one of its challengers has changed
  }

  /// The plans of `vertices` (ascending, unique) changed at t, each from its stored position: rechecks every
  /// certificate that they, or realisers that change in consequence, take part in.
  void plans_changed(double t, std::span<const std::uint32_t> vertices) {
    const auto now = Instant<S>::at(t);
    index_leaves();
    affected_.clear();
    for (std::uint32_t v : vertices)
      for (std::uint32_t i = leaf_offsets_[v]; i < leaf_offsets_[v + 1]; ++i)
        for (std::uint32_t node = leaves_[i];; node = topology_.parents[node]) {
          if (marked_[node] == mark_) break;
          marked_[node] = mark_;
          affected_.push_back(node);
          if (node == 0) break;
        }
    ++mark_;
    // Children have larger ids than their parents: descending order is bottom-up.
    std::sort(affected_.begin(), affected_.end(), std::greater<>());
    const auto changed = [&](std::uint32_t v) {
      return std::binary_search(vertices.begin(), vertices.end(), v);
    };
    for (std::uint32_t node : affected_) {
      for (Side side = 0; side < 6; ++side) {
        const std::uint32_t old = realiser(node, side);
        bool concerned = topology_.nodes[node].is_leaf() || changed(old);
        for (std::uint32_t c = 0; !concerned && c < candidate_count(node); ++c) {
          const std::uint32_t child = topology_.nodes[node].first() + c;
          concerned = changed(candidate(node, side, c)) || side_moved(child, side);
        }
        set_side_moved(node, side, false);
        if (!concerned) continue;
        count_->add(Counter::nodes_visited);
        const bool still_there = old_is_candidate(node, side, old);
        const std::uint32_t best = best_at(node, side, t, still_there ? old : candidate(node, side, 0));
        if (best != old) {
          replace(node, side, best, now);
          set_side_moved(node, side, true);
        }
        certify(node, side, now);
      }
      if (std::any_of(realisers(node), realisers(node) + 6, changed))
        observer_.realiser_plan_changed(body_, node);
    }
    for (std::uint32_t node : affected_) moved_[node] = 0;
  }

  std::size_t bytes() const {
    return topology_.bytes() + realisers_.size() * sizeof(std::uint32_t) +
           (leaf_vertices_.offsets.size() + leaf_vertices_.vertices.size() + leaf_offsets_.size() +
            leaves_.size() + marked_.size()) *
               sizeof(std::uint32_t) +
           moved_.size();
  }

 private:
  std::uint32_t candidate_count(std::uint32_t node) const {
    const TopologyNode n = topology_.nodes[node];
    return n.is_leaf() ? std::uint32_t(leaf_vertices_[node].size()) : n.count();
  }
  /// A vertex that may realise the side: one of the leaf's, or a child's realiser.
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

  void replace(std::uint32_t node, Side side, std::uint32_t vertex, const Instant<S>& now) {
    std::uint32_t& realiser = realisers_[std::size_t(6) * node + side];
    const std::uint32_t old = realiser;
    realiser = vertex;
    count_->add(Counter::values_written);
    observer_.template realiser_changed<S>(body_, node, side, old, vertex, now);
  }

  /// Schedules the earliest failure of the side's certificate from now on, in place of the one that stood.
  void certify(std::uint32_t node, Side side, const Instant<S>& now) {
    const std::uint32_t slot = first_slot_ + 6 * node + side, winner = realiser(node, side);
    const std::uint32_t n = candidate_count(node);
    Event event, earliest;
    bool found = false;
    event.winner = winner;
    event.slot = slot;
    event.body = body_;
    event.side = std::uint8_t(side);
    event.depth = topology_.depths[node];
    // The queue must not hold this slot while the clock learns its new crossing.
    if (queue_->cancel(slot)) {
      count_->add(Counter::certificates_discarded);
      count_->add(Counter::queue_operations);
    }
    std::optional<Crossing<S>> own, earliest_own;
    for (std::uint32_t i = 0; i < n; ++i) {
      event.loser = candidate(node, side, i);
      if (event.loser == winner) continue;
      count_->add(Counter::certificates_made);
      if (!clock_->first_failure(event, now, own)) continue;
      if (found && !clock_->overtakes_first(event, own, earliest, earliest_own)) continue;
      found = true;
      earliest = event;
      earliest_own = own;
    }
    clock_->remember(slot, earliest_own);
    if (!found) return;
    queue_->schedule(earliest);
    count_->add(Counter::queue_operations);
    count_->peak(Counter::queue_peak, queue_->size());
  }

  void index_leaves() {
    if (!leaf_offsets_.empty()) return;
    leaf_offsets_.assign(clock_->plans(body_).vertex_count() + 1, 0);
    for (std::uint32_t v : leaf_vertices_.vertices) ++leaf_offsets_[v + 1];
    for (std::size_t v = 1; v < leaf_offsets_.size(); ++v) leaf_offsets_[v] += leaf_offsets_[v - 1];
    leaves_.resize(leaf_vertices_.vertices.size());
    std::vector<std::uint32_t> next(leaf_offsets_.begin(), leaf_offsets_.end() - 1);
    for (std::uint32_t node = 0; node < topology_.size(); ++node)
      for (std::uint32_t v : leaf_vertices_[node]) leaves_[next[v]++] = node;
    marked_.assign(topology_.size(), 0);
    moved_.assign(topology_.size(), 0);
  }
  bool side_moved(std::uint32_t node, Side side) const { return (moved_[node] >> side) & 1; }
  void set_side_moved(std::uint32_t node, Side side, bool moved) {
    moved_[node] = std::uint8_t(moved ? moved_[node] | (1u << side) : moved_[node] & ~(1u << side));
  }

  Topology topology_;
  LeafVertices leaf_vertices_;
  std::uint16_t body_;
  std::uint32_t first_slot_;
  EventClock<S>* clock_;
  Queue* queue_;
  Count* count_;
  Observer observer_;
  std::vector<std::uint32_t> realisers_;  ///< [node][side]
  // For plan changes, made when the first one comes: leaves of each vertex, marks of affected nodes.
  std::vector<std::uint32_t> leaf_offsets_, leaves_, marked_, affected_;
  std::vector<std::uint8_t> moved_;  ///< sides whose realiser changed in this pass, one bit each
  std::uint32_t mark_ = 1;
};

}  // namespace kbvh
