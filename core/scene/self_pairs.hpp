#pragma once
#include <algorithm>
#include <cstddef>
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

/// Returns whether a scene asks for pairs of two bodies over one vertex set.
template <class S>
bool has_pairs_of_sets(const SceneView<S>& scene) {
  return std::any_of(scene.pairs().begin(), scene.pairs().end(), [&](const BodyPair& pair) {
    return pair.first != pair.second && scene.same_vertices(pair.first, pair.second);
  });
}

/// Removes pairs of two bodies over one vertex set whose primitives have a common vertex, from the pair
/// `from` of a list on; keeps the order. pair_of(item) is a PrimitivePair. Such primitives are no pair, like
/// those within one body; here it does not matter which strategy found them.
template <class S, class List, class PairOf>
void remove_incident(const SceneView<S>& scene, List& list, std::size_t from, const PairOf& pair_of) {
  std::size_t kept = from;
  for (std::size_t i = from; i < list.size(); ++i) {
    const auto& pair = pair_of(list[i]);
    if (pair.body_a != pair.body_b && scene.same_vertices(pair.body_a, pair.body_b) &&
        share_vertex(scene.primitives(pair.body_a)[pair.primitive_a],
                     scene.primitives(pair.body_b)[pair.primitive_b]))
      continue;
    list[kept++] = list[i];
  }
  list.resize(kept);
}

}  // namespace kbvh
