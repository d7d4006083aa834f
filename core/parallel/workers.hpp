#pragma once
#include <cstddef>
#include <cstdint>
#include <memory>
#include <type_traits>

#include "core/base/params.hpp"

namespace kbvh {

/// The size of a cache line. Data that different threads write lies on different lines.
inline constexpr std::size_t cache_line = 64;

/// A number that one thread counts, on a cache line of its own.
struct alignas(cache_line) OwnCount {
  std::uint64_t value = 0;
};

/// The threads that share the work of one object: the caller's, and those of TBB's pool, which all objects of
/// the process share. Without TBB, or with one thread, the caller does all work itself.
///
/// Results must not depend on which thread did what. Callers cut their work into numbered items, each item
/// writes to its own place, and the places are read in the order of the items. The answer is then the same as
/// with one thread, to the last bit and in the same order.
class Workers {
 public:
  /// Throws std::invalid_argument for 0 threads, and for more than `most_threads()`.
  explicit Workers(std::uint32_t threads = 1);
  Workers(Workers&&) noexcept;
  Workers& operator=(Workers&&) noexcept;
  ~Workers();

  std::uint32_t threads() const { return threads_; }
  bool several() const { return threads_ > 1; }

  /// Calls work(item, runner) once for each item in [0, count), and returns when all calls have returned.
  /// `runner`, in [0, threads()), differs between calls that run at the same time: it selects memory for
  /// temporary use. Each runner has an equal range of consecutive items, the same in every call with the same
  /// count, and takes them in ascending order; the data that it wrote in the last call is then in its cache.
  /// A runner that has finished its own items takes the last ones of others. There should be several times
  /// more items than threads, each of at least some microseconds; there are fewer than 2^32. Data written by
  /// one call may be read after the return. The first exception of a call is passed on after the others have
  /// returned; items not yet started are then left out. Allocates nothing itself (TBB keeps a pool of small
  /// blocks).
  template <class Work>
  void for_each(std::size_t count, Work&& work) {
    if (!several() || count < 2) {
      for (std::size_t item = 0; item < count; ++item) work(item, std::uint32_t(0));
      return;
    }
    using Plain = std::remove_reference_t<Work>;
    run(
        count,
        [](const void* context, std::size_t item, std::uint32_t runner) {
          (*static_cast<Plain*>(const_cast<void*>(context)))(item, runner);
        },
        std::addressof(work));
  }

 private:
  using Call = void (*)(const void* context, std::size_t item, std::uint32_t runner);
  void run(std::size_t count, Call call, const void* context);

  std::uint32_t threads_;
  class Jobs;
  struct LeaveJobs {
    void operator()(Jobs* jobs) const;
  };
  std::unique_ptr<Jobs, LeaveJobs> jobs_;
};

/// Returns the largest number of threads that can run at a time: those of this machine that the process may
/// use, or 1 without TBB.
std::uint32_t most_threads();

/// Returns the parameter that sets a strategy's number of threads. More than `most_threads()` are refused,
/// because a result would name threads that were not used. `what` names the work that the threads share.
Parameter threads_parameter(const std::string& what);
/// Returns the value of that parameter; 1 if the strategy has none.
std::uint32_t threads_of(const Params& params);

/// Cuts [0, count) into parts of `size`, the last of which may be shorter.
struct Parts {
  std::size_t count, size;
  std::size_t parts() const { return (count + size - 1) / size; }
  std::size_t begin(std::size_t part) const { return part * size; }
  std::size_t end(std::size_t part) const { return part + 1 < parts() ? begin(part + 1) : count; }
};

}  // namespace kbvh
