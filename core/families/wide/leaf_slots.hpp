#pragma once
#include <algorithm>
#include <cstddef>
#include <span>
#include <vector>

#include "core/families/wide/kernels/wide_layout.hpp"
#include "core/families/wide/kernels/wide_overlap.hpp"
#include "core/scene/pairs.hpp"

namespace kbvh {

/// The number of leaf pairs that queries collect before turning them into pairs of primitives: few enough to
/// stay in the cache.
inline constexpr std::size_t leaf_pair_room = 2048;
/// The number of pairs of primitives that kernels find at a time.
inline constexpr std::size_t found_at_once = 2048;

/// Moves the leaves that are paired with themselves from the list to `own`, keeping both orders. Returns the
/// number of remaining pairs, which have two different leaves.
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

/// Calls take(count) for the pairs of each of the `own` leaves with itself, written to `pairs` at most `room`
/// at a time, and forgets the leaves. Queries call this at their end, so that the order of their answers does
/// not depend on how many pairs of leaves are taken at a time.
template <class Take>
void for_own_leaves(std::vector<LeafSlot>& own, LeafSlot* pairs, std::size_t room, const Take& take) {
  for (std::size_t begin = 0; begin < own.size(); begin += room) {
    const std::size_t count = std::min(room, own.size() - begin);
    for (std::size_t i = 0; i < count; ++i) pairs[2 * i] = pairs[2 * i + 1] = own[begin + i];
    take(count);
  }
  own.clear();
}

/// Appends the pairs that a kernel has found.
inline void append_found(std::span<const FoundPair> found, PairBuffer& out) {
  const std::size_t before = out.size();
  out.resize(before + found.size());
  for (std::size_t i = 0; i < found.size(); ++i)
    out[before + i] = {found[i].body_a, found[i].primitive_a, found[i].body_b, found[i].primitive_b};
}

}  // namespace kbvh
