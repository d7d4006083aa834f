#pragma once
#include <cstdint>
#include <memory>
#include <type_traits>

#include "core/parallel/workers.hpp"

namespace kbvh {

class Pool;

/// The threads of a library that uses TBB itself. Such a library may only be able to set the number of
/// threads for the whole process (Embree 3); here it applies only to the calls made within.
class LibraryThreads {
 public:
  /// Throws std::invalid_argument like Workers.
  explicit LibraryThreads(std::uint32_t threads);
  ~LibraryThreads();

  /// Returns whether the number can be enforced: kbvh was built with TBB. Otherwise pass it to the library.
  static bool are_limited();
  /// Calls work() on the caller's thread; TBB's loops inside it use these threads.
  template <class Work>
  void call(Work&& work) {
    using Plain = std::remove_reference_t<Work>;
    within([](void* context) { (*static_cast<Plain*>(context))(); }, std::addressof(work));
  }

 private:
  void within(void (*work)(void* context), void* context);
  std::unique_ptr<Pool> pool_;
};

}  // namespace kbvh
