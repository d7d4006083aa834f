#pragma once
#include <algorithm>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "core/families/wide/wide_hierarchy.hpp"

namespace kbvh {

/// The parts of one body's hierarchy that changes of plans reach: primitives with a changed vertex, their
/// leaves, and all nodes above. Not for hierarchies that were edited or refilled.
class ChangedParts {
 public:
  /// Prepares for a body. O(corners of all primitives).
  template <class S>
  void prepare(WideHierarchy<S>& hierarchy, std::uint32_t vertices);
  bool is_prepared() const { return !entries_begin_.empty(); }

  /// Marks everything that a vertex reaches. O(its primitives, and the nodes that were not marked).
  void mark(std::uint32_t vertex);
  /// Removes all marks. O(marks).
  void clear();
  bool empty() const { return primitives_.empty(); }

  /// Returns, per wide node, the lanes in or below which something is marked.
  const std::uint8_t* lanes() const { return lanes_.data(); }
  bool is_marked(std::uint32_t primitive) const { return is_marked_[primitive] != 0; }
  std::span<const std::uint32_t> primitives() const { return primitives_; }
  /// Returns the marked leaves, numbered as by `WideNode::first_leaf`.
  std::span<const std::uint32_t> leaves() const { return leaves_; }
  /// Returns the wide nodes with marked lanes, children first. O(n log n).
  std::span<const std::uint32_t> nodes() {
    std::sort(nodes_.begin(), nodes_.end(), std::greater<>());
    return nodes_;
  }

  std::size_t bytes() const {
    return (entries_begin_.capacity() + entries_.capacity() + leaf_of_.capacity() + primitive_of_.capacity() +
            slot_of_.capacity() + above_.capacity() + primitives_.capacity() + leaves_.capacity() +
            nodes_.capacity()) *
               sizeof(std::uint32_t) +
           lanes_.capacity() + is_marked_.capacity();
  }

 private:
  static constexpr std::uint32_t none = ~std::uint32_t(0);

  std::vector<std::uint32_t> entries_begin_, entries_;  ///< of each vertex: entries of the leaf lists
  std::vector<std::uint32_t> leaf_of_, primitive_of_;   ///< [entry]
  std::vector<std::uint32_t> slot_of_;                  ///< [leaf]: LeafSlot::word
  std::vector<std::uint32_t> above_;                    ///< [wide node]: its place, as a LeafSlot::word
  std::vector<std::uint8_t> lanes_, is_marked_;         ///< [wide node], [primitive]
  std::vector<std::uint32_t> primitives_, leaves_, nodes_;
};

template <class S>
void ChangedParts::prepare(WideHierarchy<S>& hierarchy, std::uint32_t vertices) {
  const WideNode* const nodes = hierarchy.arrays().nodes;
  const WideLeafLists lists = hierarchy.leaf_lists();
  slot_of_.assign(hierarchy.leaf_count(), 0);
  above_.assign(hierarchy.node_count(), none);
  lanes_.assign(hierarchy.node_count(), 0);
  for (std::uint32_t n = 0; n < hierarchy.node_count(); ++n)
    for (std::uint32_t lane = 0; lane < nodes[n].count; ++lane)
      if (lane < nodes[n].leaf_count)
        slot_of_[nodes[n].first_leaf + lane] = LeafSlot::of(n, lane);
      else
        above_[nodes[n].first_child + lane - nodes[n].leaf_count] = LeafSlot::of(n, lane);
  std::uint32_t entries = 0, primitives = 0;
  for (std::uint32_t leaf = 0; leaf < hierarchy.leaf_count(); ++leaf)
    entries = std::max(entries, lists.end_entry[leaf]);
  leaf_of_.assign(entries, none);
  primitive_of_.assign(entries, 0);
  entries_begin_.assign(std::size_t(vertices) + 2, 0);
  const auto for_corners = [&](const auto& use) {
    for (std::uint32_t leaf = 0; leaf < hierarchy.leaf_count(); ++leaf)
      for (std::uint32_t entry = lists.first_entry[leaf]; entry < lists.end_entry[leaf]; ++entry)
        for (std::uint32_t c = lists.first_corner[entry]; c < lists.first_corner[entry + 1]; ++c)
          use(leaf, entry, lists.corners[c] / 3);
  };
  for_corners([&](std::uint32_t leaf, std::uint32_t entry, std::uint32_t vertex) {
    leaf_of_[entry] = leaf;
    primitive_of_[entry] = lists.primitives[entry];
    primitives = std::max(primitives, lists.primitives[entry] + 1);
    ++entries_begin_[vertex + 2];
  });
  for (std::size_t v = 2; v < entries_begin_.size(); ++v) entries_begin_[v] += entries_begin_[v - 1];
  entries_.assign(entries_begin_.back(), 0);
  for_corners([&](std::uint32_t /*leaf*/, std::uint32_t entry, std::uint32_t vertex) {
    entries_[entries_begin_[vertex + 1]++] = entry;
  });
  is_marked_.assign(primitives, 0);
  primitives_.clear();
  leaves_.clear();
  nodes_.clear();
}

inline void ChangedParts::mark(std::uint32_t vertex) {
  for (std::uint32_t k = entries_begin_[vertex]; k < entries_begin_[vertex + 1]; ++k) {
    const std::uint32_t entry = entries_[k], primitive = primitive_of_[entry];
    if (is_marked_[primitive] != 0) continue;
    is_marked_[primitive] = 1;
    primitives_.push_back(primitive);
    const LeafSlot leaf{slot_of_[leaf_of_[entry]]};
    const auto bit = std::uint8_t(1U << leaf.lane());
    if ((lanes_[leaf.node()] & bit) != 0) continue;
    leaves_.push_back(leaf_of_[entry]);
    for (LeafSlot place = leaf;;) {
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
  for (const std::uint32_t primitive : primitives_) is_marked_[primitive] = 0;
  for (const std::uint32_t node : nodes_) lanes_[node] = 0;
  primitives_.clear();
  leaves_.clear();
  nodes_.clear();
}

}  // namespace kbvh
