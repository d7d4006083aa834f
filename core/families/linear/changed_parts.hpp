#pragma once
#include <algorithm>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "core/families/wide/wide_hierarchy.hpp"

namespace kbvh {

/// The parts of one body's hierarchy that changes of plans affect: primitives with a changed vertex, their
/// leaves, and all nodes above. Not for hierarchies that were edited or refilled.
class ChangedParts {
 public:
  /// Prepares for a body. O(corners of all primitives).
  template <class S>
  void prepare(WideHierarchy<S>& hierarchy, std::uint32_t vertices);
  bool is_prepared() const { return !entries_begin_.empty(); }

  /// Marks everything that a vertex affects. O(its primitives, and the nodes that were not marked).
  void mark(std::uint32_t vertex);
  /// Removes all marks. O(marks).
  void clear();
  bool empty() const { return primitives_.empty(); }

  /// Returns, per wide node, the lanes in or below which something is marked; per leaf, its marked entries.
  const std::uint8_t* lanes() const { return lanes_.data(); }
  const std::uint16_t* entries() const { return marked_.data(); }
  std::span<const std::uint32_t> primitives() const { return primitives_; }
  /// Returns the marked leaves, numbered as by `WideNode::first_leaf`.
  std::span<const std::uint32_t> leaves() const { return leaves_; }
  /// Returns the wide nodes with marked lanes, children first. O(n log n).
  std::span<const std::uint32_t> nodes() {
    std::sort(nodes_.begin(), nodes_.end(), std::greater<>());
    return nodes_;
  }

  std::size_t bytes() const {
    return (entries_begin_.capacity() + slots_.capacity() + above_.capacity() + primitives_.capacity() +
            leaves_.capacity() + nodes_.capacity()) *
               sizeof(std::uint32_t) +
           entries_.capacity() * sizeof(Entry) + lanes_.capacity() +
           marked_.capacity() * sizeof(std::uint16_t);
  }

 private:
  static constexpr std::uint32_t none = ~std::uint32_t(0);

  /// A primitive, and its place: 16 x leaf + entry of the leaf. There are at most 2^28 leaves.
  struct Entry {
    std::uint32_t primitive, place;
  };
  std::vector<std::uint32_t> entries_begin_;  ///< [vertex, and one more]: index into entries_
  std::vector<Entry> entries_;                ///< by vertex
  std::vector<std::uint32_t> slots_;          ///< [leaf]: its place, as a LeafSlot::word
  std::vector<std::uint32_t> above_;          ///< [wide node]: its place, as a LeafSlot::word
  std::vector<std::uint8_t> lanes_;           ///< [wide node]
  std::vector<std::uint16_t> marked_;         ///< [leaf]
  std::vector<std::uint32_t> primitives_, leaves_, nodes_;
};

template <class S>
void ChangedParts::prepare(WideHierarchy<S>& hierarchy, std::uint32_t vertices) {
  const WideNode* const nodes = hierarchy.arrays().nodes;
  const WideLeafLists lists = hierarchy.leaf_lists();
  above_.assign(hierarchy.node_count(), none);
  lanes_.assign(hierarchy.node_count(), 0);
  marked_.assign(hierarchy.leaf_count(), 0);
  entries_begin_.assign(std::size_t(vertices) + 2, 0);
  slots_.assign(hierarchy.leaf_count(), 0);
  for (std::uint32_t n = 0; n < hierarchy.node_count(); ++n)
    for (std::uint32_t lane = 0; lane < nodes[n].leaf_count; ++lane)
      slots_[nodes[n].first_leaf + lane] = LeafSlot::of(n, lane);
  const auto for_corners = [&](const auto& use) {
    for (std::uint32_t leaf = 0; leaf < hierarchy.leaf_count(); ++leaf)
      for (std::uint32_t first = lists.first_entry[leaf], e = first; e < lists.end_entry[leaf]; ++e)
        for (std::uint32_t c = lists.first_corner[e]; c < lists.first_corner[e + 1]; ++c)
          use(lists.corners[c] / 3, Entry{lists.primitives[e], 16 * leaf + (e - first)});
  };
  for (std::uint32_t n = 0; n < hierarchy.node_count(); ++n)
    for (std::uint32_t lane = nodes[n].leaf_count; lane < nodes[n].count; ++lane)
      above_[nodes[n].first_child + lane - nodes[n].leaf_count] = LeafSlot::of(n, lane);
  for_corners([&](std::uint32_t vertex, const Entry& /*entry*/) { ++entries_begin_[vertex + 2]; });
  for (std::size_t v = 2; v < entries_begin_.size(); ++v) entries_begin_[v] += entries_begin_[v - 1];
  entries_.resize(entries_begin_.back());
  for_corners(
      [&](std::uint32_t vertex, const Entry& entry) { entries_[entries_begin_[vertex + 1]++] = entry; });
  primitives_.clear();
  leaves_.clear();
  nodes_.clear();
}

inline void ChangedParts::mark(std::uint32_t vertex) {
  for (std::uint32_t k = entries_begin_[vertex]; k < entries_begin_[vertex + 1]; ++k) {
    const Entry entry = entries_[k];
    const std::uint32_t leaf = entry.place / 16;
    const auto bit = std::uint16_t(1U << entry.place % 16);
    std::uint16_t& marked = marked_[leaf];
    if ((marked & bit) != 0) continue;
    primitives_.push_back(entry.primitive);
    const bool leaf_was_marked = marked != 0;
    marked |= bit;
    if (leaf_was_marked) continue;
    leaves_.push_back(leaf);
    for (LeafSlot place{slots_[leaf]};;) {
      std::uint8_t& lanes = lanes_[place.node()];
      const bool was_marked = lanes != 0;
      lanes |= std::uint8_t(1U << place.lane());
      if (was_marked) break;
      nodes_.push_back(place.node());
      if (above_[place.node()] == none) break;
      place = {above_[place.node()]};
    }
  }
}

inline void ChangedParts::clear() {
  for (const std::uint32_t leaf : leaves_) marked_[leaf] = 0;
  for (const std::uint32_t node : nodes_) lanes_[node] = 0;
  primitives_.clear();
  leaves_.clear();
  nodes_.clear();
}

}  // namespace kbvh
