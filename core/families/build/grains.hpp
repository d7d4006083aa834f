#pragma once
#include <algorithm>
#include <cstdint>

#include "core/families/build/built_tree.hpp"
#include "core/families/build/curve_order.hpp"

namespace kbvh {

/// Runs of a few primitives along a curve, each treated as one by a builder; with a grain of 1, every
/// primitive is a run. Boxes are in float, for decisions only.
template <class S>
class Grains {
 public:
  /// Cuts the sorted primitives of an order into runs of `size`, on the threads of `workers`.
  void take(Workers& workers, const CurveOrder<S>& order, std::uint32_t size);
  std::uint32_t count() const { return count_; }
  std::uint32_t size() const { return size_; }
  /// Returns the boxes, [grain][8]: lower x, y, z, 0, upper x, y, z, 0.
  const float* boxes() const { return boxes_.data(); }
  /// Returns the number of primitives of a grain.
  std::uint32_t primitives(std::uint32_t grain) const { return std::min(size_, keys_ - grain * size_); }
  /// Writes the primitives of a grain; returns the place after the last one.
  std::uint32_t* write(const CurveOrder<S>& order, std::uint32_t grain, std::uint32_t* to) const {
    const auto keys = order.keys();
    const std::uint32_t begin = grain * size_, end = begin + primitives(grain);
    for (std::uint32_t k = begin; k < end; ++k) *to++ = CurveOrder<S>::primitive(keys[k]);
    return to;
  }
  std::size_t bytes() const { return boxes_.capacity() * sizeof(float); }

 private:
  /// Computes the boxes of the grains [begin_grain, end_grain).
  void fit(const CurveOrder<S>& order, std::uint32_t begin_grain, std::uint32_t end_grain);

  std::uint32_t count_ = 0, size_ = 1, keys_ = 0;
  AlignedArray<float> boxes_;
};

extern template class Grains<float>;
extern template class Grains<double>;

}  // namespace kbvh
