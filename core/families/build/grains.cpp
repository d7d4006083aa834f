#include "core/families/build/grains.hpp"

#include <algorithm>

namespace kbvh {
namespace {
/// Squares of numbers within this limit are finite in float, and so are the sums of a few.
constexpr double largest = 1e18;
}  // namespace

template <class S>
void Grains<S>::take(Workers& workers, const CurveOrder<S>& order, std::uint32_t size) {
  keys_ = order.count();
  size_ = size;
  count_ = (keys_ + size - 1) / size;
  if (boxes_.size() < std::size_t(8) * count_) boxes_.resize(std::size_t(8) * count_);
  const Parts cut{count_, 2048};
  workers.for_each(cut.parts(), [&](std::size_t part, std::uint32_t) {
    fit(order, std::uint32_t(cut.begin(part)), std::uint32_t(cut.end(part)));
  });
}

template <class S>
void Grains<S>::fit(const CurveOrder<S>& order, std::uint32_t begin_grain, std::uint32_t end_grain) {
  const auto keys = order.keys();
  const S* const from = order.boxes();
  std::uint32_t k = begin_grain * size_;
  for (std::uint32_t grain = begin_grain; grain < end_grain; ++grain) {
    float* const box = boxes_.data() + std::size_t(8) * grain;
    const std::uint32_t end = k + primitives(grain);
    S lower[3], upper[3];
    for (std::uint32_t begin = k; k < end; ++k) {
      const S* const one = from + std::size_t(8) * CurveOrder<S>::primitive(keys[k]);
      for (int axis = 0; axis < 3; ++axis) {
        lower[axis] = k == begin ? one[axis] : std::min(lower[axis], one[axis]);
        upper[axis] = k == begin ? one[axis + 4] : std::max(upper[axis], one[axis + 4]);
      }
    }
    const auto in_range = [](S value) { return float(std::clamp(value, S(-largest), S(largest))); };
    for (int axis = 0; axis < 3; ++axis) {
      box[axis] = in_range(lower[axis]);
      box[axis + 4] = in_range(upper[axis]);
    }
    box[3] = box[7] = 0;
  }
}

template class Grains<float>;
template class Grains<double>;

}  // namespace kbvh
