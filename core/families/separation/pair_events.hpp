#pragma once
#include <algorithm>
#include <vector>

#include "core/contract/event_source.hpp"
#include "core/families/separation/overlap_clock.hpp"
#include "core/families/separation/pair_tree.hpp"

namespace kbvh {

/// Describes an event of a pair in the contract's terms.
template <class S>
ScheduledEvent<S> described(const PairTree& tree, const OverlapEvent<S>& event) {
  const BoxPair& pair = tree[event.slot];
  ScheduledEvent<S> out;
  out.kind = event.review       ? EventKind::review
             : pair.overlapping ? EventKind::boxes_separate
                                : EventKind::boxes_meet;
  out.body = tree.body_of(pair, 0);
  out.node = pair.a;
  out.other_body = tree.body_of(pair, 1);
  out.other_node = pair.b;
  out.time = {event.hint, event.error};
  out.has_crossing = !event.review;
  if (out.has_crossing) out.crossing = event.crossing;
  return out;
}

/// Appends the descriptions of all events of a queue, earliest first.
template <class S, class Queue>
void append_events(const Queue& queue, const OverlapClock<S>& clock, const PairTree& tree,
                   std::vector<ScheduledEvent<S>>& out) {
  std::vector<OverlapEvent<S>> events;
  for (std::uint32_t slot = 0; slot < queue.slots(); ++slot)
    if (queue.scheduled(slot)) events.push_back(queue.event(slot));
  std::sort(events.begin(), events.end(), [&](const auto& a, const auto& b) { return clock.earlier(a, b); });
  for (const auto& event : events) out.push_back(described(tree, event));
}

}  // namespace kbvh
