#include "core/families/restructure/leaf_contents.hpp"

#include <algorithm>
#include <numeric>

#include "core/base/assert.hpp"

namespace kbvh {

namespace {

template <class S>
LaneBox<S> lane_box(const Box<S>& box) {
  LaneBox<S> lanes{};
  for (int axis = 0; axis < 3; ++axis) {
    lanes.lower[axis / LaneBox<S>::width][axis % LaneBox<S>::width] = box.lower[axis];
    lanes.upper[axis / LaneBox<S>::width][axis % LaneBox<S>::width] = box.upper[axis];
  }
  return lanes;
}

}  // namespace

template <class S>
void LeafContents<S>::prepare(const WideHierarchy<S>& hierarchy) {
  const Topology& topology = hierarchy.topology();
  const std::uint32_t nodes = topology.size();
  stop();
  full_.clear();
  for (SlotRanges* const slots : {&entries_, &leaves_}) {
    slots->begin.assign(nodes, 0);
    slots->end.assign(nodes, 0);
  }
  std::vector<std::uint32_t> leaves;
  for (std::uint32_t node = 0; node < nodes; ++node)
    if (topology.nodes[node].is_leaf()) leaves.push_back(node);
  std::sort(leaves.begin(), leaves.end(), [&](std::uint32_t a, std::uint32_t b) {
    return topology.nodes[a].first() < topology.nodes[b].first();
  });
  for (const std::uint32_t leaf : leaves) {
    const TopologyNode content = topology.nodes[leaf];
    entries_.begin[leaf] = content.first();
    entries_.end[leaf] = content.first() + content.count();
    leaves_.begin[leaf] = std::uint32_t(full_.size());
    if (content.count() == topology.leaf_size) full_.push_back(leaf);
    leaves_.end[leaf] = std::uint32_t(full_.size());
  }
  for (std::uint32_t node = nodes; node-- > 0;) {
    const TopologyNode content = topology.nodes[node];
    if (content.is_leaf()) continue;
    for (SlotRanges* const slots : {&entries_, &leaves_}) {
      slots->begin[node] = slots->begin[content.first()];
      slots->end[node] = slots->end[content.first() + content.count() - 1];
    }
    for (std::uint32_t c = content.first() + 1; c < content.first() + content.count(); ++c)
      KBVH_ASSERT(entries_.begin[c] == entries_.end[c - 1]);  // as built
  }
  order_ = topology.primitives;
  entry_sort_.resize(order_.size());
  leaf_sort_.resize(full_.size());
  before_.resize(full_.size() * topology.leaf_size);
  largest_.resize(full_.size());
  areas_.resize(full_.size());
}

template <class S>
void LeafContents<S>::stop() {
  entry_sort_.stop();
  in_parts_ = false;
}

template <class S>
KeyGrid<S> LeafContents<S>::grid(const WideHierarchy<S>& hierarchy) const {
  return KeyGrid<S>(hierarchy.box(0));
}

template <class S>
void LeafContents<S>::put_primitive(const KeyGrid<S>& grid, const Primitives& primitives, const S* positions,
                                    std::uint32_t primitive, MedianSort::Item& item) const {
  grid.put(LaneBox<S>::of(primitives[primitive], positions), item);
  item.id = primitive;
}

template <class S>
void LeafContents<S>::put_primitives(const WideHierarchy<S>& hierarchy, const Primitives& primitives,
                                     const S* positions, std::uint32_t begin, std::uint32_t end) {
  const KeyGrid<S> keys = grid(hierarchy);
  const auto& now = hierarchy.topology().primitives;
  const auto items = entry_sort_.items();
  for (std::uint32_t slot = begin; slot < end; ++slot)
    put_primitive(keys, primitives, positions, now[slot], items[slot]);
}

template <class S>
void LeafContents<S>::take_sorted(std::uint32_t begin, std::uint32_t end) {
  const auto items = entry_sort_.items();
  for (std::uint32_t slot = begin; slot < end; ++slot) order_[slot] = items[slot].id;
}

template <class S>
void LeafContents<S>::sort_primitives(WideHierarchy<S>& hierarchy, const Primitives& primitives,
                                      const S* positions, std::span<const std::uint32_t> nodes) {
  order_ = hierarchy.topology().primitives;
  for (const std::uint32_t node : nodes) {
    const std::uint32_t begin = entries_.begin[node], end = entries_.end[node];
    put_primitives(hierarchy, primitives, positions, begin, end);
    entry_sort_.start(hierarchy.topology(), entries_, node);
    entry_sort_.run();
    take_sorted(begin, end);
  }
  hierarchy.refill(order_, primitives);
}

template <class S>
bool LeafContents<S>::sort_in_parts(WideHierarchy<S>& hierarchy, const Primitives& primitives,
                                    const S* positions, std::uint64_t work) {
  const auto all = std::uint32_t(order_.size());
  if (hierarchy.topology().size() < 2) return true;  // no tree, or one leaf
  if (!in_parts_) {
    put_primitives(hierarchy, primitives, positions, 0, all);
    entry_sort_.start(hierarchy.topology(), entries_, 0);
    in_parts_ = true;
  }
  if (!entry_sort_.run(work)) return false;
  in_parts_ = false;
  take_sorted(0, all);
  hierarchy.refill(order_, primitives);
  return true;
}

template <class S>
void LeafContents<S>::choose_largest(const WideHierarchy<S>& hierarchy, std::uint32_t count) {
  for (std::size_t i = 0; i < full_.size(); ++i) areas_[i] = float(surface_area(hierarchy.box(full_[i])));
  std::iota(largest_.begin(), largest_.end(), 0U);
  std::nth_element(largest_.begin(), largest_.begin() + count, largest_.end(),
                   [&](std::uint32_t a, std::uint32_t b) {
                     return areas_[a] != areas_[b] ? areas_[a] > areas_[b] : a < b;
                   });
  std::sort(largest_.begin(), largest_.begin() + count);
}

template <class S>
void LeafContents<S>::renew_leaves(WideHierarchy<S>& hierarchy, const Primitives& primitives,
                                   const S* positions, std::uint32_t count) {
  if (full_.empty() || hierarchy.topology().size() < 2) return;
  const Topology& topology = hierarchy.topology();
  const std::uint32_t size = topology.leaf_size;
  const KeyGrid<S> keys = grid(hierarchy);
  const auto leaf_items = leaf_sort_.items();
  const auto entry_items = entry_sort_.items();
  for (std::size_t i = 0; i < full_.size(); ++i) {
    const auto first = topology.primitives.begin() + topology.nodes[full_[i]].first();
    std::copy_n(first, size, before_.begin() + std::ptrdiff_t(i * size));
    keys.put(lane_box(hierarchy.box(full_[i])), leaf_items[i]);
    leaf_items[i].id = std::uint32_t(i);
  }
  count = std::min(count, full_leaf_count());
  choose_largest(hierarchy, count);
  for (std::uint32_t i = 0; i < count; ++i)
    for (std::uint32_t k = 0; k < size; ++k)
      put_primitive(keys, primitives, positions, before_[largest_[i] * size + k], entry_items[i * size + k]);
  entry_sort_.sort_groups(0, count * size, size);
  for (std::uint32_t i = 0; i < count; ++i) {
    std::uint32_t low[3] = {~0U, ~0U, ~0U}, high[3] = {0, 0, 0};
    for (std::uint32_t k = 0; k < size; ++k) {
      const MedianSort::Item& item = entry_items[i * size + k];
      before_[largest_[i] * size + k] = item.id;
      for (int axis = 0; axis < 3; ++axis) {
        low[axis] = std::min(low[axis], item.key[axis]);
        high[axis] = std::max(high[axis], item.key[axis]);
      }
    }
    for (int axis = 0; axis < 3; ++axis)
      leaf_items[largest_[i]].key[axis] = low[axis] + (high[axis] - low[axis]) / 2;
  }
  leaf_sort_.start(topology, leaves_, 0);
  leaf_sort_.run();
  order_ = topology.primitives;
  for (std::size_t i = 0; i < full_.size(); ++i)
    std::copy_n(before_.begin() + std::ptrdiff_t(std::size_t(leaf_items[i].id) * size), size,
                order_.begin() + topology.nodes[full_[i]].first());
  hierarchy.refill(order_, primitives);
}

template class LeafContents<float>;
template class LeafContents<double>;

}  // namespace kbvh
