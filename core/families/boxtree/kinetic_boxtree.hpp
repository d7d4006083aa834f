#pragma once
#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <limits>
#include <numeric>
#include <optional>
#include <vector>

#include "core/base/assert.hpp"
#include "core/base/counters.hpp"
#include "core/families/boxtree/boxtree.hpp"
#include "core/families/boxtree/boxtree_search.hpp"
#include "core/families/events/certificate_slots.hpp"
#include "core/families/events/kinetic_forest.hpp"
#include "core/geometry/lane_box.hpp"
#include "core/topology/topology_edit.hpp"

namespace kbvh {

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
/// hold, every realiser is extremal; when one is replaced, that one certificate above is concerned, and none
/// other; and there, if its own realiser stays, the search is needed only if it was the replaced vertex that
/// would have come next.
///
/// Slots of the queue are first_slot + side at the root, else first_slot + 5 + node, for the nodes that there
/// were at the start; later ones get theirs in chunks. Events are handled and observers told as by
/// KineticAabbTree, but for nodes' own sides only, and not of what insertions and deletions do to nodes.
///
/// Primitives can be inserted and removed at any time. The edit of the topology is local; where it was, the
/// one certificate per side that searches there is made again, those of new nodes are made, and from there up
/// those are made again below whose node a realiser has changed.
template <class S, class Queue, class Count, class Observer = NoObserver, class Rules = BoxTreeRules>
class KineticBoxTree {
 public:
  /// Throws std::invalid_argument if the topology is not binary.
  KineticBoxTree(Topology topology, const Primitives& primitives, std::uint32_t body,
                 std::uint32_t first_slot, EventClock<S>& clock, Queue& queue, Count& count,
                 Observer observer = {})
      : topology_(std::move(topology)),
        leaves_(topology_, primitives),
        body_(body),
        slots_(first_slot, std::uint32_t(slot_count(topology_))),
        clock_(&clock),
        queue_(&queue),
        count_(&count),
        observer_(observer),
        own_sides_(topology_.size(), 0),
        realisers_(slot_count(topology_), 0),
        search_(clock.plans(body).vertex_count()) {
    if (topology_.width != 2)
      throw std::invalid_argument("a BoxTree is binary, the topology's width is " +
                                  std::to_string(topology_.width));
  }

  static std::uint64_t slot_count(const Topology& topology) {
    return topology.empty() ? 0 : std::uint64_t(topology.size()) + 5;
  }
  std::uint32_t first_slot() const { return slots_.slot(0); }
  /// After insertions or deletions it is laid out as TopologyEditor says, with ids that mean nothing.
  const Topology& topology() const { return topology_; }
  /// Has it been edited since it was made?
  bool edited() const { return editor_.has_value(); }
  /// The topology as a builder lays it out: node i of it is node order[i] of the tree.
  Topology compacted_topology(std::vector<std::uint32_t>& order) const {
    if (editor_) return compacted(topology_, order);
    order.resize(topology_.size());
    std::iota(order.begin(), order.end(), 0u);
    return topology_;
  }
  /// The node that a slot of the queue belongs to.
  std::uint32_t node_of(std::uint32_t slot) const {
    const std::uint32_t place = slots_.place(slot);
    return place < 6 ? 0 : place - 5;
  }
  /// The one side that a node does not inherit; not for the root, which inherits none.
  Side own_side(std::uint32_t node) const { return own_sides_[node]; }
  /// The vertex that realises a node's own side; any side of the root.
  std::uint32_t realiser(std::uint32_t node, Side side) const { return realisers_[place(node, side)]; }
  std::uint32_t realiser(std::uint32_t node) const { return realisers_[node + 5]; }
  /// The vertex that realises a side of a node; `no_vertex` for a side that it inherits.
  std::uint32_t realiser_or_none(std::uint32_t node, Side side) const {
    return (sides_of(node) >> side & 1) != 0 ? realiser(node, side) : no_vertex;
  }
  /// Of a side that the node owns.
  std::uint32_t slot(std::uint32_t node, Side side) const {
    return slots_.slot(std::uint32_t(place(node, side)));
  }
  /// The node whose certificate has this node's realiser among its candidates; not of the root.
  std::uint32_t certificate_above(std::uint32_t node, Side side) const {
    do node = topology_.parents[node];
    while ((sides_of(node) >> side & 1) == 0);
    return node;
  }
  /// Of the root: [lower x, upper x, lower y, ...].
  const std::uint32_t* root_realisers() const { return realisers_.data(); }
  /// Unique, ascending; of a leaf.
  std::span<const std::uint32_t> leaf_vertices(std::uint32_t node) const {
    return leaves_[topology_.nodes[node]];
  }
  /// A node's box at the motion's time, as inherited. O(depth).
  Box<S> box_of(std::uint32_t node, const SampledMotion<S>& motion) const {
    std::uint32_t realisers[6] = {}, open = all_sides;
    for (; open != 0; node = topology_.parents[node]) {
      const std::uint32_t here = open & sides_of(node);
      for (std::uint32_t sides = here; sides != 0; sides &= sides - 1) {
        const Side side = Side(std::countr_zero(sides));
        realisers[side] = realiser(node, side);
      }
      open &= ~here;
    }
    return box_of_realisers(realisers, motion, body_);
  }
  SearchCost& search_cost() { return search_cost_; }

  /// Chooses the planes, finds every realiser at t and schedules every certificate. O(nodes log nodes +
  /// vertices of leaves).
  void initialise(double t) {
    if (topology_.empty()) return;
    if (!original_.empty()) {
      topology_ = original_;
      place_leaves();
    }
    std::vector<S> positions(std::size_t(3) * clock_->plans(body_).vertex_count() + 1);
    clock_->plans(body_).evaluate(t, positions.data());
    const std::vector<std::uint32_t> all = choose_planes(0, positions.data(), nullptr);
    const auto now = Instant<S>::at(t);
    for (std::size_t i = all.size(); i-- > 1;) start(all[i], own_sides_[all[i]], now);
    for (Side side = 0; side < 6; ++side) start(0, side, now);
  }

  /// Handles a failure that was popped from the queue: the loser takes over, here and up from certificate to
  /// certificate as long as the winner realises them. O(depth) searches, which cost up to O(nodes) each (Z&W
  /// Theorem 5: responsive in one dimension only).
  void handle(const Event& event) {
    KBVH_ASSERT(event.body == body_);
    const Crossing<S> crossing = clock_->crossing(event);
    const Instant<S> now{event.begin, event.end, &crossing, event.segment};
    const Side side = event.side;
    std::uint32_t node = node_of(event.slot);
    KBVH_ASSERT(realiser(node, side) == event.winner);
    count_->add(Counter::certificates_failed);
    count_->event_at(topology_.depths[node]);
    for (;;) {
      replace(node, side, event.loser, now);
      certify(node, side, now);
      if (node == 0) return;
      node = above(node, side);
      if (realiser(node, side) != event.winner) break;
    }
    exchange_candidate(node, side, event.winner, event.loser, now);
  }

  /// The plans of `vertices` (ascending, unique) changed at t, each from its stored position: rechecks every
  /// certificate that they, or realisers that change in consequence, take part in.
  void plans_changed(double t, std::span<const std::uint32_t> vertices) {
    leaves_.index(topology_, clock_->plans(body_).vertex_count());
    const auto changed = [&](std::uint32_t v) {
      return std::binary_search(vertices.begin(), vertices.end(), v);
    };
    concerned_.resize(topology_.size(), 0);
    for (std::uint32_t v : vertices)
      leaves_.for_leaves_of(v, [&](std::uint32_t leaf) { mark_certificates_of(leaf, changed); });
    repair(t, changed);
  }

  /// Inserts a primitive that the body has now, at t: at the leaf whose boxes on the way down grow least. At
  /// most two certificates of new nodes, one above for each side, and more where realisers change; what their
  /// searches cost is the tree's to say (search_cost). O(nodes) the first time for what edits need. Where a
  /// leaf gets deeper than 2 log2(leaves), a subtree is balanced anew, amortised O(log) leaves per insertion.
  void insert(double t, std::uint32_t primitive, const Primitives& primitives,
              const SampledMotion<S>& motion) {
    start_editing(primitives);
    const std::uint32_t vertex_count = clock_->plans(body_).vertex_count();
    search_.resize(vertex_count);
    const auto vertices = primitives[primitive];
    motion.fetch(body_, vertices);
    const Box<S> box = primitive_box(vertices, motion.positions(body_));
    const std::uint32_t old_leaf =
        leaf_for(topology_, box, [&](std::uint32_t node) { return box_of(node, motion); });
    Box<S> top_box = box;
    unique_.assign(vertices.begin(), vertices.end());
    TopologyNode before;
    if (old_leaf != TopologyEditor::none) {
      before = topology_.nodes[old_leaf];
      top_box.extend(box_of(old_leaf, motion));
    }
    const std::uint32_t leaf = editor_->insert(topology_, old_leaf, primitive, edit_);
    follow_edit();
    if (leaf == old_leaf) {  // had room
      unique_.insert(unique_.end(), leaves_[before].begin(), leaves_[before].end());
      leaves_.drop(before);  // its entries may be others
    }
    set_leaf_vertices(leaf, vertex_count);
    if (leaf != old_leaf && old_leaf != TopologyEditor::none) {
      motion.fetch(body_, leaves_[before]);
      choose_planes(old_leaf, motion.positions(body_), &top_box);
    }
    repair_edit(t);
    for (std::uint32_t top;
         (top = editor_->unbalanced_above(topology_, primitive)) != TopologyEditor::none;) {
      top_box = box_of(top, motion);
      editor_->rebalance(topology_, top, edit_, [&](std::uint32_t node) {
        motion.fetch(body_, leaves_[topology_.nodes[node]]);
        return to_double(leaves_.box(topology_.nodes[node], motion.positions(body_)));
      });
      follow_edit();
      choose_planes(top, motion.positions(body_), &top_box);
      repair_edit(t);
    }
  }

  /// Takes a primitive out at t: the certificates above are made again as after an insertion.
  void remove(double t, std::uint32_t primitive, const Primitives& primitives) {
    start_editing(primitives);
    const std::uint32_t leaf = editor_->leaf_of(primitive);
    const bool removed = topology_.nodes[leaf].count() == 1;
    if (removed) leaves_.drop(topology_.nodes[leaf]);
    editor_->remove(topology_, primitive, edit_);
    follow_edit();
    if (!removed) {
      const TopologyNode content = topology_.nodes[leaf];
      unique_.clear();
      for (std::uint32_t k = content.first(); k < content.first() + content.count(); ++k) {
        const auto vertices = primitives[topology_.primitives[k]];
        unique_.insert(unique_.end(), vertices.begin(), vertices.end());
      }
      set_leaf_vertices(leaf, clock_->plans(body_).vertex_count());
    }
    repair_edit(t);
  }

  /// Builds the tree below a node anew, from positions at the motion's time, to which the tree has been
  /// advanced: leaves stay what they are, inner nodes and planes are chosen again, certificates made again
  /// for these and for the at most six above that searched through them. Node ids below are given anew, their
  /// number stays; observers are not told. `box` is the node's own. O(leaves below, and searches).
  void rebuild_below(std::uint32_t top, const Box<S>& box, const SampledMotion<S>& motion,
                     BuildMethod method) {
    if (topology_.nodes[top].is_leaf()) return;
    if (original_.empty() && !editor_) original_ = topology_;
    regrow(top, motion, method);
    const std::vector<std::uint32_t> ids = choose_planes(top, motion.positions(body_), &box);
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
           slots_.bytes() + realisers_.size() * sizeof(std::uint32_t) + search_.bytes() +
           (editor_ ? editor_->bytes() : 0);
  }

 private:
  static constexpr double never = std::numeric_limits<double>::infinity();
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

  /// Calls visit(vertex) once for every candidate of a certificate.
  template <class Visit>
  void for_candidates(std::uint32_t node, Side side, Visit&& visit) {
    const std::uint64_t visited = search_.run(
        topology_, leaves_, own_sides_.data(), node, side,
        [this](std::uint32_t child) { return realiser(child); }, visit);
    count_->add(Counter::nodes_visited, visited);
    if constexpr (Count::enabled) search_cost_.add(visited);
  }

  /// The best candidate; of equal ones `preferred`, if it is among them, or else the first.
  std::uint32_t best_at(std::uint32_t node, Side side, double t, std::uint32_t preferred) {
    std::uint64_t reads = 0;
    std::uint32_t best = no_vertex;
    for_candidates(node, side, [&](std::uint32_t challenger) {
      ++reads;
      const int order = best == no_vertex ? 1 : clock_->compare_values(body_, side, challenger, best, t);
      if (order > 0 || (order == 0 && challenger == preferred)) best = challenger;
    });
    count_->add(Counter::vertex_reads, reads);
    return best == no_vertex ? preferred : best;  // none: only where rules are faulty
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
    const std::uint32_t slot = this->slot(node, side), winner = realiser(node, side);
    Event event, earliest;
    bool found = false;
    event.winner = winner;
    event.slot = slot;
    event.body = body_ % Event::most_bodies;
    event.side = side & 7U;
    event.depth = topology_.depths[node];
    withdraw(slot);  // the queue must not hold this slot while the clock learns its new crossing
    std::optional<Crossing<S>> own, earliest_own;
    std::uint64_t made = 0;
    for_candidates(node, side, [&](std::uint32_t challenger) {
      if (challenger == winner) return;
      event.loser = challenger;
      ++made;
      if (!clock_->first_failure(event, now, own, found ? earliest.end : never)) return;
      if (found && !clock_->overtakes_first(event, own, earliest, earliest_own)) return;
      found = true;
      earliest = event;
      earliest_own = own;
    });
    count_->add(Counter::certificates_made, made);
    clock_->remember(slot, earliest_own);
    if (found) schedule(earliest);
  }
  void schedule(const Event& event) {
    queue_->schedule(event);
    count_->add(Counter::queue_operations);
    count_->peak(Counter::queue_peak, queue_->size());
  }

  /// Of a certificate's candidates, `before` has been replaced by `after`, which is not ahead of the
  /// realiser. As long as it was not `before` who comes next, the others need not be looked at again.
  void exchange_candidate(std::uint32_t node, Side side, std::uint32_t before, std::uint32_t after,
                          const Instant<S>& now) {
    const std::uint32_t slot = this->slot(node, side), winner = realiser(node, side);
    const bool scheduled = queue_->scheduled(slot);
    if (scheduled && queue_->event(slot).loser == before) return certify(node, side, now);
    if (after == winner) return;
    Event event;
    event.winner = winner;
    event.loser = after;
    event.slot = slot;
    event.body = body_ % Event::most_bodies;
    event.side = side & 7U;
    event.depth = topology_.depths[node];
    std::optional<Crossing<S>> own, next_own;
    count_->add(Counter::certificates_made);
    if (!clock_->first_failure(event, now, own, scheduled ? queue_->event(slot).end : never)) return;
    if (scheduled) {
      const Event& next = queue_->event(slot);
      const FlightPlans<S>& plans = clock_->plans(body_);
      if (plans.has_own_plan(next.winner) || plans.has_own_plan(next.loser))
        next_own = clock_->crossing(next);
      if (!clock_->overtakes_first(event, own, next, next_own)) return;
      withdraw(slot);
    }
    clock_->remember(slot, own);
    schedule(event);
  }

  // ---- Planes and rebuilding

  /// Chooses the own sides of all nodes below `top`, whose box is `box`, or the tight one. Returns `top` and
  /// all below it, parents before children.
  std::vector<std::uint32_t> choose_planes(std::uint32_t top, const S* positions, const Box<S>* box) {
    std::vector<std::uint32_t> ids = subtree_of(topology_, top);
    std::vector<std::uint8_t> own_sides = choose_own_sides<S>(
        topology_, ids, [&](TopologyNode leaf) { return leaves_.box(leaf, positions); }, box,
        [&](std::uint32_t node) { return Rules::split_axis(topology_.depths[node]); });
    for (std::size_t i = 1; i < ids.size(); ++i) own_sides_[ids[i]] = own_sides[i];
    return ids;
  }

  /// Replaces the inner nodes below `top`.
  void regrow(std::uint32_t top, const SampledMotion<S>& motion, BuildMethod method) {
    std::vector<std::uint32_t> ids = subtree_of(topology_, top);
    std::vector<Box<S>> boxes;
    std::sort(ids.begin() + 1, ids.end());
    for (const std::uint32_t id : ids) {
      if (id != top) withdraw(slot(id, own_sides_[id]));
      const TopologyNode n = topology_.nodes[id];
      if (!n.is_leaf()) continue;
      motion.fetch(body_, leaves_[n]);
      boxes.push_back(leaves_.box(n, motion.positions(body_)));
    }
    regrow_subtree<S>(topology_, ids, boxes, method);
    for (const std::uint32_t id : ids) {
      if (!topology_.nodes[id].is_leaf()) continue;
      leaves_.placed(topology_.nodes[id], id);
      if (editor_) editor_->placed(topology_, id);
    }
    count_->add(Counter::vertex_reads, ids.size());
  }

  // ---- Changes of plans and of geometry

  void mark(std::uint32_t node) { concerned_[node] |= marked_only; }
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

  /// Looks at every concerned certificate on the marked paths, from the leaves up. Realisers that `changed`
  /// have another plan.
  template <class Changed>
  void repair(double t, Changed&& changed) {
    const auto now = Instant<S>::at(t);
    affected_.clear();
    if (!topology_.empty() && concerned_[0] != 0) affected_.push_back(0);
    for (std::size_t i = 0; i < affected_.size(); ++i) {
      const TopologyNode n = topology_.nodes[affected_[i]];
      if (n.is_leaf()) continue;
      for (std::uint32_t child = n.first(); child < n.first() + 2; ++child)
        if (concerned_[child] != 0) affected_.push_back(child);
    }
    // Level by level from the root, so backwards it is bottom-up. Certificates that come to be concerned on
    // the way lie further up, on a path that was marked.
    for (std::size_t i = affected_.size(); i-- > 0;) {
      const std::uint32_t node = affected_[i];
      std::uint32_t sides = concerned_[node];
      concerned_[node] = 0;
      for (; sides != marked_only; sides &= sides - 1) {
        const Side side = Side(std::countr_zero(sides));
        count_->add(Counter::nodes_visited);
        const std::uint32_t old = realiser(node, side), best = best_at(node, side, t, old);
        if (best != old) replace(node, side, best, now);
        certify(node, side, now);
        if (node != 0 && Rules::carries_up() && (best != old || changed(old)))
          concern(above(node, side), side);
      }
    }
  }

  void start_editing(const Primitives& primitives) {
    if (editor_) return;
    editor_.emplace(topology_, primitives.count());
    original_ = {};  // starting over starts with what is there
  }
  /// Brings all that is kept by node in line with what the editor did.
  void follow_edit() {
    for (const std::uint32_t node : edit_.vacated)
      for (Side side = 0; side < 6; ++side) {
        if (node != 0 && side != own_sides_[node]) continue;
        withdraw(slot(node, side));
        clock_->remember(slot(node, side), {});
        realisers_[place(node, side)] = no_vertex;
      }
    const std::uint32_t nodes = topology_.size(), places = std::uint32_t(slot_count(topology_));
    slots_.grow(places, *queue_);
    if (realisers_.size() < places) realisers_.resize(places, no_vertex);
    if (own_sides_.size() < nodes) own_sides_.resize(nodes, 0);
    for (const TopologyEdit::Move& move : edit_.moved) leaves_.placed(topology_.nodes[move.to], move.to);
  }
  /// Makes `unique_`, in any order and with repetitions, the list of a leaf.
  void set_leaf_vertices(std::uint32_t leaf, std::uint32_t vertex_count) {
    std::sort(unique_.begin(), unique_.end());
    unique_.erase(std::unique(unique_.begin(), unique_.end()), unique_.end());
    leaves_.assign(topology_.nodes[leaf], leaf, unique_, vertex_count);
  }
  /// After an edit: certificates of nodes that are new, and all that searched through those that changed.
  void repair_edit(double t) {
    const auto unchanged = [](std::uint32_t) { return false; };
    if (concerned_.size() < topology_.size()) concerned_.resize(topology_.size(), 0);
    for (const std::uint32_t node : edit_.changed) mark_certificates_of(node, unchanged);
    for (const std::uint32_t start : edit_.fresh) {
      for (std::uint32_t node = start; concerned_[node] == 0; node = topology_.parents[node]) mark(node);
      concerned_[start] = std::uint8_t(concerned_[start] | sides_of(start));
    }
    repair(t, unchanged);
  }
  void place_leaves() {
    for (std::uint32_t node = 0; node < topology_.size(); ++node) leaves_.placed(topology_.nodes[node], node);
  }

  Topology topology_;
  Topology original_;  ///< what starting over starts with; empty as long as nothing was rebuilt
  BoxTreeLeaves leaves_;
  std::uint32_t body_;
  CertificateSlots slots_;
  EventClock<S>* clock_;
  Queue* queue_;
  Count* count_;
  Observer observer_;
  std::vector<std::uint8_t> own_sides_;   ///< [node]
  std::vector<std::uint32_t> realisers_;  ///< six of the root, then one of each other node
  CandidateSearch<Rules> search_;
  SearchCost search_cost_;
  // For changes, made when the first one comes.
  std::vector<std::uint32_t> affected_;
  std::vector<std::uint8_t> concerned_;  ///< [node]: sides whose certificate is to be rechecked, one bit each
  // For changes of geometry.
  std::optional<TopologyEditor> editor_;
  TopologyEdit edit_;
  std::vector<std::uint32_t> unique_;
};

/// The plain tree, as a parameter of KineticForest.
template <class S, class Queue, class Count, class Observer>
using PlainBoxTree = KineticBoxTree<S, Queue, Count, Observer>;

/// The kinetic BoxTrees of all bodies of a scene on one event queue.
template <class S, class Queue, class Count, class Observer = NoObserver>
using KineticBoxForest = KineticForest<S, Queue, Count, Observer, PlainBoxTree>;

}  // namespace kbvh
