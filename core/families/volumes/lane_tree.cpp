#include "core/families/volumes/lane_tree.hpp"

#include <algorithm>
#include <array>
#include <limits>
#include <span>
#include <stdexcept>
#include <string>

namespace kbvh {

template <class S>
void LaneTree<S>::assign(Topology topology, const Primitives& primitives, Cover cover) {
  topology_ = std::move(topology);
  primitives_ = &primitives;
  cover_ = cover;
  placed_.assign(cover == Cover::boxes ? 3 * corners_each * primitives.count() + 1 : 0, S(0));
  place_nodes();
  const LeafVertices of_leaves = points_of_leaves(topology_, primitives, cover);
  listed_ = of_leaves.vertices.size();
  list_points(of_leaves);
  list_ranges(of_leaves);
  list_leaves();
}

template <class S>
const S* LaneTree<S>::place(const S* positions) {
  if (++stamp_ == 0) {
    std::fill(stamps_.begin(), stamps_.end(), 0);
    stamp_ = 1;
  }
  if (cover_ == Cover::vertices) return positions;
  place_corners(topology_, *primitives_, positions, placed_.data());
  return placed_.data();
}

template <class S>
void LaneTree<S>::place_nodes() {
  nodes_.clear();
  leaf_of_.clear();
  wide_.assign(topology_.size(), none);
  slots_.assign(topology_.size(), none);
  if (topology_.empty()) return;
  std::uint32_t inner = 0;
  for (std::uint32_t i = 0; i < topology_.size(); ++i)
    if (!topology_.nodes[i].is_leaf()) wide_[i] = inner++;
  if (inner > (WidePair::leaf_bit >> 3)) throw std::length_error("a hierarchy of more than 2^28 nodes");
  if (inner == 0) {  // a root that is a leaf still needs a wide node to hold it
    WideNode node;
    node.leaf_count = node.count = 1;
    nodes_.push_back(node);
    slots_[0] = LeafSlot::of(0, 0);
    leaf_of_.push_back(0);
    return;
  }
  for (std::uint32_t i = 0; i < topology_.size(); ++i) {
    const TopologyNode source = topology_.nodes[i];
    if (source.is_leaf()) continue;
    WideNode node;
    node.first_leaf = std::uint32_t(leaf_of_.size());
    node.count = std::uint8_t(source.count());
    for (std::uint32_t c = source.first(); c < source.first() + source.count(); ++c) {
      if (!topology_.nodes[c].is_leaf()) continue;
      slots_[c] = LeafSlot::of(wide_[i], node.leaf_count++);
      leaf_of_.push_back(c);
    }
    std::uint32_t lane = node.leaf_count;
    for (std::uint32_t c = source.first(); c < source.first() + source.count(); ++c) {
      if (topology_.nodes[c].is_leaf()) continue;
      if (lane == node.leaf_count) node.first_child = wide_[c];
      slots_[c] = LeafSlot::of(wide_[i], lane++);
    }
    nodes_.push_back(node);
  }
}

template <class S>
void LaneTree<S>::list_points(const LeafVertices& of_leaves) {
  lists_.clear();
  longest_list_ = 0;
  for (WideNode& node : nodes_) {
    std::size_t length = 0;
    for (std::uint32_t lane = 0; lane < node.leaf_count; ++lane)
      length = std::max(length, of_leaves[leaf_of_[node.first_leaf + lane]].size());
    if (length > std::numeric_limits<std::uint16_t>::max())
      throw std::length_error("a leaf has " + std::to_string(length) + " points; 65535 are possible");
    const std::size_t first = lists_.size();
    if (first + length * lanes > std::numeric_limits<std::uint32_t>::max())
      throw std::length_error("the point lists of a hierarchy exceed 2^32 entries");
    node.list = std::uint32_t(first);
    node.length = std::uint16_t(length);
    longest_list_ = std::max(longest_list_, std::uint32_t(length));
    lists_.resize(first + length * lanes);
    for (std::uint32_t lane = 0; lane < lanes && node.leaf_count != 0; ++lane) {
      const auto list = of_leaves[leaf_of_[node.first_leaf + (lane < node.leaf_count ? lane : 0)]];
      for (std::size_t i = 0; i < length; ++i)
        lists_[first + i * lanes + list_place(lane, lanes)] = 3 * list[std::min(i, list.size() - 1)];
    }
  }
}

template <class S>
void LaneTree<S>::list_ranges(const LeafVertices& of_leaves) {
  points_.clear();
  ranges_.assign(nodes_.size(), {0, 0});
  std::vector<std::uint32_t> open, together;
  constexpr std::uint32_t finished = WidePair::leaf_bit;
  if (!nodes_.empty()) open.push_back(0);
  while (!open.empty()) {
    const std::uint32_t top = open.back();
    open.pop_back();
    if ((top & finished) != 0) {
      ranges_[top & ~finished].end = std::uint32_t(points_.size());
      continue;
    }
    const WideNode& node = nodes_[top];
    ranges_[top].begin = std::uint32_t(points_.size());
    open.push_back(top | finished);
    for (std::uint32_t lane = node.leaf_count; lane < node.count; ++lane)
      open.push_back(node.first_child + lane - node.leaf_count);
    together.clear();
    for (std::uint32_t lane = 0; lane < node.leaf_count; ++lane) {
      const auto list = of_leaves[leaf_of_[node.first_leaf + lane]];
      together.insert(together.end(), list.begin(), list.end());
    }
    std::sort(together.begin(), together.end());
    together.erase(std::unique(together.begin(), together.end()), together.end());
    for (const std::uint32_t point : together) points_.push_back(3 * point);
  }
  while (points_.size() % lanes != 0) points_.push_back(points_.back());
}

template <class S>
void LaneTree<S>::list_leaves() {
  first_entry_.assign(1, 0);
  first_corner_.assign(1, 0);
  corners_.clear();
  topology_order_.clear();
  for (const std::uint32_t leaf : leaf_of_) {
    const TopologyNode node = topology_.nodes[leaf];
    for (std::uint32_t k = node.first(); k < node.first() + node.count(); ++k) {
      const std::uint32_t primitive = topology_.primitives[k];
      topology_order_.push_back(primitive);
      if (cover_ == Cover::vertices)
        for (const std::uint32_t v : (*primitives_)[primitive]) corners_.push_back(3 * v);
      else
        for (const std::uint32_t corner : {0U, corners_each - 1})  // two corners span the box
          corners_.push_back(3 * (corners_each * primitive + corner));
      first_corner_.push_back(std::uint32_t(corners_.size()));
    }
    first_entry_.push_back(std::uint32_t(topology_order_.size()));
  }
  stamps_.assign(leaf_of_.size(), 0);
  stamp_ = 1;
  rows_.assign(leaf_of_.size() * row_scalars(padded_leaf_size()), S(0));
}

template <class S>
std::size_t LaneTree<S>::bytes() const {
  return topology_.bytes() + nodes_.capacity() * sizeof(WideNode) +
         (wide_.capacity() + slots_.capacity() + leaf_of_.capacity() + lists_.capacity() +
          points_.capacity() + first_entry_.capacity() + first_corner_.capacity() + corners_.capacity() +
          topology_order_.capacity() + stamps_.capacity()) *
             sizeof(std::uint32_t) +
         ranges_.capacity() * sizeof(Range) + (rows_.capacity() + placed_.capacity()) * sizeof(S);
}

template class LaneTree<float>;
template class LaneTree<double>;

}  // namespace kbvh
