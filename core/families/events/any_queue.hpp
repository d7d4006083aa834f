#pragma once
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "core/base/assert.hpp"
#include "core/base/params.hpp"
#include "core/families/events/event_queue.hpp"
#include "core/families/events/segment_queue.hpp"

namespace kbvh {

/// An event queue (event_queue.hpp) whose kind is chosen at run time among those that Queues lists.
/// Structures are compiled once for all of them. The operations of the segment heap are inlined behind one
/// predictable branch; those of the others are calls.
template <class Clock>
class AnyEventQueue {
  using Event = typename Clock::Event;
  using Segments = SegmentHeapEventQueue<Clock>;
  using Queues = std::variant<Segments, AvlEventQueue<Clock>, BinaryHeapEventQueue<Clock>>;
  using Returned = decltype(std::declval<const Segments&>().top());

 public:
  using ClockType = Clock;
  AnyEventQueue(const Clock& clock, std::uint32_t slots)
      : clock_(&clock), queue_(std::in_place_type<Segments>, clock, slots) {}

  /// Returns whether the kind of this name stores waiting events by segments.
  static bool by_segments(std::string_view name) { return name.empty() || name == Segments::name; }
  /// Chooses the kind by its name, once and before the first event. Without a choice, or with an empty name,
  /// the queue is a segment heap.
  void choose(std::string_view name) {
    KBVH_ASSERT(segments() != nullptr && empty());
    if (by_segments(name)) return;  // it may have been divided already
    const std::uint32_t wanted = slots();
    for_each(std::type_identity<Queues>{}, [&]<class Queue>(std::type_identity<Queue>) {
      if (name == Queue::name) queue_.template emplace<Queue>(*clock_, wanted);
    });
  }
  /// Returns the names of all kinds, the default first.
  static std::vector<std::string> names() {
    std::vector<std::string> all;
    for_each(std::type_identity<Queues>{},
             [&]<class Queue>(std::type_identity<Queue>) { all.emplace_back(Queue::name); });
    return all;
  }

  void schedule(const Event& event) {
    on_queue([&](auto& queue) { queue.schedule(event); });
  }
  bool cancel(std::uint32_t slot) {
    return on_queue([&](auto& queue) { return queue.cancel(slot); });
  }
  bool scheduled(std::uint32_t slot) const {
    return on_queue([&](auto& queue) { return queue.scheduled(slot); });
  }
  Returned event(std::uint32_t slot) const {
    return on_queue([&](auto& queue) -> Returned { return queue.event(slot); });
  }
  Returned top() const {
    return on_queue([](auto& queue) -> Returned { return queue.top(); });
  }
  void pop() {
    on_queue([](auto& queue) { queue.pop(); });
  }
  /// Removes and returns the earliest event.
  Event take() {
    if (Segments* queue = segments()) [[likely]]
      return queue->take();
    const Event first = top();
    pop();
    return first;
  }
  /// Returns whether the earliest event happens at or before t.
  bool due(double t) const {
    if (const Segments* queue = segments()) [[likely]]
      return queue->due(t);
    return !empty() && clock_->due(top(), t);
  }
  bool empty() const {
    return on_queue([](auto& queue) { return queue.empty(); });
  }
  std::size_t size() const {
    return on_queue([](auto& queue) { return queue.size(); });
  }
  void clear() {
    on_queue([](auto& queue) { queue.clear(); });
  }
  std::uint32_t slots() const {
    return on_queue([](auto& queue) { return queue.slots(); });
  }
  void grow(std::uint32_t slots) {
    on_queue([&](auto& queue) { queue.grow(slots); });
  }
  std::uint64_t steps() const {
    return on_queue([](auto& queue) { return queue.steps(); });
  }
  std::size_t bytes() const {
    return on_queue([](auto& queue) { return queue.bytes(); });
  }

  // Of the segment heap; the other kinds ignore them.

  std::size_t look_ahead() const { return segments() != nullptr ? Segments::look_ahead() : 0; }
  void split_at(std::span<const double> times) {
    if (Segments* queue = segments()) queue->split_at(times);
  }
  template <class Owner>
  void serve(Owner& owner) {
    if (Segments* queue = segments()) queue->serve(owner);
  }
  bool review(const Event& event, double time) {
    Segments* queue = segments();
    return queue != nullptr && queue->review(event, time);
  }
  bool reviewing(std::uint32_t slot) const {
    const Segments* queue = segments();
    return queue != nullptr && queue->reviewing(slot);
  }
  void prefetch(std::uint32_t slot) const {
    if (const Segments* queue = segments()) queue->prefetch(slot);
  }

 private:
  Segments* segments() { return std::get_if<Segments>(&queue_); }
  const Segments* segments() const { return std::get_if<Segments>(&queue_); }
  template <class Work>
  decltype(auto) on_queue(const Work& work) {
    if (Segments* queue = segments()) [[likely]]
      return work(*queue);
    return on_other(queue_, work);
  }
  template <class Work>
  decltype(auto) on_queue(const Work& work) const {
    if (const Segments* queue = segments()) [[likely]]
      return work(*queue);
    return on_other(queue_, work);
  }
  template <class Held, class Work>
  [[gnu::noinline]] static decltype(auto) on_other(Held& queues, const Work& work) {
    return std::visit(work, queues);
  }
  template <class Work, class... Kinds>
  static void for_each(std::type_identity<std::variant<Kinds...>>, const Work& work) {
    (work(std::type_identity<Kinds>{}), ...);
  }

  const Clock* clock_;
  Queues queue_;
};

/// The event queue of kinetic trees whose kind is chosen at run time.
template <class S>
using AnyQueue = AnyEventQueue<EventClock<S>>;

/// Returns the parameter `queue` of a kinetic strategy: the name of its event queue's kind.
Parameter queue_parameter();

}  // namespace kbvh
