#pragma once
#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "core/base/assert.hpp"
#include "core/base/counters.hpp"
#include "core/families/boxtree/boxtree_bounds.hpp"
#include "core/families/boxtree/boxtree_search.hpp"
#include "core/families/events/certifier.hpp"
#include "core/families/events/kinetic_forest.hpp"
#include "core/families/events/observer.hpp"

namespace kbvh {

/// The certificates of a BoxTree and their events (Z&W s.6, with errata). A bound's certificate says that its
/// realiser is extremal below its node. The search for its earliest failure goes down depth first: at a child
/// with the same own side the stored realiser answers for all below it; other children, also those split on
/// the same axis but to the other side, are descended; at a leaf every vertex is a candidate. So each stored
/// realiser is a candidate of exactly one certificate, that of the nearest ancestor with the same own side
/// (or of the root), and so is each vertex of a leaf per side: for each side, certificates are the inner
/// nodes of a tree whose leaves are the leaves' vertices. If all hold, every realiser is extremal; when one
/// is replaced, that one certificate above is concerned, and none other; and there, if its own realiser
/// stays, the search is needed only if it was the replaced vertex that would have come next.
///
/// Who takes part in a certificate changes with the topology only, so that searches can be made once and
/// listed (Candidates::listed), until the topology is edited.
///
/// Slots of the queue are first_slot + place, for the bounds that there were at the start; later ones get
/// theirs in chunks. Events are handled and observers told as by KineticAabbTree, but for own sides only.
template <class S, class Queue, class Count, class Observer, class Rules>
class BoxTreeCertificates : public BoxTreeBounds {
 public:
  BoxTreeCertificates(Topology topology, const Primitives& primitives, std::uint32_t body,
                      std::uint32_t first_slot, EventClock<S>& clock, Queue& queue, Count& count,
                      Observer observer)
      : BoxTreeBounds(std::move(topology), primitives, body, first_slot),
        clock_(&clock),
        queue_(&queue),
        count_(&count),
        observer_(observer),
        certifier_(clock, queue, count),
        search_(clock.plans(body).vertex_count()) {}

  SearchCost& search_cost() { return search_cost_; }

  /// Handles a failure that was popped from the queue: the loser takes over, here and up from certificate to
  /// certificate as long as the winner realises them. O(depth) searches, which cost up to O(nodes) each (Z&W
  /// Theorem 5: responsive in one dimension only).
  void handle(const Event& event) {
    KBVH_ASSERT(event.body == body_);
    Crossing<S> crossing;
    const Instant<S> now = certifier_.instant_of(event, reads_instants(observer_), crossing);
    std::uint32_t at = slots_.place(event.slot);
    KBVH_ASSERT(bounds_[at].realiser == event.winner);
    count_->add(Counter::certificates_failed);
    count_->event_at(topology_.depths[node_at(at)]);
    for (;;) {
      replace(at, event.side, event.loser, now);
      certify(at, event.side, now);
      if (at < 6) return;
      at = above(at, event.side);
      if (bounds_[at].realiser != event.winner) break;
    }
    exchange_candidate(at, event.side, event.winner, event.loser, now);
  }

  /// Looks again for the next failure of a certificate, which stands at t, a keyframe.
  void review(const Event& event, double t) {
    count_->add(Counter::queue_operations);
    certify(slots_.place(event.slot), event.side, Instant<S>::at(t));
  }
  /// Fetches what handling the event will read: its bound and the one above, then the list of candidates,
  /// then the keyframes of the first of these.
  void fetch_ahead(const PackedEvent& event, std::uint32_t slot_of_event, int step) const {
    if (!listed_) return;
    const Bound& bound = bounds_[slots_.place(slot_of_event)];
    if (step == 0) {
      __builtin_prefetch(&bound);
      return;
    }
    if (step == 1) {
      __builtin_prefetch(list_.data() + bound.first);
      __builtin_prefetch(&bounds_[bound.above]);
      return;
    }
    const std::uint32_t end = std::min(bound.last, bound.vertices + 6);
    for (std::uint32_t i = bound.vertices; i < end; ++i) clock_->fetch_ahead(event, list_[i]);
  }

 protected:
  /// The place whose certificate has the realiser at this one among its candidates.
  std::uint32_t above(std::uint32_t at, Side side) {
    if (listed_) return bounds_[at].above;
    std::uint32_t node = node_at(at);
    std::uint64_t visited = 0;
    do {
      node = topology_.parents[node];
      ++visited;
    } while ((sides_of(node) >> side & 1) == 0);
    count_->add(Counter::nodes_visited, visited);
    return place(node, side);
  }

  /// The candidates of a certificate; valid until the next call.
  std::span<const std::uint32_t> candidates(std::uint32_t at, Side side) {
    candidates_.clear();
    if (listed_) {
      const Bound& bound = bounds_[at];
      if (bound.first == bound.vertices) return {list_.data() + bound.first, list_.data() + bound.last};
      for (std::uint32_t i = bound.first; i < bound.vertices; ++i)
        candidates_.push_back(bounds_[list_[i]].realiser);
      candidates_.insert(candidates_.end(), list_.begin() + bound.vertices, list_.begin() + bound.last);
      return candidates_;
    }
    const std::uint64_t visited = search_.run(
        topology_, leaves_, own_sides_.data(), node_at(at), side,
        [&](std::uint32_t child) {
          const std::uint32_t vertex = realiser(child);
          if (search_.first_visit(vertex)) candidates_.push_back(vertex);
        },
        [&](std::uint32_t vertex) { candidates_.push_back(vertex); });
    count_->add(Counter::nodes_visited, visited);
    if constexpr (Count::enabled) search_cost_.add(visited);
    return candidates_;
  }
  /// Lists the candidates of all certificates, for nodes in `order`. O(nodes).
  void list_candidates(std::span<const std::uint32_t> order) {
    list_.clear();
    for (const std::uint32_t node : order)
      for (std::uint32_t sides = sides_of(node); sides != 0; sides &= sides - 1) {
        const Side side = Side(std::countr_zero(sides));
        const std::uint32_t at = place(node, side);
        Bound& bound = bounds_[at];
        bound.first = std::uint32_t(list_.size());
        candidates_.clear();
        const std::uint64_t visited = search_.run(
            topology_, leaves_, own_sides_.data(), node, side,
            [&](std::uint32_t child) {
              list_.push_back(child + 5);
              bounds_[child + 5].above = at;
            },
            [&](std::uint32_t vertex) { candidates_.push_back(vertex); });
        count_->add(Counter::nodes_visited, visited);
        if constexpr (Count::enabled) search_cost_.add(visited);
        bound.vertices = std::uint32_t(list_.size());
        list_.insert(list_.end(), candidates_.begin(), candidates_.end());
        bound.last = std::uint32_t(list_.size());
      }
    listed_ = true;
  }
  /// The topology is about to be edited: from now on candidates are searched for.
  void forget_lists() { listed_ = false; }

  /// The best candidate; of equal ones `preferred`, if it is among them, or else the first.
  std::uint32_t best_at(std::uint32_t at, Side side, double t, std::uint32_t preferred) {
    std::uint32_t best = no_vertex;
    const std::span<const std::uint32_t> all = candidates(at, side);
    for (const std::uint32_t challenger : all) {
      const int order = best == no_vertex ? 1 : clock_->compare_values(body_, side, challenger, best, t);
      if (order > 0 || (order == 0 && challenger == preferred)) best = challenger;
    }
    count_->add(Counter::vertex_reads, all.size());
    return best == no_vertex ? preferred : best;  // none: only where rules are faulty
  }

  /// Finds the realisers of a node's own sides and schedules their certificates, with those below in place.
  void start(std::uint32_t node, const Instant<S>& now) {
    std::uint32_t any = node;
    while (!topology_.nodes[any].is_leaf()) any = topology_.nodes[any].first();
    for (std::uint32_t sides = sides_of(node); sides != 0; sides &= sides - 1) {
      const Side side = Side(std::countr_zero(sides));
      const std::uint32_t at = place(node, side);
      bounds_[at].realiser = best_at(at, side, now.begin, leaves_[topology_.nodes[any]].front());
      certify(at, side, now);
    }
  }

  void replace(std::uint32_t at, Side side, std::uint32_t vertex, const Instant<S>& now) {
    const std::uint32_t old = std::exchange(bounds_[at].realiser, vertex);
    count_->add(Counter::values_written);
    observer_.template realiser_changed<S>(body_, node_at(at), side, old, vertex, now);
  }

  /// Schedules the earliest failure of a bound's certificate from now on, in place of the one that stood.
  void certify(std::uint32_t at, Side side, const Instant<S>& now) {
    certifier_.certify(event_of(at, side), now, candidates(at, side));
  }

  /// Of a certificate's candidates, `before` has been replaced by `after`, which is not ahead of the
  /// realiser. As long as it was not `before` who comes next, the others need not be looked at again.
  void exchange_candidate(std::uint32_t at, Side side, std::uint32_t before, std::uint32_t after,
                          const Instant<S>& now) {
    const std::uint32_t slot = slots_.slot(at);
    if (queue_->scheduled(slot) && queue_->event(slot).loser == before) return certify(at, side, now);
    certifier_.add_candidate(event_of(at, side), now, after);
  }

  std::size_t certificate_bytes() const {
    return search_.bytes() + (list_.capacity() + candidates_.capacity()) * sizeof(std::uint32_t);
  }

  EventClock<S>* clock_;
  Queue* queue_;
  Count* count_;
  Observer observer_;
  Certifier<S, Queue, Count> certifier_;
  CandidateSearch<Rules> search_;
  SearchCost search_cost_;

 private:
  /// Names the certificate of a bound.
  Event event_of(std::uint32_t at, Side side) const {
    Event event;
    event.winner = bounds_[at].realiser;
    event.slot = slots_.slot(at);
    event.body = body_ % Event::most_bodies;
    event.side = side & 7U;
    event.depth = topology_.depths[node_at(at)];
    return event;
  }

  std::vector<std::uint32_t> list_;        ///< of candidates, by bound
  std::vector<std::uint32_t> candidates_;  ///< of the certificate that is being made
  bool listed_ = false;
};

}  // namespace kbvh
