#pragma once
#include <cstdint>
#include <utility>
#include <vector>

#include "core/base/list_pool.hpp"

namespace kbvh {

/// Returns, for each value below `values`, the keys of the lists that contain it, ascending. O(keys +
/// entries).
inline ListPool inverted(const ListPool& lists, std::uint32_t values) {
  std::vector<std::uint32_t> offsets(std::size_t(values) + 1, 0);
  for (std::uint32_t key = 0; key < lists.keys(); ++key)
    for (const std::uint32_t value : lists[key]) ++offsets[value + 1];
  for (std::size_t v = 1; v < offsets.size(); ++v) offsets[v] += offsets[v - 1];
  std::vector<std::uint32_t> keys(offsets.back()), next(offsets.begin(), offsets.end() - 1);
  for (std::uint32_t key = 0; key < lists.keys(); ++key)
    for (const std::uint32_t value : lists[key]) keys[next[value]++] = key;
  return ListPool(offsets, std::move(keys));
}

}  // namespace kbvh
