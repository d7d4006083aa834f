#pragma once
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "core/geometry/lane_box.hpp"
#include "core/topology/topology.hpp"

namespace kbvh {

/// Ranges of slots below the nodes of a topology; slots have the order of the leaves. A slot is an entry of
/// the topology, or a leaf.
struct SlotRanges {
  std::vector<std::uint32_t> begin, end;  ///< [node]
  std::size_t bytes() const { return (begin.capacity() + end.capacity()) * sizeof(std::uint32_t); }
};

/// Sorts items into the slots of a tree whose shape stays: at each node the items with the smallest keys
/// along the longest axis of their range go to the first children, as many as these have slots. This is the
/// median builder's rule. A sort takes about 5 ns per item and binary level.
///
/// The work can be interrupted. Allocates only for more items than ever before.
class MedianSort {
 public:
  struct Item {
    std::uint32_t key[3];  ///< below 2^31
    std::uint32_t id;
  };
  static constexpr std::uint64_t unlimited = ~std::uint64_t(0);

  /// Makes room for items in the slots [0, count).
  void resize(std::size_t count) {
    for (std::vector<Item>& items : {std::ref(items_[0]), std::ref(items_[1]), std::ref(middle_)})
      items.resize(count + 1);
  }
  /// Returns the items by slot: to be written before, and to be read after a sort.
  std::span<Item> items() { return items_[0]; }

  /// Starts to sort the items in the slots below a node. `topology` and `slots` must not change until `run`
  /// has ended.
  void start(const Topology& topology, const SlotRanges& slots, std::uint32_t node);
  /// Continues for about `work` steps, one per item and division. Returns whether the sort has ended.
  bool run(std::uint64_t work = unlimited);
  bool running() const { return !open_.empty(); }
  /// Abandons an interrupted sort.
  void stop() { open_.clear(); }

  /// Sorts the items of a range of slots into groups of equal size, the last of which may be smaller.
  void sort_groups(std::uint32_t begin, std::uint32_t end, std::uint32_t size);

  std::size_t bytes() const {
    return (items_[0].capacity() + items_[1].capacity() + middle_.capacity()) * sizeof(Item) +
           open_.capacity() * sizeof(Task);
  }

 private:
  /// Children [first, first + count) of a node, or `count` groups; their items lie in items_[buffer].
  struct Task {
    std::uint32_t begin, end, first, count, buffer;
  };
  void divide(std::uint32_t begin, std::uint32_t middle, std::uint32_t end, std::uint32_t buffer);
  void settle(std::uint32_t begin, std::uint32_t end, std::uint32_t buffer);

  std::vector<Item> items_[2];  // one more than there are slots
  std::vector<Item> middle_;    // for temporary use
  std::vector<Task> open_;
  const Topology* topology_ = nullptr;
  const SlotRanges* slots_ = nullptr;
};

/// Maps coordinates to keys: one grid for all axes, over a box in which most coordinates lie.
template <class S>
class KeyGrid {
 public:
  explicit KeyGrid(const Box<S>& box) {
    S extent = 0;
    for (int axis = 0; axis < 3; ++axis) {
      const S lower = 2 * box.lower[axis];
      lower_[axis / LaneBox<S>::width][axis % LaneBox<S>::width] = lower;
      extent = std::max(extent, 2 * box.upper[axis] - lower);
    }
    scale_ = extent > 0 ? most / extent : S(0);
  }
  /// Sets an item's keys from the middle of a box. Anything outside of the grid counts as on its border.
  void put(const LaneBox<S>& box, MedianSort::Item& item) const {
    typename LaneBox<S>::Lanes at[LaneBox<S>::parts];
    for (int i = 0; i < LaneBox<S>::parts; ++i) {
      at[i] = (box.lower[i] + box.upper[i] - lower_[i]) * scale_;
      at[i] = at[i] > S(0) ? at[i] : S(0);
      at[i] = at[i] < most ? at[i] : most;
    }
    for (int axis = 0; axis < 3; ++axis)
      item.key[axis] = std::uint32_t(std::int32_t(at[axis / LaneBox<S>::width][axis % LaneBox<S>::width]));
  }

 private:
  static constexpr S most = S(2147483520);
  typename LaneBox<S>::Lanes lower_[LaneBox<S>::parts]{};
  S scale_;
};

}  // namespace kbvh
