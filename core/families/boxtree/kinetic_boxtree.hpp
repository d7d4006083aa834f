#pragma once
#include <algorithm>
#include <bit>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/families/boxtree/boxtree_certificates.hpp"
#include "core/families/boxtree/boxtree_moments.hpp"
#include "core/topology/topology_edit.hpp"

namespace kbvh {

/// The kinetic BoxTree of one body (Z&W s.6, with errata). BoxTreeBounds stores its data, and
/// BoxTreeCertificates keeps it valid. This class builds the tree, and applies changes of plans and of
/// geometry. Observers receive no notices about nodes that insertions and deletions change.
///
/// Primitives can be inserted and removed at any time. The edit of the topology is local. Afterwards the
/// certificates of new nodes are made, and, for each side, the one certificate whose search covers the edited
/// place is recomputed. Further up, a certificate is recomputed if a realiser among its candidates has
/// changed.
template <class S, class Queue, class Observer = NoObserver>
class KineticBoxTree : public BoxTreeCertificates<S, Queue, Observer> {
  using Base = BoxTreeCertificates<S, Queue, Observer>;

 protected:
  using Base::body_, Base::bounds_, Base::clock_, Base::count_, Base::editor_, Base::leaves_,
      Base::own_sides_, Base::place, Base::queue_, Base::search_, Base::sides_of, Base::slots_,
      Base::topology_, Base::version_;
  using typename Base::Now;

 public:
  /// Throws std::invalid_argument if the topology is not binary.
  KineticBoxTree(Topology topology, const Primitives& primitives, std::uint32_t body,
                 std::uint32_t first_slot, typename Queue::ClockType& clock, Queue& queue, Counters& count,
                 Observer observer = {})
      : Base(std::move(topology), primitives, body, first_slot, clock, queue, count, observer) {}

  /// Sets the options of construction, which take effect at the next `initialise`.
  void construct_as(const BoxTreeConstruction& construction) { construction_ = construction; }

  using Base::box_of, Base::realiser, Base::slot, Base::slot_count;

  /// Chooses the planes, finds every realiser at t, and schedules every certificate. O(nodes log nodes +
  /// vertices of leaves) per evaluated moment.
  void initialise(double t) {
    if (topology_.empty()) return;
    if (!original_.empty()) {
      topology_ = original_;
      place_leaves();
    }
    const FlightPlans<S>& plans = clock_->plans(body_);
    const std::size_t moments = construction_.planes == PlaneChoice::clip ? construction_.moments : 1;
    const ClipMoments<S> clip(plans, t, std::min(moments, ClipMoments<S>::most_of(topology_.size())));
    const std::vector<std::uint32_t> all = choose_planes(0, clip, nullptr);
    this->forget_lists();
    if (construction_.candidates == Candidates::listed) this->list_candidates(all);
    const auto now = Now::at(t);
    for (std::size_t i = all.size(); i-- > 0;) this->start(all[i], now);
  }

  /// Applies changes of the plans of `vertices` (ascending, unique) at t; each new plan begins at the stored
  /// position. Rechecks every certificate that has one of these vertices, or a realiser that changes in
  /// consequence, as a candidate or as its winner.
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

  /// Inserts a primitive, which the body contains already, at t: at the leaf whose boxes from the root down
  /// grow least. Computes at most two certificates of new nodes, one certificate above for each side, and
  /// further ones where realisers change; `search_cost` counts the cost of their searches. The first edit
  /// needs O(nodes) in addition. If a leaf becomes deeper than 2 log2(leaves), a subtree is rebalanced,
  /// amortised O(log) leaves per insertion.
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
    if (leaf == old_leaf) {  // the leaf had room
      unique_.insert(unique_.end(), leaves_[before].begin(), leaves_[before].end());
      leaves_.drop(before);  // its entries in the topology's primitives may have moved
    }
    set_leaf_vertices(leaf, vertex_count);
    if (leaf != old_leaf && old_leaf != TopologyEditor::none) {
      motion.fetch(body_, leaves_[before]);
      choose_planes(old_leaf, ClipMoments<S>(motion.positions(body_)), &top_box);
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
      choose_planes(top, ClipMoments<S>(motion.positions(body_)), &top_box);
      repair_edit(t);
    }
  }

  /// Removes a primitive at t. The certificates above are recomputed as after an insertion.
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

  /// Rebuilds the tree below a node from the positions at the motion's time, to which the tree must have been
  /// advanced. Leaves keep their content. Chooses new inner nodes and planes; recomputes the certificates of
  /// these nodes, and of the at most six bounds above whose searches cover them. Nodes below get new ids;
  /// their number does not change. Observers receive no notices. `box` is the box of `top`. O(leaves below),
  /// plus searches.
  void rebuild_below(std::uint32_t top, const Box<S>& box, const SampledMotion<S>& motion,
                     BuildMethod method) {
    if (topology_.nodes[top].is_leaf()) return;
    if (original_.empty() && !editor_) original_ = topology_;
    this->forget_lists();
    regrow(top, motion, method);
    const std::vector<std::uint32_t> ids = choose_planes(top, ClipMoments<S>(motion.positions(body_)), &box);
    const auto now = Now::at(motion.time());
    for (std::size_t i = ids.size(); i-- > 1;) this->start(ids[i], now);
    std::uint32_t open = Base::all_sides;
    for (std::uint32_t node = top; open != 0; node = topology_.parents[node]) {
      const std::uint32_t here = open & sides_of(node);
      open &= ~here;
      for (std::uint32_t sides = here; sides != 0; sides &= sides - 1) {
        const Side side = Side(std::countr_zero(sides));
        this->certify(place(node, side), side, now);
      }
    }
  }

  std::size_t bytes() const {
    return this->stored_bytes() + this->certificate_bytes() + original_.bytes() + concerned_.size();
  }

 private:
  static constexpr std::uint32_t marked_only =
      0x40;  ///< a bit above those of all sides: the node is on a marked path

  // ---- Planes and rebuilding

  /// Chooses the own sides of all nodes below `top`. The box of `top` is `box`; if null, its tight box.
  /// Returns `top` and all nodes below it, parents before children.
  std::vector<std::uint32_t> choose_planes(std::uint32_t top, const ClipMoments<S>& clip, const Box<S>* box) {
    std::vector<std::uint32_t> ids = subtree_of(topology_, top);
    const auto leaf_box = [&](TopologyNode leaf, std::size_t moment) {
      return leaves_.box(leaf, clip.positions(moment));
    };
    const std::vector<std::uint8_t> own_sides =
        construction_.planes == PlaneChoice::start
            ? choose_own_sides<S>(
                  topology_, ids, [&](TopologyNode leaf) { return leaf_box(leaf, 0); }, box,
                  [&](std::uint32_t node) {
                    return node == 0 ? construction_.root_axis : construction_.inner_axis;
                  })
            : ExpectedOverlap<S>(topology_, ids, clip.count(), leaf_box, box)
                  .choose(construction_.bare_leaves);
    for (std::size_t i = 1; i < ids.size(); ++i) own_sides_[ids[i]] = own_sides[i];
    ++version_;
    return ids;
  }

  /// Replaces the inner nodes below `top`.
  void regrow(std::uint32_t top, const SampledMotion<S>& motion, BuildMethod method) {
    std::vector<std::uint32_t> ids = subtree_of(topology_, top);
    std::vector<Box<S>> boxes;
    std::sort(ids.begin() + 1, ids.end());
    for (const std::uint32_t id : ids) {
      if (id != top) this->certifier_.withdraw(slot(id, own_sides_[id]));
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
  void concern(std::uint32_t node, Side side) { concerned_[node] |= std::uint8_t(1U << side); }

  /// Marks the path from a leaf with changed vertices to the root. On this path marks, for each side, the
  /// certificate that has the leaf's vertices as candidates, and all certificates whose realiser `changed`.
  template <class Changed>
  void mark_certificates_of(std::uint32_t leaf, Changed&& changed) {
    std::uint32_t open = Base::all_sides;
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

  /// Rechecks every marked certificate on the marked paths, from the leaves up. `changed(realiser)` returns
  /// whether a realiser has a new plan.
  template <class Changed>
  void repair(double t, Changed&& changed) {
    const auto now = Now::at(t);
    affected_.clear();
    if (!topology_.empty() && concerned_[0] != 0) affected_.push_back(0);
    for (std::size_t i = 0; i < affected_.size(); ++i) {
      const TopologyNode n = topology_.nodes[affected_[i]];
      if (n.is_leaf()) continue;
      for (std::uint32_t child = n.first(); child < n.first() + 2; ++child)
        if (concerned_[child] != 0) affected_.push_back(child);
    }
    // The nodes are in breadth-first order from the root; the reverse order is bottom-up. Certificates that
    // are marked during this pass lie further up, on a marked path.
    for (std::size_t i = affected_.size(); i-- > 0;) {
      const std::uint32_t node = affected_[i];
      std::uint32_t sides = concerned_[node];
      concerned_[node] = 0;
      for (; sides != marked_only; sides &= sides - 1) {
        const Side side = Side(std::countr_zero(sides));
        const std::uint32_t at = place(node, side);
        count_->add(Counter::nodes_visited);
        const std::uint32_t old = bounds_[at].realiser, best = this->best_at(at, side, t, old);
        if (best != old) this->replace(at, side, best, now);
        this->certify(at, side, now);
        if (node != 0 && (best != old || changed(old))) concern(this->node_at(this->above(at, side)), side);
      }
    }
  }

  void start_editing(const Primitives& primitives) {
    this->forget_lists();
    ++version_;
    if (editor_) return;
    editor_.emplace(topology_, primitives.count());
    original_ = {};  // from now on `initialise` starts with the edited topology
  }
  /// Updates all data stored by node after an edit.
  void follow_edit() {
    for (const std::uint32_t node : edit_.vacated)
      for (Side side = 0; side < 6; ++side) {
        if (node != 0 && side != own_sides_[node]) continue;
        this->certifier_.withdraw(slot(node, side));
        clock_->remember(slot(node, side), {});
        bounds_[place(node, side)].realiser = no_vertex;
      }
    const std::uint32_t nodes = topology_.size(), places = std::uint32_t(slot_count(topology_));
    slots_.grow(places, *queue_);
    if (bounds_.size() < places) bounds_.resize(places, {no_vertex});
    if (own_sides_.size() < nodes)
      own_sides_.resize(nodes, construction_.bare_leaves == 0 ? std::uint8_t(0) : no_side);
    for (const TopologyEdit::Move& move : edit_.moved) leaves_.placed(topology_.nodes[move.to], move.to);
  }
  /// Makes `unique_`, in any order and with repetitions, the vertex list of a leaf.
  void set_leaf_vertices(std::uint32_t leaf, std::uint32_t vertex_count) {
    std::sort(unique_.begin(), unique_.end());
    unique_.erase(std::unique(unique_.begin(), unique_.end()), unique_.end());
    leaves_.assign(topology_.nodes[leaf], leaf, unique_, vertex_count);
  }
  /// Computes, after an edit, the certificates of new nodes and all certificates whose searches cover changed
  /// nodes.
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

  BoxTreeConstruction construction_;
  Topology original_;  ///< topology with which `initialise` starts; empty until the first rebuild
  // For changes, allocated at the first one.
  std::vector<std::uint32_t> affected_;
  std::vector<std::uint8_t> concerned_;  ///< [node]: sides whose certificate must be rechecked, one bit each
  // For changes of geometry.
  TopologyEdit edit_;
  std::vector<std::uint32_t> unique_;
};

/// The kinetic BoxTrees of all bodies of a scene on one event queue.
template <class S, class Queue, class Observer = NoObserver>
using KineticBoxForest = KineticForest<S, Queue, Observer, KineticBoxTree>;

}  // namespace kbvh
