#pragma once
#include <algorithm>
#include <vector>

#include "core/contract/event_source.hpp"
#include "core/families/events/event.hpp"

namespace kbvh {

/// The logs that receive changes of bounds.
template <class S>
struct BoundWatch {
  std::vector<BoundNotice<S>>* log = nullptr;    ///< receives all changes; may be null
  std::vector<BoundNotice<S>>* event = nullptr;  ///< receives the changes of the current step; may be null
};

/// Writes changes of bounds to `touched` during its lifetime.
template <class S>
class WatchedEvent {
 public:
  WatchedEvent(BoundWatch<S>& watch, std::vector<BoundNotice<S>>& touched) : watch_(&watch) {
    touched.clear();
    watch.event = &touched;
  }
  ~WatchedEvent() { watch_->event = nullptr; }
  WatchedEvent(const WatchedEvent&) = delete;
  WatchedEvent& operator=(const WatchedEvent&) = delete;

 private:
  BoundWatch<S>* watch_;
};

/// An observer of kinetic trees (see NoObserver in observer.hpp) that writes changes of bounds to the logs of
/// `watch`.
template <class S>
struct BoundObserver {
  const BoundWatch<S>* watch = nullptr;

  bool reads_instants() const { return watch->log != nullptr || watch->event != nullptr; }
  template <class T, class Exact>
  void realiser_changed(std::uint32_t body, std::uint32_t node, Side side, std::uint32_t old_vertex,
                        std::uint32_t new_vertex, const Instant<T, Exact>& now) {
    if (!reads_instants()) return;
    const Crossing<S>* const crossing = now.exact != nullptr ? crossing_in(*now.exact) : nullptr;
    const BoundNotice<S> change{body,
                                node,
                                side,
                                old_vertex,
                                new_vertex,
                                now.begin,
                                crossing != nullptr,
                                crossing != nullptr ? *crossing : Crossing<S>{}};
    if (watch->log != nullptr) watch->log->push_back(change);
    if (watch->event != nullptr) watch->event->push_back(change);
  }
  void realiser_plan_changed(std::uint32_t /*body*/, std::uint32_t /*node*/) {}
};

/// Returns an event of a kinetic forest in the form of the contract.
template <class Forest, class S = typename Forest::Scalar>
ScheduledEvent<S> described(const Forest& forest, const Event& event) {
  ScheduledEvent<S> out;
  out.kind = EventKind::bound;
  out.body = event.body;
  out.node = forest.tree(event.body).node_of(event.slot);
  out.side = event.side;
  out.winner = event.winner;
  out.loser = event.loser;
  out.time = {event.hint, event.error};
  const auto exact = forest.clock().crossing(event);
  if (const Crossing<S>* const crossing = crossing_in(exact)) {
    out.has_crossing = true;
    out.crossing = *crossing;
  }
  return out;
}

/// Replaces `out` by all events of the forest's queue, earliest first. O(slots + events log events).
template <class Forest, class S = typename Forest::Scalar>
void list_events(const Forest& forest, std::vector<ScheduledEvent<S>>& out) {
  std::vector<Event> events;
  const auto& queue = forest.queue();
  for (std::uint32_t slot = 0; slot < queue.slots(); ++slot)
    if (queue.scheduled(slot)) events.push_back(queue.event(slot));
  std::sort(events.begin(), events.end(),
            [&](const Event& a, const Event& b) { return forest.clock().earlier(a, b); });
  out.clear();
  for (const Event& event : events) out.push_back(described(forest, event));
}

/// Appends the current certificates of the bounds that an event changed, and that of the bound above the last
/// of them, which has other candidates now. Certificates that never fail are not appended.
template <class Forest, class S = typename Forest::Scalar>
void append_rescheduled(const Forest& forest, const std::vector<BoundNotice<S>>& touched,
                        std::vector<ScheduledEvent<S>>& out) {
  const auto append = [&](std::uint32_t body, std::uint32_t node, Side side) {
    const std::uint32_t slot = forest.tree(body).slot(node, side);
    if (forest.queue().scheduled(slot)) out.push_back(described(forest, forest.queue().event(slot)));
  };
  for (const BoundNotice<S>& change : touched) append(change.body, change.node, change.side);
  if (touched.empty() || touched.back().node == 0) return;
  const BoundNotice<S>& last = touched.back();
  append(last.body, forest.tree(last.body).certificate_above(last.node, last.side), last.side);
}

/// Handles the earliest event of a forest if it is due by `until`, and describes it in `out`. Returns false,
/// and leaves `out` alone, if no event is due.
template <class Forest, class S = typename Forest::Scalar>
bool step_forest(Forest& forest, BoundWatch<S>& watch, double until, EventDescription<S>& out) {
  if (!forest.due(until)) return false;
  out.event = described(forest, forest.queue().top());
  out.rescheduled.clear();
  {
    const WatchedEvent<S> watched(watch, out.touched);
    forest.handle_next();
  }
  append_rescheduled(forest, out.touched, out.rescheduled);
  return true;
}

}  // namespace kbvh
