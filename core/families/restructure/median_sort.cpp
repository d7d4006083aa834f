#include "core/families/restructure/median_sort.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>

namespace kbvh {

namespace {

/// Ranges up to this length are divided by std::nth_element.
constexpr std::uint32_t short_range = 48;
constexpr std::uint32_t bin_bits = 8;

using Item = MedianSort::Item;

using Keys [[gnu::vector_size(16)]] = std::int32_t;  // of an item, and its id

/// Finds the longest axis of the keys, the smallest key there, and their extent.
struct Extent {
  std::uint32_t axis = 0, lower = 0, size = 0;
  explicit Extent(std::span<const Item> items) {
    Keys low, high;
    std::memcpy(&low, items.data(), sizeof low);
    high = low;
    for (const Item& item : items) {
      Keys keys;
      std::memcpy(&keys, &item, sizeof keys);
      low = keys < low ? keys : low;
      high = keys > high ? keys : high;
    }
    for (std::uint32_t a = 0; a < 3; ++a)
      if (a == 0 || std::uint32_t(high[a] - low[a]) > size) {
        axis = a;
        lower = std::uint32_t(low[a]);
        size = std::uint32_t(high[a] - low[a]);
      }
  }
};

bool is_divided(std::span<const Item> items, std::uint32_t left, std::uint32_t axis) {
  std::uint32_t largest = 0, smallest = ~std::uint32_t(0);
  for (const Item& item : items.first(left)) largest = std::max(largest, item.key[axis]);
  for (const Item& item : items.subspan(left)) smallest = std::min(smallest, item.key[axis]);
  return largest <= smallest;
}

}  // namespace

void MedianSort::start(const Topology& topology, const SlotRanges& slots, std::uint32_t node) {
  topology_ = &topology;
  slots_ = &slots;
  open_.clear();
  const TopologyNode content = topology.nodes[node];
  if (!content.is_leaf() && slots.begin[node] < slots.end[node])
    open_.push_back({slots.begin[node], slots.end[node], content.first(), content.count(), 0});
}

bool MedianSort::run(std::uint64_t work) {
  for (std::uint64_t done = 0; !open_.empty() && done < work;) {
    const Task task = open_.back();
    open_.pop_back();
    if (task.begin == task.end) continue;
    if (task.count == 1) {
      const TopologyNode content = topology_->nodes[task.first];
      if (content.is_leaf())
        settle(task.begin, task.end, task.buffer);
      else
        open_.push_back({task.begin, task.end, content.first(), content.count(), task.buffer});
      continue;
    }
    const std::uint32_t left = (task.count + 1) / 2, middle = slots_->end[task.first + left - 1];
    divide(task.begin, middle, task.end, task.buffer);
    const std::uint32_t buffer = 1 - task.buffer;
    open_.push_back({middle, task.end, task.first + left, task.count - left, buffer});
    open_.push_back({task.begin, middle, task.first, left, buffer});
    done += task.end - task.begin;
  }
  return open_.empty();
}

void MedianSort::sort_groups(std::uint32_t begin, std::uint32_t end, std::uint32_t size) {
  open_.clear();
  if (begin < end) open_.push_back({begin, end, 0, (end - begin + size - 1) / size, 0});
  while (!open_.empty()) {
    const Task task = open_.back();
    open_.pop_back();
    if (task.count == 1) {
      settle(task.begin, task.end, task.buffer);
      continue;
    }
    const std::uint32_t left = (task.count + 1) / 2, middle = task.begin + left * size;
    divide(task.begin, middle, task.end, task.buffer);
    const std::uint32_t buffer = 1 - task.buffer;
    open_.push_back({middle, task.end, 0, task.count - left, buffer});
    open_.push_back({task.begin, middle, 0, left, buffer});
  }
}

void MedianSort::settle(std::uint32_t begin, std::uint32_t end, std::uint32_t buffer) {
  if (buffer != 0) std::copy(items_[1].begin() + begin, items_[1].begin() + end, items_[0].begin() + begin);
}

/// Writes the items of a range into the other buffer, those with the smallest keys before `middle`.
void MedianSort::divide(std::uint32_t begin, std::uint32_t middle, std::uint32_t end, std::uint32_t buffer) {
  const std::span<const Item> from{items_[buffer].data() + begin, end - begin};
  Item* const to = items_[1 - buffer].data() + begin;
  const std::uint32_t left = middle - begin;
  const Extent extent(from);
  const std::uint32_t axis = extent.axis, lower = extent.lower;
  if (left == 0 || middle == end || extent.size == 0 ||
      (from.size() <= short_range && is_divided(from, left, axis))) {
    std::copy(from.begin(), from.end(), to);
    return;
  }
  const auto less = [axis](const Item& a, const Item& b) { return a.key[axis] < b.key[axis]; };
  // Finds the bin of the first item to the right of the middle. A short range is one bin.
  const int shift =
      from.size() <= short_range ? 32 : std::max(0, int(std::bit_width(extent.size)) - int(bin_bits));
  std::uint64_t first_of_bin = lower, end_of_bin = std::uint64_t(lower) + extent.size + 1;
  std::uint32_t before = 0, inside = std::uint32_t(from.size());
  if (shift < 32) {
    std::array<std::uint32_t, 1U << bin_bits> counts{};
    for (const Item& item : from) ++counts[(item.key[axis] - lower) >> shift];
    std::uint32_t bin = 0;
    while (before + counts[bin] <= left) before += counts[bin++];
    inside = counts[bin];
    first_of_bin = lower + (std::uint64_t(bin) << shift);
    end_of_bin = first_of_bin + (std::uint64_t(1) << shift);
  }
  // Writes every item to all three places and advances one of them, without a branch that depends on keys.
  // The last place may be one past the range, where another range lies.
  const Item behind = to[from.size()];
  Item *smaller = to, *larger = to + before + inside, *middle_items = middle_.data();
  for (const Item& item : from) {
    const std::uint64_t key = item.key[axis];
    const std::size_t is_smaller = key < first_of_bin, is_larger = key >= end_of_bin;
    *smaller = item;
    smaller += is_smaller;
    *larger = item;
    larger += is_larger;
    *middle_items = item;
    middle_items += 1 - is_smaller - is_larger;
  }
  to[from.size()] = behind;
  std::copy_n(middle_.begin(), inside, to + before);
  if (before == left || is_divided({to + before, inside}, left - before, axis)) return;
  // Items with equal keys are not sorted, but get the same order in every run.
  std::nth_element(to + before, to + left, to + before + inside, less);
}

}  // namespace kbvh
