#include "core/families/build/radix_sort.hpp"

#include <algorithm>

#include "core/families/build/kernels/build_wide.hpp"

namespace kbvh {

static_assert(RadixSort::digit_bits == code_digit_bits && RadixSort::digits == code_digits,
              "kernels count the digits that this sort scatters");

std::uint32_t* RadixSort::counts() {
  counts_.assign(std::size_t(2) * digits * bins, 0);
  return counts_.data();
}

void RadixSort::sort(std::span<std::uint64_t> keys) {
  if (buffer_.size() < keys.size()) buffer_.resize(keys.size());
  std::uint64_t *from = keys.data(), *to = buffer_.data();
  const std::size_t count = keys.size();
  for (std::uint32_t digit = 0; digit < digits && count > 1; ++digit) {
    std::uint32_t* const place = counts_.data() + std::size_t(digit) * bins;
    const std::uint32_t* const others = place + std::size_t(digits) * bins;
    const std::uint32_t shift = 32 + digit * digit_bits;
    const std::size_t first = from[0] >> shift & (bins - 1);
    if (place[first] + others[first] == count) continue;
    std::uint32_t sum = 0;
    for (std::uint32_t bin = 0; bin < bins; ++bin) {
      const std::uint32_t in_bin = place[bin] + others[bin];
      place[bin] = sum;
      sum += in_bin;
    }
    for (std::size_t i = 0; i < count; ++i) {
      const std::uint64_t key = from[i];
      to[place[key >> shift & (bins - 1)]++] = key;
    }
    std::swap(from, to);
  }
  if (from != keys.data()) std::copy_n(from, count, keys.data());
}

}  // namespace kbvh
