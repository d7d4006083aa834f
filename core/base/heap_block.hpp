#pragma once
#include <cstddef>

namespace kbvh {

/// Returns the memory that an allocation of `size` bytes takes, including the allocator's own word, in
/// multiples of 16 bytes. Correct for glibc's malloc, and approximately for others. For structures whose
/// nodes are allocated one by one.
constexpr std::size_t heap_block_bytes(std::size_t size) {
  return (size + sizeof(std::size_t) + 15) / 16 * 16;
}

}  // namespace kbvh
