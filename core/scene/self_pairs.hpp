#pragma once
#include <algorithm>
#include <cstdint>
#include <span>
#include <utility>

#include "core/scene/scene.hpp"

namespace kbvh {

/// Tests whether two primitives have a common vertex. Such primitives always touch and are not reported as a
/// pair.
inline bool share_vertex(std::span<const std::uint32_t> a, std::span<const std::uint32_t> b) {
  for (const std::uint32_t v : a)
    for (const std::uint32_t w : b)
      if (v == w) return true;
  return false;
}

/// The origin of pairs of primitives within one body.
enum class LeavesOf : std::uint8_t {
  two,  ///< from two leaves: each pair once, in any order
  one,  ///< from one leaf with itself: each pair twice, and every primitive with itself
};

/// Returns whether two primitives form a pair within one body, and puts the pair into canonical order.
/// Primitives with a common vertex do not, unless `primitives` is null.
inline bool keep_self_pair(const Primitives* primitives, LeavesOf leaves, std::uint32_t& a,
                           std::uint32_t& b) {
  if (a >= b) {
    if (leaves == LeavesOf::one) return false;
    std::swap(a, b);
  }
  return primitives == nullptr || !share_vertex((*primitives)[a], (*primitives)[b]);
}

/// Keeps the valid pairs among pairs within one body, canonical and once each; returns their number. `Pair`
/// has primitive_a and primitive_b.
template <class Pair>
std::size_t keep_self_pairs(const Primitives* primitives, LeavesOf leaves, Pair* pairs, std::size_t count) {
  std::size_t kept = 0;
  for (std::size_t i = 0; i < count; ++i) {
    Pair pair = pairs[i];
    if (keep_self_pair(primitives, leaves, pair.primitive_a, pair.primitive_b)) pairs[kept++] = pair;
  }
  return kept;
}

/// Returns whether a scene asks for pairs within a body.
inline bool has_self_pairs(std::span<const BodyPair> pairs) {
  return std::any_of(pairs.begin(), pairs.end(),
                     [](const BodyPair& pair) { return pair.first == pair.second; });
}

}  // namespace kbvh
