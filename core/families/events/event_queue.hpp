#pragma once
#include <boost/intrusive/avl_set.hpp>
#include <cstdint>
#include <limits>
#include <memory>
#include <string_view>
#include <vector>

#include "core/base/counters.hpp"
#include "core/families/events/event.hpp"
#include "core/families/events/segment_queue.hpp"

namespace kbvh {

/// An event queue holds at most one event per certificate slot. Several structures may share it. Its
/// interface:
///   schedule(event)   inserts the event, or replaces the event of the same slot
///   cancel(slot)      removes the slot's event; returns whether there was one
///   scheduled(slot), event(slot)  whether the slot has an event, and that event
///   top(), pop(), empty(), size(), clear(), bytes()
///   grow(slots)       makes room for slots below this number, amortised O(1) each; events stay scheduled
///   slots()           number of slots that fit
///   ClockType         the clock: EventClock, except in contestants that round times
///   look_ahead()      0, or the number of keyframes of one search for a failure. If not 0, there is
///                     review(event, time), for certificates that are known to hold until that time
/// Optional:
///   due(t)            whether the earliest event, if there is one, happens at or before t
///   split_at(times)   suggests times at which to divide the events
///   choose(name)      chooses the kind of queue, before the first event (AnyEventQueue)
/// `steps()` counts comparisons. Events and their order come from a clock: Clock::Event has a `slot`, and
/// clock.earlier(a, b) orders by exact time first (EventClock, OverlapClock).

/// The paper's queue: an AVL tree (Z&W s.3), on Boost.Intrusive; all operations O(log events).
template <class Clock>
class AvlEventQueue {
  using Event = typename Clock::Event;
  struct Node : boost::intrusive::avl_set_base_hook<> {
    Event event;
    bool scheduled = false;
  };
  struct Less {
    const Clock* clock;
    std::uint64_t* steps;
    bool operator()(const Node& a, const Node& b) const {
      ++*steps;
      return clock->earlier(a.event, b.event);
    }
  };
  using Tree = boost::intrusive::avl_set<Node, boost::intrusive::compare<Less>>;

 public:
  using ClockType = Clock;
  static constexpr const char* name = "avl";
  static constexpr std::size_t look_ahead() { return 0; }
  AvlEventQueue(const Clock& clock, std::uint32_t slots)
      : steps_(std::make_unique<std::uint64_t>(0)), nodes_(slots), tree_(Less{&clock, steps_.get()}) {}
  ~AvlEventQueue() { tree_.clear(); }

  void schedule(const Event& event) {
    Node& node = nodes_[event.slot];
    if (node.scheduled) tree_.erase(tree_.iterator_to(node));
    node.event = event;
    node.scheduled = true;
    tree_.insert(node);
  }
  bool cancel(std::uint32_t slot) {
    Node& node = nodes_[slot];
    if (!node.scheduled) return false;
    tree_.erase(tree_.iterator_to(node));
    node.scheduled = false;
    return true;
  }
  bool scheduled(std::uint32_t slot) const { return nodes_[slot].scheduled; }
  const Event& event(std::uint32_t slot) const { return nodes_[slot].event; }
  const Event& top() const { return tree_.begin()->event; }
  void pop() { cancel(top().slot); }
  bool empty() const { return tree_.empty(); }
  std::size_t size() const { return tree_.size(); }
  void clear() {
    tree_.clear();
    for (Node& node : nodes_) node.scheduled = false;
  }
  std::uint32_t slots() const { return std::uint32_t(nodes_.size()); }
  void grow(std::uint32_t slots) {
    if (slots <= nodes_.capacity()) {
      if (slots > nodes_.size()) nodes_.resize(slots);
      return;
    }
    // The tree is threaded through the nodes: each new node replaces its old one, without comparisons.
    std::vector<Node> larger;
    larger.reserve(std::size_t(2) * slots);
    larger.resize(slots);
    for (std::size_t slot = 0; slot < nodes_.size(); ++slot) {
      if (!nodes_[slot].scheduled) continue;
      larger[slot].event = nodes_[slot].event;
      larger[slot].scheduled = true;
      tree_.replace_node(tree_.iterator_to(nodes_[slot]), larger[slot]);
    }
    nodes_.swap(larger);
  }
  std::uint64_t steps() const { return *steps_; }
  std::size_t bytes() const { return nodes_.capacity() * sizeof(Node); }

 private:
  std::unique_ptr<std::uint64_t> steps_;
  std::vector<Node> nodes_;
  Tree tree_;
};

/// An indexed binary heap: the standard array queue. All operations are O(log events).
template <class Clock>
class BinaryHeapEventQueue {
  using Event = typename Clock::Event;

 public:
  using ClockType = Clock;
  static constexpr const char* name = "binary_heap";
  static constexpr std::size_t look_ahead() { return 0; }
  BinaryHeapEventQueue(const Clock& clock, std::uint32_t slots)
      : clock_(&clock), events_(slots), place_(slots, none) {
    heap_.reserve(slots);
  }

  void schedule(const Event& event) {
    const std::uint32_t slot = event.slot;
    events_[slot] = event;
    if (place_[slot] == none) {
      place_[slot] = std::uint32_t(heap_.size());
      heap_.push_back(slot);
      sift_up(place_[slot]);
    } else {
      sift_down(sift_up(place_[slot]));
    }
  }
  bool cancel(std::uint32_t slot) {
    const std::uint32_t at = place_[slot];
    if (at == none) return false;
    place_[slot] = none;
    const std::uint32_t last = heap_.back();
    heap_.pop_back();
    if (last != slot) {
      heap_[at] = last;
      place_[last] = at;
      sift_down(sift_up(at));
    }
    return true;
  }
  bool scheduled(std::uint32_t slot) const { return place_[slot] != none; }
  const Event& event(std::uint32_t slot) const { return events_[slot]; }
  const Event& top() const { return events_[heap_.front()]; }
  void pop() { cancel(heap_.front()); }
  bool empty() const { return heap_.empty(); }
  std::size_t size() const { return heap_.size(); }
  void clear() {
    heap_.clear();
    std::fill(place_.begin(), place_.end(), none);
  }
  std::uint32_t slots() const { return std::uint32_t(events_.size()); }
  void grow(std::uint32_t slots) {
    if (slots <= events_.size()) return;
    events_.resize(slots);
    place_.resize(slots, none);
  }
  std::uint64_t steps() const { return steps_; }
  std::size_t bytes() const {
    return events_.capacity() * sizeof(Event) +
           (place_.capacity() + heap_.capacity()) * sizeof(std::uint32_t);
  }

 private:
  static constexpr std::uint32_t none = std::numeric_limits<std::uint32_t>::max();
  bool earlier(std::uint32_t a, std::uint32_t b) {
    ++steps_;
    return clock_->earlier(events_[a], events_[b]);
  }
  std::uint32_t sift_up(std::uint32_t at) {
    const std::uint32_t slot = heap_[at];
    while (at > 0) {
      const std::uint32_t parent = (at - 1) / 2;
      if (!earlier(slot, heap_[parent])) break;
      heap_[at] = heap_[parent];
      place_[heap_[at]] = at;
      at = parent;
    }
    heap_[at] = slot;
    place_[slot] = at;
    return at;
  }
  void sift_down(std::uint32_t at) {
    const std::uint32_t slot = heap_[at];
    for (;;) {
      std::size_t child = 2 * std::size_t(at) + 1;
      if (child >= heap_.size()) break;
      if (child + 1 < heap_.size() && earlier(heap_[child + 1], heap_[child])) ++child;
      if (!earlier(heap_[child], slot)) break;
      heap_[at] = heap_[child];
      place_[heap_[at]] = at;
      at = std::uint32_t(child);
    }
    heap_[at] = slot;
    place_[slot] = at;
  }

  const Clock* clock_;
  std::vector<Event> events_;         ///< [slot]
  std::vector<std::uint32_t> place_;  ///< [slot] index in the heap, or none
  std::vector<std::uint32_t> heap_;
  std::uint64_t steps_ = 0;
};

/// Returns whether a queue stores waiting events by segments. `kind` names its kind, where it offers a
/// choice.
template <class Queue>
bool stores_by_segments(std::string_view kind) {
  if constexpr (requires { Queue::by_segments(kind); })
    return Queue::by_segments(kind);
  else
    return Queue::look_ahead() > 0;
}

/// The event queues of kinetic trees.
template <class S>
using AvlQueue = AvlEventQueue<EventClock<S>>;
template <class S>
using BinaryHeapQueue = BinaryHeapEventQueue<EventClock<S>>;
template <class S>
using SegmentHeapQueue = SegmentHeapEventQueue<EventClock<S>>;

}  // namespace kbvh
