// The only file that uses TBB directly. Builds with ThreadSanitizer leave it uninstrumented (CMakeLists.txt):
// they do not see how TBB hands tasks to its threads, and would report every task. They do see what Workers
// orders by its own atomics.
#include "core/parallel/pool.hpp"

#include <algorithm>

#if defined(KBVH_WITH_TBB)
#include <tbb/global_control.h>
#include <tbb/task_arena.h>
#endif

namespace kbvh {

#if defined(KBVH_WITH_TBB)
struct Pool::Arena {
  explicit Arena(std::uint32_t threads) : arena(int(threads)) {}
  tbb::task_arena arena;
};

void Pool::start(void (*work)(void* context), void* context) {
  arena_->arena.enqueue([work, context] { work(context); });
}

void Pool::within(void (*work)(void* context), void* context) {
  arena_->arena.execute([&] { work(context); });
}

bool Pool::exists() {
  return true;
}

std::uint32_t Pool::most_threads() {
  return std::uint32_t(std::min<std::size_t>(
      1024, tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism)));
}
#else
struct Pool::Arena {
  explicit Arena(std::uint32_t /*threads*/) {}
};

void Pool::start(void (*work)(void* context), void* context) {
  work(context);
}

void Pool::within(void (*work)(void* context), void* context) {
  work(context);
}

bool Pool::exists() {
  return false;
}

std::uint32_t Pool::most_threads() {
  return 1;
}
#endif

Pool::Pool(std::uint32_t threads) : arena_(std::make_unique<Arena>(threads)) {}
Pool::~Pool() = default;

}  // namespace kbvh
