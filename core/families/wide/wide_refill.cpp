// Leaves of a wide hierarchy exchange primitives. Nothing else changes: nodes, numbers of primitives and the
// order of memory stay, so the only cost is writing the lists of the changed leaves.
#include "core/families/wide/wide_refill.hpp"

#include <algorithm>
#include <utility>

#include "core/base/assert.hpp"
#include "core/families/wide/wide_hierarchy.hpp"

namespace kbvh {

template <class S>
void WideHierarchy<S>::begin_refills(const Primitives& primitives) {
  refilled_ = true;
  WideRefill& r = refill_;
  r.start = topology_.primitives;
  r.leaf_node.resize(leaf_count());
  for (std::uint32_t node = 0; node < topology_.size(); ++node)
    if (topology_.nodes[node].is_leaf())
      r.leaf_node[nodes_[places_[node].node].first_leaf + places_[node].lane] = node;
  r.list_room.resize(nodes_.size());
  for (std::size_t n = 0; n < nodes_.size(); ++n) r.list_room[n] = nodes_[n].length;
  std::uint32_t least = ~std::uint32_t(0), most = 0;
  for (const std::uint32_t primitive : topology_.primitives) {
    const auto corners = std::uint32_t(primitives[primitive].size());
    least = std::min(least, corners);
    most = std::max(most, corners);
  }
  r.corners = least == most ? most : 0;
  r.most_vertices = std::min(65535U, most) * topology_.leaf_size;
  const auto last = std::max_element(primitives.vertices.begin(), primitives.vertices.end());
  r.seen.assign(last == primitives.vertices.end() ? 0 : *last + 1, 0);
  r.stamp = 0;
}

template <class S>
std::uint32_t WideHierarchy<S>::refill(std::span<const std::uint32_t> order, const Primitives& primitives) {
  KBVH_ASSERT(!edited_ && order.size() == topology_.primitives.size());
  if (empty()) return 0;
  if (!refilled_) begin_refills(primitives);
  std::uint32_t changed = 0;
  for (std::uint32_t wide = 0; wide < node_count(); ++wide) {
    const WideNode& node = nodes_[wide];
    bool differs = false;
    for (std::uint32_t leaf = node.first_leaf; leaf < node.first_leaf + node.leaf_count; ++leaf) {
      const TopologyNode content = topology_.nodes[refill_.leaf_node[leaf]];
      const auto first = order.begin() + content.first();
      if (std::equal(first, first + content.count(), topology_.primitives.begin() + content.first()))
        continue;
      differs = true;
      std::copy_n(first, content.count(), topology_.primitives.begin() + content.first());
      std::copy_n(first, content.count(), primitives_.begin() + first_entry_[leaf]);
      stamps_[leaf] = fetched_[leaf] = 0;
    }
    if (!differs) continue;
    ++changed;
    list_refilled(wide, primitives);
  }
  if (changed != 0 && refill_.corners == 0) this->list_corners(primitives);
  return changed;
}

template <class S>
void WideHierarchy<S>::list_refilled(std::uint32_t wide, const Primitives& primitives) {
  WideRefill& r = refill_;
  WideNode& node = nodes_[wide];
  std::array<std::size_t, 9> begin{};
  std::size_t count = 0;
  for (std::uint32_t lane = 0; lane < node.leaf_count; ++lane) {
    const std::uint32_t leaf = node.first_leaf + lane;
    if (++r.stamp == 0) {
      std::fill(r.seen.begin(), r.seen.end(), 0);
      r.stamp = 1;
    }
    const std::uint32_t stamp = r.stamp;
    std::uint32_t* corner = corners_.data() + std::size_t(first_entry_[leaf]) * r.corners;
    for (const std::uint32_t primitive : this->leaf_primitives(leaf)) {
      const auto vertices = primitives[primitive];
      if (count + vertices.size() > r.lists.size()) r.lists.resize(2 * (count + vertices.size()));
      // Writes every vertex, and keeps the new ones, without a branch.
      for (const std::uint32_t vertex : vertices) {
        if (r.corners != 0) *corner++ = 3 * vertex;
        r.lists[count] = vertex;
        count += std::exchange(r.seen[vertex], stamp) != stamp ? 1 : 0;
      }
    }
    begin[lane + 1] = count;
  }
  LeafLists lists;
  for (std::uint32_t lane = 0; lane < node.leaf_count; ++lane)
    lists[lane] = {r.lists.data() + begin[lane], r.lists.data() + begin[lane + 1]};
  listed_total_ -= listed_[wide];
  measure_lists(wide, lists);
  listed_total_ += listed_[wide];
  if (node.length > r.list_room[wide]) {
    // Twice the need: lists that grow step by step leave less unused memory than they use.
    const std::uint32_t room =
        std::max<std::uint32_t>(node.length, std::min(r.most_vertices, 2U * node.length));
    r.list_room[wide] = std::uint16_t(std::min(65535U, room));
    node.list = new_list(r.list_room[wide]);
  }
  write_lists(wide, lists);
}

template void WideHierarchy<float>::begin_refills(const Primitives&);
template void WideHierarchy<double>::begin_refills(const Primitives&);
template std::uint32_t WideHierarchy<float>::refill(std::span<const std::uint32_t>, const Primitives&);
template std::uint32_t WideHierarchy<double>::refill(std::span<const std::uint32_t>, const Primitives&);
template void WideHierarchy<float>::list_refilled(std::uint32_t, const Primitives&);
template void WideHierarchy<double>::list_refilled(std::uint32_t, const Primitives&);

}  // namespace kbvh
