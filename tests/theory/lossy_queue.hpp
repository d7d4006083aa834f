#pragma once
#include "core/families/events/event_queue.hpp"

namespace kbvh::test {

/// Loses one event in fifty.
template <class S>
class LossyQueue : public BinaryHeapQueue<S> {
 public:
  using BinaryHeapQueue<S>::BinaryHeapQueue;
  void schedule(const Event& event) {
    if (++scheduled_ % 50 != 0) BinaryHeapQueue<S>::schedule(event);
  }

 private:
  std::uint64_t scheduled_ = 0;
};

}  // namespace kbvh::test
