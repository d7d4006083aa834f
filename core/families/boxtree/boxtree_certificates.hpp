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

/// The certificates of a BoxTree and their events (Z&W s.6, with errata). A bound's certificate states that
/// its realiser is extremal below its node. The search for the certificate's earliest failure is depth first.
/// At a child with the same own side, the stored realiser stands for all vertices below the child. The search
/// descends to all other children, including those split on the same axis that own the opposite side. At a
/// leaf every vertex is a candidate. Each stored realiser is therefore a candidate of exactly one
/// certificate, that of the nearest ancestor with the same own side (or of the root), and each vertex of a
/// leaf is a candidate of exactly one certificate per side. For each side, the certificates are the inner
/// nodes of a tree whose leaves are the leaves' vertices. If all certificates hold, every realiser is
/// extremal. Replacing a realiser affects only the one certificate above. If that certificate keeps its own
/// realiser, it needs a new search only if the replaced vertex was its next loser.
///
/// The candidates of a certificate change only with the topology. Searches can therefore be made once and
/// listed (Candidates::listed), until the topology is edited.
///
/// Slots of the queue are first_slot + place for the initial bounds; later bounds get slots in chunks. Events
/// are handled as by KineticAabbTree. Observers receive realiser_changed for own sides only, and no
/// realiser_plan_changed.
template <class S, class Queue, class Observer>
class BoxTreeCertificates : public BoxTreeBounds {
 protected:
  using Clock = typename Queue::ClockType;
  using Now = typename InstantOf<Clock, S>::type;

 public:
  BoxTreeCertificates(Topology topology, const Primitives& primitives, std::uint32_t body,
                      std::uint32_t first_slot, Clock& clock, Queue& queue, Counters& count,
                      Observer observer)
      : BoxTreeBounds(std::move(topology), primitives, body, first_slot),
        clock_(&clock),
        queue_(&queue),
        count_(&count),
        observer_(observer),
        certifier_(clock, queue, count),
        search_(clock.plans(body).vertex_count()) {}

  /// Returns the cost of all searches.
  SearchCost& search_cost() { return search_cost_; }
  const SearchCost& search_cost() const { return search_cost_; }

  /// Handles a failure that was popped from the queue. The loser becomes the realiser of this bound, and of
  /// the bounds of the certificates above while the winner realises them. O(depth) searches of up to O(nodes)
  /// each (Z&W Theorem 5: responsive in one dimension only).
  void handle(const Event& event) {
    KBVH_ASSERT(event.body == body_);
    typename Now::Exact crossing;
    const Now now = certifier_.instant_of(event, reads_instants(observer_), crossing);
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

  /// Searches the next failure of a certificate that holds at t, a keyframe time.
  void review(const Event& event, double t) {
    count_->add(Counter::queue_operations);
    certify(slots_.place(event.slot), event.side, Now::at(t));
  }
  /// Prefetches the data that the event will read: in step 0 its bound, in step 1 the bound above and the
  /// list of candidates, in step 2 the keyframes of the first candidates.
  template <class StoredEvent>
  void fetch_ahead(const StoredEvent& event, std::uint32_t slot_of_event, int step) const {
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
  /// Returns the place whose certificate has the realiser at `at` as a candidate.
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

  /// Returns the candidates of a certificate; valid until the next call.
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
    search_cost_.add(visited);
    return candidates_;
  }
  /// Lists the candidates of all certificates, for the nodes in `order`. O(nodes).
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
        search_cost_.add(visited);
        bound.vertices = std::uint32_t(list_.size());
        list_.insert(list_.end(), candidates_.begin(), candidates_.end());
        bound.last = std::uint32_t(list_.size());
      }
    listed_ = true;
  }
  /// Discards the lists before an edit of the topology. From now on candidates are searched.
  void forget_lists() { listed_ = false; }

  /// Returns the best candidate at t. Of equal candidates returns `preferred` if it is one of them, otherwise
  /// the first.
  std::uint32_t best_at(std::uint32_t at, Side side, double t, std::uint32_t preferred) {
    std::uint32_t best = no_vertex;
    const std::span<const std::uint32_t> all = candidates(at, side);
    for (const std::uint32_t challenger : all) {
      const int order = best == no_vertex ? 1 : clock_->compare_values(body_, side, challenger, best, t);
      if (order > 0 || (order == 0 && challenger == preferred)) best = challenger;
    }
    count_->add(Counter::vertex_reads, all.size());
    KBVH_ASSERT(best != no_vertex);
    return best;
  }

  /// Finds the realisers of a node's own sides and schedules their certificates. Requires the realisers
  /// below.
  void start(std::uint32_t node, const Now& now) {
    std::uint32_t any = node;
    while (!topology_.nodes[any].is_leaf()) any = topology_.nodes[any].first();
    for (std::uint32_t sides = sides_of(node); sides != 0; sides &= sides - 1) {
      const Side side = Side(std::countr_zero(sides));
      const std::uint32_t at = place(node, side);
      bounds_[at].realiser = best_at(at, side, now.begin, leaves_[topology_.nodes[any]].front());
      certify(at, side, now);
    }
  }

  void replace(std::uint32_t at, Side side, std::uint32_t vertex, const Now& now) {
    const std::uint32_t old = std::exchange(bounds_[at].realiser, vertex);
    count_->add(Counter::values_written);
    observer_.template realiser_changed<S>(body_, node_at(at), side, old, vertex, now);
  }

  /// Schedules the earliest failure of a bound's certificate from `now` on, and replaces the scheduled one.
  void certify(std::uint32_t at, Side side, const Now& now) {
    certifier_.certify(event_of(at, side), now, candidates(at, side));
  }

  /// Updates a certificate in which `after` replaces the candidate `before`. Requires that `after` is not
  /// ahead of the realiser. The other candidates are searched again only if `before` was the next loser.
  void exchange_candidate(std::uint32_t at, Side side, std::uint32_t before, std::uint32_t after,
                          const Now& now) {
    const std::uint32_t slot = slots_.slot(at);
    if (queue_->scheduled(slot) && queue_->event(slot).loser == before) return certify(at, side, now);
    certifier_.add_candidate(event_of(at, side), now, after);
  }

  std::size_t certificate_bytes() const {
    return search_.bytes() + (list_.capacity() + candidates_.capacity()) * sizeof(std::uint32_t);
  }

  Clock* clock_;
  Queue* queue_;
  Counters* count_;
  Observer observer_;
  Certifier<S, Queue> certifier_;
  CandidateSearch search_;
  SearchCost search_cost_;

 private:
  /// Returns an event that identifies the certificate of a bound, without a time.
  Event event_of(std::uint32_t at, Side side) const {
    Event event;
    event.winner = bounds_[at].realiser;
    event.slot = slots_.slot(at);
    event.body = body_ % Event::most_bodies;
    event.side = side & 7U;
    event.depth = topology_.depths[node_at(at)];
    return event;
  }

  std::vector<std::uint32_t> list_;        ///< candidates, by bound
  std::vector<std::uint32_t> candidates_;  ///< candidates of the current certificate
  bool listed_ = false;
};

}  // namespace kbvh
