#include "core/families/build/radix_sort.hpp"

#include <algorithm>
#include <utility>

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

void RadixSort::sort(Workers& workers, std::span<std::uint64_t> keys) {
  const std::size_t count = keys.size();
  if (buffer_.size() < count) buffer_.resize(count);
  std::uint64_t *from = keys.data(), *to = buffer_.data();
  // Two parts for each thread, but each of more keys than there are bins.
  const std::size_t wanted = std::size_t(2) * workers.threads();
  const Parts parts{count, std::max<std::size_t>((count + wanted - 1) / wanted, std::size_t(2) * bins)};
  const std::size_t part_count = parts.parts();
  if (part_counts_.size() < 2 * part_count * bins) part_counts_.resize(2 * part_count * bins);
  bin_places_.resize(bins);
  const Parts ranges{bins, bins / 8};
  const auto counts_of = [this](std::size_t part) { return part_counts_.data() + 2 * part * bins; };
  for (std::uint32_t digit = 0; digit < digits && count > 1; ++digit) {
    const std::uint32_t shift = 32 + digit * digit_bits;
    const auto bin_of = [shift](std::uint64_t key) { return key >> shift & (bins - 1); };
    workers.for_each(part_count, [&](std::size_t part, std::uint32_t) {
      std::uint32_t* const at = counts_of(part);
      std::fill_n(at, 2 * bins, 0U);
      // Keys at even and at odd places are counted apart, as by the kernels.
      std::size_t i = parts.begin(part);
      const std::size_t end = parts.end(part);
      for (; i + 1 < end; i += 2) {
        ++at[bin_of(from[i])];
        ++at[bins + bin_of(from[i + 1])];
      }
      if (i < end) ++at[bin_of(from[i])];
    });
    // The keys of a bin come part by part, which keeps the sort stable.
    workers.for_each(ranges.parts(), [&](std::size_t range, std::uint32_t) {
      const std::size_t first = ranges.begin(range), last = ranges.end(range);
      std::fill(bin_places_.begin() + std::ptrdiff_t(first), bin_places_.begin() + std::ptrdiff_t(last), 0U);
      for (std::size_t part = 0; part < part_count; ++part) {
        const std::uint32_t* const at = counts_of(part);
        for (std::size_t bin = first; bin < last; ++bin) bin_places_[bin] += at[bin] + at[bins + bin];
      }
    });
    std::uint32_t sum = 0;
    bool shared_digit = false;
    for (std::uint32_t& place : bin_places_) {
      const std::uint32_t in_bin = place;
      shared_digit = shared_digit || in_bin == count;
      place = sum;
      sum += in_bin;
    }
    if (shared_digit) continue;
    workers.for_each(ranges.parts(), [&](std::size_t range, std::uint32_t) {
      const std::size_t first = ranges.begin(range), last = ranges.end(range);
      for (std::size_t part = 0; part < part_count; ++part) {
        std::uint32_t* const at = counts_of(part);
        for (std::size_t bin = first; bin < last; ++bin) {
          const std::uint32_t in_part = at[bin] + at[bins + bin];
          at[bin] = bin_places_[bin];
          bin_places_[bin] += in_part;
        }
      }
    });
    workers.for_each(part_count, [&](std::size_t part, std::uint32_t) {
      std::uint32_t* const places = counts_of(part);
      for (std::size_t i = parts.begin(part); i < parts.end(part); ++i) {
        const std::uint64_t key = from[i];
        to[places[bin_of(key)]++] = key;
      }
    });
    std::swap(from, to);
  }
  if (from == keys.data()) return;
  workers.for_each(part_count, [&](std::size_t part, std::uint32_t) {
    std::copy(from + parts.begin(part), from + parts.end(part), keys.data() + parts.begin(part));
  });
}

}  // namespace kbvh
