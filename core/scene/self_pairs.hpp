#pragma once
#include <algorithm>
#include <cstdint>
#include <span>
#include <utility>

#include "core/scene/scene.hpp"

namespace kbvh {

/// Do two primitives have a vertex in common? Then they are no pair: they always touch.
inline bool share_vertex(std::span<const std::uint32_t> a, std::span<const std::uint32_t> b) {
  for (const std::uint32_t v : a)
    for (const std::uint32_t w : b)
      if (v == w) return true;
  return false;
}

/// How pairs of primitives within one body were found.
enum class LeavesOf : std::uint8_t {
  two,  ///< in two leaves: each pair once, in any order
  one,  ///< in one leaf with itself: each pair twice, and every primitive with itself
};

/// Is it a pair within one body? Puts it into canonical order. Pairs of primitives with a common vertex are
/// none, unless `primitives` is null.
inline bool keep_self_pair(const Primitives* primitives, LeavesOf leaves, std::uint32_t& a,
                           std::uint32_t& b) {
  if (a >= b) {
    if (leaves == LeavesOf::one) return false;
    std::swap(a, b);
  }
  return primitives == nullptr || !share_vertex((*primitives)[a], (*primitives)[b]);
}

/// Of pairs within one body, keeps those that are pairs, canonical and once; returns how many these are.
/// `Pair` has primitive_a and primitive_b.
template <class Pair>
std::size_t keep_self_pairs(const Primitives* primitives, LeavesOf leaves, Pair* pairs, std::size_t count) {
  std::size_t kept = 0;
  for (std::size_t i = 0; i < count; ++i) {
    Pair pair = pairs[i];
    if (keep_self_pair(primitives, leaves, pair.primitive_a, pair.primitive_b)) pairs[kept++] = pair;
  }
  return kept;
}

/// Does a scene ask for pairs within a body?
inline bool has_self_pairs(std::span<const BodyPair> pairs) {
  return std::any_of(pairs.begin(), pairs.end(),
                     [](const BodyPair& pair) { return pair.first == pair.second; });
}

}  // namespace kbvh
