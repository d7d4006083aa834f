#pragma once
#include <cstdint>
#include <memory>

namespace kbvh {

/// The threads of TBB that one object uses. Internal to the room.
class Pool {
 public:
  explicit Pool(std::uint32_t threads);
  ~Pool();
  /// Calls work(context) some time later on a thread of the pool, and returns at once.
  void start(void (*work)(void* context), void* context);
  /// Calls work(context) on the caller's thread, as a part of the pool: TBB's own loops inside it use the
  /// pool.
  void within(void (*work)(void* context), void* context);
  /// Returns whether there is a pool: built with TBB.
  static bool exists();
  /// Returns the largest number of threads that can run at a time.
  static std::uint32_t most_threads();

 private:
  struct Arena;
  std::unique_ptr<Arena> arena_;
};

}  // namespace kbvh
