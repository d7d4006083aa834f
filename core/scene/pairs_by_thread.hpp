#pragma once
#include <atomic>
#include <cstdint>
#include <deque>
#include <mutex>
#include <utility>

#include "core/scene/pairs.hpp"

namespace kbvh {

/// The pairs of a query whose library calls back from its own threads. The caller's thread appends to the
/// answer, every other thread to its own list; a thread takes a lock only on its first call.
class PairsByThread {
 public:
  /// The results of one thread: `pairs` is the answer or `own`; box tests since the last `collect`.
  struct alignas(cache_line) Found {
    PairBuffer* pairs = nullptr;
    std::uint64_t box_tests = 0;
    PairBuffer own;
  };

  /// Starts a query by the calling thread. No thread of an earlier query may still be working.
  void start(PairBuffer& out) {
    static std::atomic<std::uint64_t> calls{0};
    call_ = ++calls;
    threads_ = 0;
    for (Found& found : found_) {  // a query that threw has left pairs behind
      found.own.clear();
      found.box_tests = 0;
    }
    mine().pairs = &out;
  }
  /// Returns the list of the calling thread.
  Found& mine() {
    static thread_local struct {
      std::uint64_t call;
      Found* found;
    } known{0, nullptr};
    if (known.call != call_) {
      const std::lock_guard<std::mutex> lock(mutex_);
      if (threads_ == found_.size()) found_.emplace_back();
      known = {call_, &found_[threads_++]};
      known.found->pairs = &known.found->own;
    }
    return *known.found;
  }
  /// Moves the pairs that other threads have found since the last call to the end of the answer, and returns
  /// the box tests that all have counted since. For the thread that started the query; no other may be
  /// working.
  std::uint64_t collect() {
    PairBuffer& out = *found_[0].pairs;
    std::uint64_t tests = 0;
    for (Found& found : found_) {
      out.insert(out.end(), found.own.begin(), found.own.end());
      found.own.clear();
      tests += std::exchange(found.box_tests, 0);
    }
    return tests;
  }
  /// Returns the memory of the lists in bytes, without the answer.
  std::size_t bytes() const {
    std::size_t total = found_.size() * sizeof(Found);
    for (const Found& found : found_) total += found.own.capacity() * sizeof(PrimitivePair);
    return total;
  }

 private:
  std::uint64_t call_ = 0;  ///< a unique number for each query of any object
  std::size_t threads_ = 0;
  std::mutex mutex_;
  std::deque<Found> found_;
};

}  // namespace kbvh
