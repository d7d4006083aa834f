#pragma once
#include <cstddef>
#include <vector>

#include "core/families/wide/kernels/wide_layout.hpp"

namespace kbvh {

/// The number of leaf pairs that queries collect before they turn them into pairs of primitives: few enough
/// to stay in the cache.
inline constexpr std::size_t leaf_pair_room = 2048;

/// Takes pairs of a leaf with itself out of the list, and appends these leaves to `own`; both in their order.
/// Returns the number of pairs of two different leaves, which are left.
inline std::size_t take_out_own_leaves(LeafSlot* pairs, std::size_t count, std::vector<LeafSlot>& own) {
  std::size_t different = 0;
  for (std::size_t i = 0; i < count; ++i) {
    if (pairs[2 * i].word == pairs[2 * i + 1].word) {
      own.push_back(pairs[2 * i]);
      continue;
    }
    pairs[2 * different] = pairs[2 * i];
    pairs[2 * different + 1] = pairs[2 * i + 1];
    ++different;
  }
  return different;
}

}  // namespace kbvh
