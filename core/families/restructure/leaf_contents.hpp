#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "core/families/restructure/median_sort.hpp"
#include "core/families/wide/wide_hierarchy.hpp"

namespace kbvh {

/// Restructures one body's hierarchy by exchanging the primitives of its leaves, while the nodes and the
/// number of primitives in every leaf stay as built. After a sort the tree is the one that the median builder
/// makes over the same shape, memory is in the order of the leaves, and nothing was allocated.
///
/// Every function changes the hierarchy through `WideHierarchy::refill`, after which the hierarchy must be
/// refitted.
template <class S>
class LeafContents {
 public:
  /// Takes the shape of a hierarchy; to be called again after each change of its topology by other code.
  /// O(nodes).
  void prepare(const WideHierarchy<S>& hierarchy);

  /// Sorts the primitives below each of some nodes of the topology, none of which is above another. O(n log
  /// n) for n primitives below.
  void sort_primitives(WideHierarchy<S>& hierarchy, const Primitives& primitives, const S* positions,
                       std::span<const std::uint32_t> nodes);
  /// Does the same for the whole tree, in parts: takes the positions of the first call, and changes the
  /// hierarchy in the call that ends the sort. `work` is that of MedianSort::run. Returns whether the sort
  /// has ended; a tree of at most one node needs no sort.
  bool sort_in_parts(WideHierarchy<S>& hierarchy, const Primitives& primitives, const S* positions,
                     std::uint64_t work);
  bool in_parts() const { return in_parts_; }
  /// Abandons a sort in parts.
  void stop();

  /// Takes the primitives out of the `count` largest leaves, sorts them into new leaves, and sorts all
  /// leaves, as units, into the tree, by their boxes in the hierarchy. Leaves that hold fewer primitives than
  /// the topology's leaf size stay in place. O(leaves log leaves + n log n) for n primitives taken out.
  void renew_leaves(WideHierarchy<S>& hierarchy, const Primitives& primitives, const S* positions,
                    std::uint32_t count);
  std::uint32_t full_leaf_count() const { return std::uint32_t(full_.size()); }

  /// Returns the number of primitives below a node.
  std::uint32_t primitives_below(std::uint32_t node) const {
    return entries_.end[node] - entries_.begin[node];
  }

  std::size_t bytes() const {
    return entries_.bytes() + leaves_.bytes() + entry_sort_.bytes() + leaf_sort_.bytes() +
           (full_.capacity() + order_.capacity() + before_.capacity() + largest_.capacity()) *
               sizeof(std::uint32_t) +
           areas_.capacity() * sizeof(float);
  }

 private:
  KeyGrid<S> grid(const WideHierarchy<S>& hierarchy) const;
  void put_primitive(const KeyGrid<S>& grid, const Primitives& primitives, const S* positions,
                     std::uint32_t primitive, MedianSort::Item& item) const;
  void put_primitives(const WideHierarchy<S>& hierarchy, const Primitives& primitives, const S* positions,
                      std::uint32_t begin, std::uint32_t end);
  void take_sorted(std::uint32_t begin, std::uint32_t end);
  void choose_largest(const WideHierarchy<S>& hierarchy, std::uint32_t count);

  SlotRanges entries_, leaves_;      // slots: entries, or full leaves
  std::vector<std::uint32_t> full_;  // nodes of the full leaves, in their order
  MedianSort entry_sort_, leaf_sort_;
  std::vector<std::uint32_t> order_;   // the new contents, by entry
  std::vector<std::uint32_t> before_;  // contents of full leaves before they are sorted
  std::vector<std::uint32_t> largest_;
  std::vector<float> areas_;  // [full leaf]
  bool in_parts_ = false;
};

extern template class LeafContents<float>;
extern template class LeafContents<double>;

}  // namespace kbvh
