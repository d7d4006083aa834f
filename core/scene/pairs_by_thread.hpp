#pragma once
#include <atomic>
#include <cstdint>
#include <deque>
#include <mutex>
#include <utility>

#include "core/scene/pairs.hpp"

namespace kbvh {

/// The pairs of a query whose library calls back from threads of its own: each thread appends to a list of
/// its own, and takes a lock only when it comes for the first time.
class PairsByThread {
 public:
  struct alignas(cache_line) Found {
    PairBuffer pairs;
    std::uint64_t box_tests = 0;
  };

  /// Starts a query. No thread of an earlier one may be at work.
  void start() {
    static std::atomic<std::uint64_t> calls{0};
    call_ = ++calls;
    threads_ = 0;
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
    }
    return *known.found;
  }
  /// Moves the pairs found since the last call to the end of `out`, and returns the box tests counted since.
  std::uint64_t take(PairBuffer& out) {
    std::uint64_t tests = 0;
    for (Found& found : found_) {
      out.insert(out.end(), found.pairs.begin(), found.pairs.end());
      found.pairs.clear();
      tests += std::exchange(found.box_tests, 0);
    }
    return tests;
  }

 private:
  std::uint64_t call_ = 0;  ///< a number of its own for each query of any object
  std::size_t threads_ = 0;
  std::mutex mutex_;
  std::deque<Found> found_;
};

}  // namespace kbvh
