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

/// Returns the median of some times, of an even number the mean of the two in the middle. 0 for no times.
/// Changes their order. O(n).
inline double median_of_times(std::vector<double>& times) {
  const double upper = median(times);
  if (times.size() % 2 == 1 || times.empty()) return upper;
  const auto middle = times.begin() + std::ptrdiff_t(times.size() / 2);
  return 0.5 * (*std::max_element(times.begin(), middle) + upper);
}

}  // namespace kbvh
