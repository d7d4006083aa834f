#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "core/parallel/workers.hpp"

namespace kbvh {

/// Sorts keys whose upper 32 bits are codes of 30 bits by the code, stably. Keeps its memory from call to
/// call.
class RadixSort {
 public:
  static constexpr std::uint32_t digit_bits = 11, digits = 3, bins = 1U << digit_bits;

  /// Returns space for the counts of all digits, [2][digit][bin], the lowest digit first, all 0. The caller
  /// counts the digits of the codes in either half before it calls `sort`.
  std::uint32_t* counts();
  /// Sorts `keys`, whose digits are counted in `counts`: one stable pass per digit (LSD), none for a digit
  /// that all keys share. O(keys).
  void sort(std::span<std::uint64_t> keys);
  /// Sorts `keys` to the same order on the threads of `workers`, a part of the keys each; counts their digits
  /// itself. O(keys) on all threads together.
  void sort(Workers& workers, std::span<std::uint64_t> keys);

  std::size_t bytes() const {
    return (counts_.capacity() + part_counts_.capacity() + bin_places_.capacity()) * sizeof(std::uint32_t) +
           buffer_.capacity() * sizeof(std::uint64_t);
  }

 private:
  std::vector<std::uint32_t> counts_;
  // Of several threads: counts by part of the keys, and the place of a bin's first key.
  std::vector<std::uint32_t> part_counts_;  ///< [part][2][bin]
  std::vector<std::uint32_t> bin_places_;   ///< [bin]
  std::vector<std::uint64_t> buffer_;
};

}  // namespace kbvh
