#pragma once
#include <cstddef>
#include <utility>

#include "core/families/wide/kernels/wide_layout.hpp"

namespace kbvh {

/// The number of leaf pairs that queries collect before they turn them into pairs of primitives: few enough
/// to stay in the cache.
inline constexpr std::size_t leaf_pair_room = 2048;

/// Moves pairs of two different leaves before pairs of a leaf with itself; returns the number of the former.
inline std::size_t different_leaves_first(LeafSlot* pairs, std::size_t count) {
  std::size_t different = 0;
  for (std::size_t i = 0; i < count; ++i) {
    if (pairs[2 * i].word == pairs[2 * i + 1].word) continue;
    std::swap(pairs[2 * different], pairs[2 * i]);
    std::swap(pairs[2 * different + 1], pairs[2 * i + 1]);
    ++different;
  }
  return different;
}

}  // namespace kbvh
