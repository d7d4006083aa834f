#pragma once
#include <atomic>

namespace kbvh {

/// Ends work at a user's request. Not derived from std::exception, so that a study ends instead of recording
/// that a strategy failed.
struct Interrupted {};

/// During its lifetime, long work in this thread ends by Interrupted after `stop` has become true: between
/// two frames of a session and between two rows of a brute-force search, where nothing is half finished.
class Interruptible {
 public:
  explicit Interruptible(const std::atomic<bool>& stop) : former_(current()) { current() = &stop; }
  ~Interruptible() { current() = former_; }
  Interruptible(const Interruptible&) = delete;
  Interruptible& operator=(const Interruptible&) = delete;

  /// Throws Interrupted if the work is to end.
  static void check() {
    if (const std::atomic<bool>* const stop = current();
        stop != nullptr && stop->load(std::memory_order_relaxed))
      throw Interrupted{};
  }

 private:
  static const std::atomic<bool>*& current() {
    static thread_local const std::atomic<bool>* stop = nullptr;
    return stop;
  }
  const std::atomic<bool>* former_;
};

}  // namespace kbvh
