#pragma once
#include <algorithm>
#include <cstddef>
#include <vector>

namespace kbvh {

/// Returns the median of some sizes, the upper one of two: a typical size, which, unlike the mean, a single
/// much larger size does not change. 0 for no sizes. Changes their order. O(n).
inline double median(std::vector<double>& sizes) {
  if (sizes.empty()) return 0;
  const auto middle = sizes.begin() + std::ptrdiff_t(sizes.size() / 2);
  std::nth_element(sizes.begin(), middle, sizes.end());
  return *middle;
}

}  // namespace kbvh
