#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "core/families/average/cell_masks.hpp"

namespace kbvh {

/// Pairs of nodes of wide hierarchies in order of the probability that their polygons intersect: a traversal
/// that can end at any time, after the most probable pairs (Klein & Zachmann 2003, s.4).
template <class S>
class ProbablePairs {
 public:
  /// One body of a traversal.
  struct Side {
    WideHierarchy<S>* hierarchy;
    const CellMasks<S>* grids;
  };
  /// Two nodes by their slots (CellMasks), of a pair of bodies; `root` stands for both roots.
  struct Entry {
    float probability;
    std::uint32_t bodies;
    std::uint32_t a, b;
  };
  static constexpr std::uint32_t root = ~std::uint32_t(0);

  void clear() { heap_.clear(); }
  bool empty() const { return heap_.empty(); }
  std::size_t size() const { return heap_.size(); }
  /// Returns the most probable pair; the traversal is not empty.
  const Entry& top() const { return heap_.front(); }
  Entry pop();

  /// Adds the pairs of children of two roots with overlapping boxes. Returns the number of box tests.
  std::uint64_t start(std::uint32_t bodies, const Side& a, const Side& b, Distribution distribution) {
    return expand({1, bodies, root, root}, a, b, distribution);
  }
  /// Adds the pairs of children of a popped pair, unless it consists of two leaves. Returns the number of box
  /// tests.
  std::uint64_t expand(const Entry& entry, const Side& a, const Side& b, Distribution distribution);
  static bool is_leaf(const Side& side, std::uint32_t slot) {
    return slot != root && slot % 8 < side.hierarchy->arrays().nodes[slot / 8].leaf_count;
  }
  std::size_t bytes() const { return heap_.capacity() * sizeof(Entry); }

 private:
  /// The slots that follow a slot in the traversal: the slot itself for a leaf, else its children.
  struct Group {
    std::uint32_t first, count;
  };
  static Group group_of(const Side& side, std::uint32_t slot);
  static FilledBox box_of(const Side& side, std::uint32_t slot);

  std::vector<Entry> heap_;
};

extern template class ProbablePairs<float>;
extern template class ProbablePairs<double>;

}  // namespace kbvh
