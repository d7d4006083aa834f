#include "core/topology/median_order.hpp"

#include <algorithm>
#include <limits>

#include "core/base/assert.hpp"

namespace kbvh {

CentroidBounds::CentroidBounds(std::span<const BuildItem> items) {
  lower.fill(std::numeric_limits<double>::infinity());
  upper.fill(-std::numeric_limits<double>::infinity());
  for (const BuildItem& item : items)
    for (std::size_t axis = 0; axis < 3; ++axis) {
      lower[axis] = std::min(lower[axis], item.centroid[axis]);
      upper[axis] = std::max(upper[axis], item.centroid[axis]);
    }
}

void split_at_median(std::span<BuildItem> items, std::size_t middle) {
  const CentroidBounds bounds(items);
  std::size_t axis = 0;
  for (std::size_t a = 1; a < 3; ++a)
    if (bounds.upper[a] - bounds.lower[a] > bounds.upper[axis] - bounds.lower[axis]) axis = a;
  std::nth_element(items.begin(), items.begin() + std::ptrdiff_t(middle), items.end(),
                   [axis](const BuildItem& a, const BuildItem& b) {
                     return a.centroid[axis] != b.centroid[axis] ? a.centroid[axis] < b.centroid[axis]
                                                                 : a.primitive < b.primitive;
                   });
}

namespace {

/// The items of a tree's entries from `begin` on.
struct Range {
  std::span<BuildItem> items;
  std::uint32_t begin;
};

std::uint32_t first_entry(const Topology& topology, std::uint32_t node) {
  while (!topology.nodes[node].is_leaf()) node = topology.nodes[node].first();
  return topology.nodes[node].first();
}

/// Sorts a range into the subtrees [first, first + count), halving their number each time like MedianTree.
/// The recursion is as deep as the binary tree.
void sort_into(const Topology& topology, Range range, std::uint32_t first, std::uint32_t count) {
  if (count > 1) {
    const std::uint32_t left = (count + 1) / 2, middle = first_entry(topology, first + left),
                        before = middle - range.begin;
    split_at_median(range.items, before);
    sort_into(topology, {range.items.first(before), range.begin}, first, left);
    sort_into(topology, {range.items.subspan(before), middle}, first + left, count - left);
    return;
  }
  const TopologyNode node = topology.nodes[first];
  if (!node.is_leaf()) return sort_into(topology, range, node.first(), node.count());
  std::sort(range.items.begin(), range.items.end(),
            [](const BuildItem& a, const BuildItem& b) { return a.primitive < b.primitive; });
}

}  // namespace

void sort_by_medians(const Topology& topology, std::span<BuildItem> items) {
  KBVH_ASSERT(items.size() == topology.primitives.size());
  if (!topology.empty()) sort_into(topology, {items, 0}, 0, 1);
}

}  // namespace kbvh
