#pragma once
#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <functional>
#include <vector>

#include "core/assert.hpp"
#include "core/counters.hpp"
#include "core/hierarchy/boxtree.hpp"
#include "core/kinetic/kinetic_forest.hpp"

namespace kbvh {

/// What a kinetic BoxTree may be told otherwise: trees with forced axes (Z&W fig. 10), seeded faults.
struct BoxTreeRules {
  /// The axis on which every inner node of a depth is split; 3: the best for its children's boxes.
  static int split_axis(int /*depth*/) { return 3; }
  /// Does a certificate search of `sought` go down to a child whose own side is another? It must.
  static bool descends(Side /*own*/, Side /*sought*/) { return true; }
};

/// What the certificate searches of a BoxTree cost since it was made or `forget` was called.
struct SearchCost {
  std::uint64_t searches = 0;
  std::uint64_t nodes = 0;       ///< nodes looked at by all of them
  std::uint64_t most_nodes = 0;  ///< by the dearest one
  void add(std::uint64_t visited) {
    ++searches;
    nodes += visited;
    most_nodes = std::max(most_nodes, visited);
  }
  void forget() { *this = {}; }
};

/// The kinetic BoxTree of one body (Z&W s.6, with errata): a binary tree of which every node but the root
/// has one side of its own, realised by a vertex, and inherits the other five from its parent: the left child
/// of a node that is split on an axis has an upper side on it, the right child a lower one. (The paper counts
/// the two planes with the parent.) The root owns all six sides.
///
/// A node's certificate says that the realiser of its own side is extremal below it. The search for its
/// earliest failure goes down depth first: at a child with the same own side the stored realiser answers for
/// all below it; other children, also those split on the same axis but to the other side, are descended; at a
/// leaf every vertex is a candidate. So each stored realiser is a candidate of exactly one certificate, that
/// of the nearest ancestor with the same own side (or of the root), and so is each vertex of a leaf per side:
/// for each side, certificates are the inner nodes of a tree whose leaves are the leaves' vertices. If all
/// hold, every realiser is extremal; when one is replaced, that one certificate above must be made anew, and
/// none other.
///
/// Slots of the queue are first_slot + side at the root, else first_slot + 5 + node. Events are handled and
/// observers told as by KineticAabbTree, but for nodes' own sides only.
template <class S, class Queue, class Count, class Observer = NoObserver, class Rules = BoxTreeRules>
class KineticBoxTree {
 public:
  /// Throws std::invalid_argument if the topology is not binary.
  KineticBoxTree(Topology topology, const Primitives& primitives, std::uint16_t body,
                 std::uint32_t first_slot, EventClock<S>& clock, Queue& queue, Count& count,
                 Observer observer = {})
      : topology_(std::move(topology)),
        leaves_(topology_, primitives),
        body_(body),
        first_slot_(first_slot),
        clock_(&clock),
        queue_(&queue),
        count_(&count),
        observer_(observer),
        own_sides_(topology_.size(), 0),
        realisers_(slot_count(topology_), 0) {
    if (topology_.width != 2)
      throw std::invalid_argument("a BoxTree is binary, the topology's width is " +
                                  std::to_string(topology_.width));
  }

  static std::uint64_t slot_count(const Topology& topology) {
    return topology.empty() ? 0 : std::uint64_t(topology.size()) + 5;
  }
  std::uint32_t first_slot() const { return first_slot_; }
  const Topology& topology() const { return topology_; }
  /// The one side that a node does not inherit; not for the root, which inherits none.
  Side own_side(std::uint32_t node) const { return own_sides_[node]; }
  /// The vertex that realises a node's own side; any side of the root.
  std::uint32_t realiser(std::uint32_t node, Side side) const { return realisers_[place(node, side)]; }
  std::uint32_t realiser(std::uint32_t node) const { return realisers_[node + 5]; }
  /// Of the root: [lower x, upper x, lower y, ...].
  const std::uint32_t* root_realisers() const { return realisers_.data(); }
  SearchCost& search_cost() { return search_cost_; }

  /// Chooses the planes, finds every realiser at t and schedules every certificate. O(nodes log nodes +
  /// vertices of leaves).
  void initialise(double t) {
    if (topology_.empty()) return;
    if (!original_.empty()) topology_ = original_;
    leaf_offsets_.clear();
    std::vector<S> positions(std::size_t(3) * clock_->plans(body_).vertex_count() + 1);
    clock_->plans(body_).evaluate(t, positions.data());
    std::vector<std::uint32_t> all(topology_.size());
    for (std::uint32_t node = 0; node < all.size(); ++node) all[node] = node;
    choose_planes(all, positions.data(), nullptr);
    const auto now = Instant<S>::at(t);
    for (std::uint32_t node = topology_.size(); node-- > 1;) start(node, own_sides_[node], now);
    for (Side side = 0; side < 6; ++side) start(0, side, now);
  }

  /// Handles a failure that was popped from the queue: the loser takes over, here and up from certificate to
  /// certificate as long as the winner realises them. O(depth) searches, which cost up to O(nodes) each (Z&W
  /// Theorem 5: responsive in one dimension only).
  void handle(const Event& event) {
    KBVH_ASSERT(event.body == body_);
    const Crossing<S> crossing = clock_->crossing(event);
    const Instant<S> now{event.begin, event.end, &crossing};
    const Side side = event.side;
    const std::uint32_t slot = event.slot - first_slot_;
    std::uint32_t node = slot < 6 ? 0 : slot - 5;
    KBVH_ASSERT(realiser(node, side) == event.winner);
    count_->add(Counter::certificates_failed);
    for (;;) {
      replace(node, side, event.loser, now);
      certify(node, side, now);
      if (node == 0) return;
      node = above(node, side);
      if (realiser(node, side) != event.winner) break;
    }
    certify(node, side, now);  // one of its candidates has changed
  }

  /// The plans of `vertices` (ascending, unique) changed at t, each from its stored position: rechecks every
  /// certificate that they, or realisers that change in consequence, take part in.
  void plans_changed(double t, std::span<const std::uint32_t> vertices) {
    const auto now = Instant<S>::at(t);
    index_leaves();
    const auto changed = [&](std::uint32_t v) {
      return std::binary_search(vertices.begin(), vertices.end(), v);
    };
    affected_.clear();
    for (std::uint32_t v : vertices)
      for (std::uint32_t i = leaf_offsets_[v]; i < leaf_offsets_[v + 1]; ++i)
        mark_certificates_of(leaf_nodes_[i], changed);
    // Children have larger ids than their parents: descending order is bottom-up. Certificates that come to
    // be concerned on the way lie further up, on a path that was marked.
    std::sort(affected_.begin(), affected_.end(), std::greater<>());
    for (std::uint32_t node : affected_) {
      std::uint32_t sides = concerned_[node];
      concerned_[node] = 0;
      for (; sides != marked_only; sides &= sides - 1) {
        const Side side = Side(std::countr_zero(sides));
        count_->add(Counter::nodes_visited);
        const std::uint32_t old = realiser(node, side), best = best_at(node, side, t, old);
        if (best != old) replace(node, side, best, now);
        certify(node, side, now);
        if (node != 0 && (best != old || changed(old))) concern(above(node, side), side);
      }
    }
  }

  /// Builds the tree below a node anew, from positions at the motion's time, to which the tree has been
  /// advanced: leaves stay what they are, inner nodes and planes are chosen again, certificates made again
  /// for these and for the at most six above that searched through them. Node ids below are given anew, their
  /// number stays; observers are not told. `box` is the node's own. O(leaves below, and searches).
  void rebuild_below(std::uint32_t top, const Box<S>& box, const SampledMotion<S>& motion,
                     BuildMethod method) {
    if (topology_.nodes[top].is_leaf()) return;
    if (original_.empty()) original_ = topology_;
    const std::vector<std::uint32_t> ids = regrow(top, motion, method);
    choose_planes(ids, motion.positions(body_), &box);
    const auto now = Instant<S>::at(motion.time());
    for (std::size_t i = ids.size(); i-- > 1;) start(ids[i], own_sides_[ids[i]], now);
    std::uint32_t open = all_sides;
    for (std::uint32_t node = top; open != 0; node = topology_.parents[node]) {
      const std::uint32_t here = open & sides_of(node);
      open &= ~here;
      for (std::uint32_t sides = here; sides != 0; sides &= sides - 1)
        certify(node, Side(std::countr_zero(sides)), now);
    }
  }

  std::size_t bytes() const {
    return topology_.bytes() + original_.bytes() + leaves_.bytes() + own_sides_.size() + concerned_.size() +
           (realisers_.size() + leaf_offsets_.size() + leaf_nodes_.size()) * sizeof(std::uint32_t);
  }

 private:
  static constexpr std::uint32_t all_sides = 0x3f;
  static constexpr std::uint32_t marked_only = 0x40;  ///< above all sides: a node on a marked path

  std::size_t place(std::uint32_t node, Side side) const { return node == 0 ? side : node + 5; }
  /// The sides that the node owns, one bit each.
  std::uint32_t sides_of(std::uint32_t node) const { return node == 0 ? all_sides : 1u << own_sides_[node]; }
  /// The node whose certificate has this node's realiser among its candidates.
  std::uint32_t above(std::uint32_t node, Side side) {
    std::uint64_t visited = 0;
    do {
      node = topology_.parents[node];
      ++visited;
    } while ((sides_of(node) >> side & 1) == 0);
    count_->add(Counter::nodes_visited, visited);
    return node;
  }

  /// Calls visit(vertex) for every candidate of a certificate (Z&W figs. 8, 9).
  template <class Visit>
  void for_candidates(std::uint32_t node, Side side, Visit&& visit) {
    std::uint64_t visited = 0;
    open_.clear();
    open_.push_back(node);
    while (!open_.empty()) {
      const std::uint32_t at = open_.back();
      open_.pop_back();
      ++visited;
      const TopologyNode n = topology_.nodes[at];
      if (n.is_leaf()) {
        for (std::uint32_t v : leaves_[n]) visit(v);
        continue;
      }
      for (std::uint32_t child = n.first() + 2; child-- > n.first();)
        if (own_sides_[child] == side) {
          ++visited;
          visit(realiser(child));
        } else if (Rules::descends(own_sides_[child], side)) {
          open_.push_back(child);
        }
    }
    count_->add(Counter::nodes_visited, visited);
    if constexpr (Count::enabled) search_cost_.add(visited);
  }

  std::uint32_t best_at(std::uint32_t node, Side side, double t, std::uint32_t best) {
    std::uint64_t reads = 0;
    for_candidates(node, side, [&](std::uint32_t challenger) {
      ++reads;
      if (challenger != best && clock_->compare_values(body_, side, challenger, best, t) > 0)
        best = challenger;
    });
    count_->add(Counter::vertex_reads, reads);
    return best;
  }

  /// Finds the realiser and schedules its certificate, with those below in place.
  void start(std::uint32_t node, Side side, const Instant<S>& now) {
    std::uint32_t any = node;
    while (!topology_.nodes[any].is_leaf()) any = topology_.nodes[any].first();
    realisers_[place(node, side)] = best_at(node, side, now.begin, leaves_[topology_.nodes[any]].front());
    certify(node, side, now);
  }

  void replace(std::uint32_t node, Side side, std::uint32_t vertex, const Instant<S>& now) {
    std::uint32_t& realiser = realisers_[place(node, side)];
    const std::uint32_t old = realiser;
    realiser = vertex;
    count_->add(Counter::values_written);
    observer_.template realiser_changed<S>(body_, node, side, old, vertex, now);
  }

  void withdraw(std::uint32_t slot) {
    if (!queue_->cancel(slot)) return;
    count_->add(Counter::certificates_discarded);
    count_->add(Counter::queue_operations);
  }

  /// Schedules the earliest failure of the side's certificate from now on, in place of the one that stood.
  void certify(std::uint32_t node, Side side, const Instant<S>& now) {
    const std::uint32_t slot = first_slot_ + std::uint32_t(place(node, side)), winner = realiser(node, side);
    Event event, earliest;
    bool found = false;
    event.winner = winner;
    event.slot = slot;
    event.body = body_;
    event.side = std::uint8_t(side);
    event.depth = topology_.depths[node];
    withdraw(slot);  // the queue must not hold this slot while the clock learns its new crossing
    std::optional<Crossing<S>> own, earliest_own;
    std::uint64_t made = 0;
    for_candidates(node, side, [&](std::uint32_t challenger) {
      if (challenger == winner) return;
      event.loser = challenger;
      ++made;
      if (!clock_->first_failure(event, now, own)) return;
      if (found && !clock_->overtakes_first(event, own, earliest, earliest_own)) return;
      found = true;
      earliest = event;
      earliest_own = own;
    });
    count_->add(Counter::certificates_made, made);
    clock_->remember(slot, earliest_own);
    if (!found) return;
    queue_->schedule(earliest);
    count_->add(Counter::queue_operations);
    count_->peak(Counter::queue_peak, queue_->size());
  }

  // ---- Planes and rebuilding

  /// Chooses the own sides of the nodes `ids`, a node and all below it, ascending; the first keeps its own.
  /// Its box is `box`, or the tight one.
  void choose_planes(std::span<const std::uint32_t> ids, const S* positions, const Box<S>* box) {
    BoxTreePlanes<S> planes(topology_, ids);
    for (std::size_t i = ids.size(); i-- > 0;)
      if (const TopologyNode n = topology_.nodes[ids[i]]; n.is_leaf())
        planes.set_leaf(i, leaves_.box(n, positions));
    planes.choose(
        box, [this](std::uint32_t node) { return Rules::split_axis(topology_.depths[node]); }, own_sides_);
  }

  /// Replaces the inner nodes below `top`; returns their ids and those of the leaves, ascending from `top`.
  std::vector<std::uint32_t> regrow(std::uint32_t top, const SampledMotion<S>& motion, BuildMethod method) {
    std::vector<std::uint32_t> ids{top};
    std::vector<TopologyNode> leaves;
    for (std::size_t i = 0; i < ids.size(); ++i)
      if (const TopologyNode n = topology_.nodes[ids[i]]; !n.is_leaf())
        ids.insert(ids.end(), {n.first(), n.first() + 1});
    std::sort(ids.begin(), ids.end());
    std::vector<Box<S>> boxes;
    for (std::uint32_t id : ids) {
      if (id != top) withdraw(first_slot_ + std::uint32_t(place(id, own_sides_[id])));
      const TopologyNode n = topology_.nodes[id];
      if (!n.is_leaf()) continue;
      motion.fetch(body_, leaves_[n]);
      leaves.push_back(n);
      boxes.push_back(leaves_.box(n, motion.positions(body_)));
    }
    const Topology made = build_topology<S>(boxes, {.method = method, .width = 2, .leaf_size = 1});
    KBVH_ASSERT(made.size() == ids.size());
    // Children are pairs of neighbours here and there, so the order-preserving renaming keeps them pairs.
    for (std::uint32_t i = 0; i < made.size(); ++i) {
      const TopologyNode n = made.nodes[i];
      const std::uint32_t id = ids[i];
      topology_.nodes[id] =
          n.is_leaf() ? leaves[made.primitives[n.first()]] : TopologyNode::inner(ids[n.first()], 2);
      if (i == 0) continue;
      topology_.parents[id] = ids[made.parents[i]];
      topology_.depths[id] = std::uint8_t(std::min(255, topology_.depths[topology_.parents[id]] + 1));
    }
    topology_.perfect = false;
    leaf_offsets_.clear();  // leaves have other ids
    count_->add(Counter::vertex_reads, ids.size());
    return ids;
  }

  // ---- Changes of plans

  void mark(std::uint32_t node) {
    if (concerned_[node] == 0) affected_.push_back(node);
    concerned_[node] |= marked_only;
  }
  void concern(std::uint32_t node, Side side) { concerned_[node] |= std::uint8_t(1u << side); }

  /// Marks the path above a leaf whose vertices changed: for each side the certificate that takes the leaf's
  /// vertices for candidates, and all whose realiser changed.
  template <class Changed>
  void mark_certificates_of(std::uint32_t leaf, Changed&& changed) {
    std::uint32_t open = all_sides;
    for (std::uint32_t node = leaf;; node = topology_.parents[node]) {
      count_->add(Counter::nodes_visited);
      mark(node);
      for (std::uint32_t sides = sides_of(node); sides != 0; sides &= sides - 1) {
        const Side side = Side(std::countr_zero(sides));
        if ((open >> side & 1) != 0 || changed(realiser(node, side))) concern(node, side);
      }
      open &= ~sides_of(node);
      if (node == 0) return;
    }
  }

  void index_leaves() {
    if (!leaf_offsets_.empty()) return;
    leaf_offsets_.assign(clock_->plans(body_).vertex_count() + 1, 0);
    concerned_.assign(topology_.size(), 0);
    for (const TopologyNode n : topology_.nodes)
      if (n.is_leaf())
        for (std::uint32_t v : leaves_[n]) ++leaf_offsets_[v + 1];
    for (std::size_t v = 1; v < leaf_offsets_.size(); ++v) leaf_offsets_[v] += leaf_offsets_[v - 1];
    leaf_nodes_.resize(leaf_offsets_.back());
    std::vector<std::uint32_t> next(leaf_offsets_.begin(), leaf_offsets_.end() - 1);
    for (std::uint32_t node = 0; node < topology_.size(); ++node)
      if (topology_.nodes[node].is_leaf())
        for (std::uint32_t v : leaves_[topology_.nodes[node]]) leaf_nodes_[next[v]++] = node;
  }

  Topology topology_;
  Topology original_;  ///< what starting over starts with; empty as long as nothing was rebuilt
  BoxTreeLeaves leaves_;
  std::uint16_t body_;
  std::uint32_t first_slot_;
  EventClock<S>* clock_;
  Queue* queue_;
  Count* count_;
  Observer observer_;
  std::vector<std::uint8_t> own_sides_;   ///< [node]
  std::vector<std::uint32_t> realisers_;  ///< six of the root, then one of each other node
  std::vector<std::uint32_t> open_;       ///< of a search
  SearchCost search_cost_;
  // For plan changes, made when the first one comes: leaves of each vertex, marks of affected nodes.
  std::vector<std::uint32_t> leaf_offsets_, leaf_nodes_, affected_;
  std::vector<std::uint8_t> concerned_;  ///< [node]: sides whose certificate is to be rechecked, one bit each
};

/// The plain tree, as a parameter of KineticForest.
template <class S, class Queue, class Count, class Observer>
using PlainBoxTree = KineticBoxTree<S, Queue, Count, Observer>;

/// The kinetic BoxTrees of all bodies of a scene on one event queue.
template <class S, class Queue, class Count, class Observer = NoObserver>
using KineticBoxForest = KineticForest<S, Queue, Count, Observer, PlainBoxTree>;

}  // namespace kbvh
