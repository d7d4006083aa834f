#include "core/parallel/workers.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <exception>
#include <stdexcept>
#include <string>
#include <thread>

#include "core/base/assert.hpp"
#include "core/parallel/library_threads.hpp"
#include "core/parallel/pool.hpp"

namespace kbvh {

namespace {
std::uint32_t checked(std::uint32_t threads) {
  if (threads == 0 || threads > most_threads())
    throw std::invalid_argument(std::to_string(threads) + " threads were asked for; there are 1 to " +
                                std::to_string(most_threads()));
  return threads;
}
}  // namespace

/// The jobs of one Workers object, one at a time, and the helpers: tasks of the pool that wait for jobs for a
/// short while. Waking a sleeping thread takes as long as a whole phase of a small scene, so helpers stay
/// awake from one phase of a frame to the next. A job never waits for a helper that has not arrived: the
/// caller works as well, and leaves only when all items are done.
class Workers::Jobs {
 public:
  explicit Jobs(std::uint32_t threads)
      : pool_(threads), helpers_(threads - 1), slots_(std::make_unique<Slot[]>(threads)) {}

  void run(std::size_t count, Call call, const void* context) {
    KBVH_ASSERT(count <= ~std::uint32_t(0));
    const std::uint32_t runners = helpers_ + 1;
    for (std::uint32_t runner = 0; runner < runners; ++runner)
      slots_[runner].left.store(
          packed(std::uint32_t(count * runner / runners), std::uint32_t(count * (runner + 1) / runners)),
          std::memory_order_relaxed);
    call_ = call;
    context_ = context;
    failure_ = nullptr;
    failed_.store(false, std::memory_order_relaxed);
    job_.fetch_add(1);  // open: odd
    wake_helpers(count);
    work(0);
    job_.fetch_add(1);  // closed: even
    // A helper may have lost its core, and may need this one.
    for (std::uint32_t spins = 0; inside_.load() != 0; ++spins)
      spins < 256 ? relax() : std::this_thread::yield();
    if (failure_) std::rethrow_exception(failure_);
  }
  /// Ends the helpers; the last of them frees the memory.
  void leave() {
    ended_.store(true);
    release();
  }

 private:
  using Clock = std::chrono::steady_clock;
  static constexpr std::chrono::microseconds patience{1000};
  /// The data of one runner: its items that have not been started, [begin, end) in one word, and whether a
  /// helper has its number.
  struct alignas(cache_line) Slot {
    std::atomic<std::uint64_t> left{0};
    std::atomic<bool> taken{false};
  };
  static std::uint64_t packed(std::uint32_t begin, std::uint32_t end) {
    return std::uint64_t(begin) << 32 | end;
  }
  static constexpr std::uint32_t no_item = ~std::uint32_t(0);
  enum class From : std::uint8_t { front, back };
  /// Takes one of a runner's items; returns `no_item` if all have been started.
  static std::uint32_t take(Slot& slot, From from) {
    std::uint64_t left = slot.left.load(std::memory_order_relaxed);
    for (;;) {
      const auto begin = std::uint32_t(left >> 32), end = std::uint32_t(left);
      if (begin >= end) return no_item;
      const bool front = from == From::front;
      if (slot.left.compare_exchange_weak(left, front ? packed(begin + 1, end) : packed(begin, end - 1),
                                          std::memory_order_relaxed))
        return front ? begin : end - 1;
    }
  }

  void wake_helpers(std::size_t count) {
    const auto wanted = std::uint32_t(std::min<std::size_t>(helpers_, count - 1));
    for (std::uint32_t awake = awake_.load(); awake < wanted; ++awake) {
      awake_.fetch_add(1);
      users_.fetch_add(1);
      try {
        pool_.start([](void* jobs) { static_cast<Jobs*>(jobs)->help(); }, this);
      } catch (...) {  // no memory for a helper: the caller works alone
        awake_.fetch_sub(1);
        users_.fetch_sub(1);
        return;
      }
    }
  }
  void help() {
    std::uint32_t slot = 0;
    while (awake_.load() == 0 || slots_[slot + 1].taken.exchange(true)) slot = (slot + 1) % helpers_;
    auto idle_since = Clock::now();
    for (std::uint64_t last = 0; !ended_.load();) {
      const std::uint64_t job = job_.load();
      if (job % 2 == 1 && job != last) {
        inside_.fetch_add(1);
        if (job_.load() == job) work(slot + 1);  // otherwise it has closed meanwhile
        inside_.fetch_sub(1);
        last = job;
        idle_since = Clock::now();
      } else if (Clock::now() - idle_since > patience) {
        break;
      } else {
        relax();  // on a busy machine, a helper that yields would lose its core for milliseconds
      }
    }
    slots_[slot + 1].taken.store(false);
    awake_.fetch_sub(1);
    release();
  }
  void work(std::uint32_t runner) {
    const std::uint32_t runners = helpers_ + 1;
    try {
      for (std::uint32_t k = 0; k < runners; ++k) {
        Slot& slot = slots_[(runner + k) % runners];
        for (std::uint32_t item; (item = take(slot, k == 0 ? From::front : From::back)) != no_item;)
          call_(context_, item, runner);
      }
    } catch (...) {
      if (!failed_.exchange(true)) failure_ = std::current_exception();
      for (std::uint32_t k = 0; k < runners; ++k) slots_[k].left.store(0);  // the others stop, too
    }
  }
  void release() {
    if (users_.fetch_sub(1) == 1) delete this;
  }
  /// Spends some hundred nanoseconds.
  static void relax() {
    for (int i = 0; i < 8; ++i) {
#if defined(__x86_64__) || defined(__i386__)
      __builtin_ia32_pause();
#endif
    }
  }

  Pool pool_;
  std::uint32_t helpers_;
  std::unique_ptr<Slot[]> slots_;  ///< [runner]; the caller's comes first
  Call call_ = nullptr;
  const void* context_ = nullptr;
  std::exception_ptr failure_;
  alignas(cache_line) std::atomic<std::uint64_t> job_{0};
  alignas(cache_line) std::atomic<std::uint32_t> inside_{0};  ///< helpers at work
  std::atomic<std::uint32_t> awake_{0}, users_{1};
  std::atomic<bool> failed_{false}, ended_{false};
};

void Workers::LeaveJobs::operator()(Jobs* jobs) const {
  jobs->leave();
}

void Workers::run(std::size_t count, Call call, const void* context) {
  jobs_->run(count, call, context);
}

Workers::Workers(std::uint32_t threads) : threads_(checked(threads)) {
  if (several()) jobs_.reset(new Jobs(threads));
}

Workers::Workers(Workers&&) noexcept = default;
Workers& Workers::operator=(Workers&&) noexcept = default;
Workers::~Workers() = default;

LibraryThreads::LibraryThreads(std::uint32_t threads) : pool_(std::make_unique<Pool>(checked(threads))) {}
LibraryThreads::~LibraryThreads() = default;

bool LibraryThreads::are_limited() {
  return Pool::exists();
}

void LibraryThreads::within(void (*work)(void* context), void* context) {
  pool_->within(work, context);
}

std::uint32_t most_threads() {
  return Pool::most_threads();
}

Parameter threads_parameter(const std::string& what) {
  return {"threads",
          "1",
          {},
          "threads that share " + what +
              ", at most those of this machine; times with more than one thread are reported separately",
          1,
          double(most_threads()),
          Numbers::whole};
}

std::uint32_t threads_of(const Params& params) {
  const auto given = params.values().find("threads");
  return given == params.values().end() ? 1 : std::uint32_t(params.number("threads"));
}

}  // namespace kbvh
