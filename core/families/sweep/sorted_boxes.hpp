#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/families/build/curve_order.hpp"
#include "core/families/sweep/kernels/sweep.hpp"

namespace kbvh {

/// The boxes of one body's primitives in ascending order of their lower sides on one axis. The order is kept
/// from frame to frame, so that where little moves little has to be sorted.
template <class S>
class SortedBoxes {
 public:
  /// Starts over with the primitives of a body in the order of their ids.
  void start(const PrimitiveList& list, KernelSet kernels);
  /// Sorts by new boxes, [primitive][8]: lower x, y, z, unused, upper x, y, z, unused. O(primitives) if the
  /// order changes little, else O(n log n).
  void update(const S* boxes, std::uint32_t axis);

  bool empty() const { return primitives_.empty(); }
  /// Returns one side of a sweep on the axis of the last update.
  SweepSide<S> side(std::uint32_t body) const;
  Box<double> box() const;
  std::size_t bytes() const;

 private:
  struct Key {
    S lower;
    std::uint32_t primitive;
  };
  void sort();
  /// Returns false if it gave up after this many steps.
  bool insertion_sort(std::size_t most_steps);
  /// Sorts by the lower sides rounded to 30 bits of their range.
  void radix_sort();

  KernelSet kernels_ = KernelSet::portable;
  std::vector<std::uint32_t> primitives_;
  std::vector<Key> keys_, sorted_;
  std::vector<std::uint64_t> codes_;
  RadixSort radix_;
  std::vector<std::uint32_t> begins_, ends_;  ///< [block]
  AlignedArray<S> rows_, block_boxes_, reach_;
  std::array<S, 8> box_{};
};

extern template class SortedBoxes<float>;
extern template class SortedBoxes<double>;

}  // namespace kbvh
