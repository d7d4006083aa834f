#include "core/families/wide/wide_hierarchy.hpp"

#include <algorithm>
#include <limits>
#include <stdexcept>

namespace kbvh {

template <class S>
void WideHierarchy<S>::assign(Topology topology, const Primitives& primitives, KernelSet kernels) {
  topology_ = std::move(topology);
  this->width_ = topology_.width;
  this->leaf_size_ = topology_.leaf_size;
  edited_ = refilled_ = false;
  end_entry_.clear();
  leaf_vertices_ = unique_leaf_vertices(topology_, primitives);
  listed_total_ = leaf_vertices_.vertices.size();
  kernels_ = kernels;
  refit_ = wide_refit_kernels<S>(kernels).of(topology_.width);
  place_nodes();
  find_subtrees();
  list_vertices();
  list_leaves(primitives);
}

template <class S>
void WideHierarchy<S>::place_nodes() {
  places_.assign(topology_.size(), Place{});
  parent_.assign(1, 0);
  nodes_.clear();
  if (topology_.empty()) return;
  // A root that is a leaf still needs a wide node to hold it.
  std::uint32_t inner = 0, leaves = 0;
  for (std::uint32_t i = 0; i < topology_.size(); ++i)
    if (!topology_.nodes[i].is_leaf()) places_[i].wide = inner++;
  if (inner == 0) {
    places_[0].node = 0;
    WideNode node;
    node.leaf_count = node.count = 1;
    nodes_.push_back(node);
    return;
  }
  nodes_.reserve(inner);
  parent_.assign(inner, 0);
  for (std::uint32_t i = 0; i < topology_.size(); ++i) {
    const TopologyNode source = topology_.nodes[i];
    if (source.is_leaf()) continue;
    WideNode node;
    const auto wide = std::uint32_t(nodes_.size());
    node.first_leaf = leaves;
    node.count = std::uint8_t(source.count());
    for (std::uint32_t c = source.first(); c < source.first() + source.count(); ++c) {
      if (!topology_.nodes[c].is_leaf()) continue;
      places_[c].node = wide;
      places_[c].lane = node.leaf_count++;
      ++leaves;
    }
    std::uint32_t lane = node.leaf_count;
    for (std::uint32_t c = source.first(); c < source.first() + source.count(); ++c) {
      if (topology_.nodes[c].is_leaf()) continue;
      if (lane == node.leaf_count) node.first_child = places_[c].wide;
      places_[c].node = wide;
      places_[c].lane = lane++;
      parent_[places_[c].wide] = wide;
    }
    nodes_.push_back(node);
  }
  check_node_count();
}

template <class S>
void WideHierarchy<S>::check_node_count() const {
  if (nodes_.size() > (WidePair::leaf_bit >> 3))
    throw std::length_error("a hierarchy of more than 2^28 nodes");
}

template <class S>
void WideHierarchy<S>::find_subtrees() {
  subtrees_.clear();
  above_subtrees_.clear();
  // Descendants are contiguous if nodes are numbered depth first, with siblings next to each other; other
  // topologies are not divided.
  std::vector<std::uint32_t> size(nodes_.size(), 1);
  for (std::uint32_t n = node_count(); n-- > 0;) {
    const WideNode& node = nodes_[n];
    const std::uint32_t inner = node.count - node.leaf_count;
    std::uint32_t next = node.first_child + inner;
    for (std::uint32_t c = node.first_child; c < node.first_child + inner; ++c) {
      if (nodes_[c].count != nodes_[c].leaf_count && nodes_[c].first_child != next) return;
      next += size[c] - 1;
      size[n] += size[c];
    }
  }
  const std::uint32_t largest = std::max<std::uint32_t>(256, node_count() / 64);
  for (std::uint32_t n = node_count(); n-- > 0;) {
    const bool below_largest = size[n] <= largest;
    if (below_largest && n != 0 && size[parent_[n]] <= largest) continue;
    above_subtrees_.push_back(n);
    if (below_largest && size[n] > 1)
      subtrees_.push_back({nodes_[n].first_child, nodes_[n].first_child + size[n] - 1});
  }
  if (subtrees_.size() < 2) subtrees_.clear();
}

template <class S>
void WideHierarchy<S>::list_vertices() {
  const std::uint32_t width = topology_.width;
  vertices_.clear();
  child_bounds_.assign(nodes_.size() * lane_scalars(width), std::numeric_limits<S>::infinity());
  node_bounds_.assign(nodes_.size() * 8, S(0));
  // The leaves of each wide node, by lane.
  std::vector<std::uint32_t> leaf_of(nodes_.size() * width, none);
  for (std::uint32_t i = 0; i < topology_.size(); ++i)
    if (topology_.nodes[i].is_leaf()) leaf_of[std::size_t(places_[i].node) * width + places_[i].lane] = i;
  listed_.assign(nodes_.size(), 0);
  for (std::uint32_t n = 0; n < nodes_.size(); ++n) {
    if (nodes_[n].leaf_count == 0) continue;
    LeafLists lists;
    for (std::uint32_t lane = 0; lane < nodes_[n].leaf_count; ++lane)
      lists[lane] = leaf_vertices_[leaf_of[std::size_t(n) * width + lane]];
    measure_lists(n, lists);
    nodes_[n].list = new_list(nodes_[n].length);
    write_lists(n, lists);
  }
}

template <class S>
void WideHierarchy<S>::measure_lists(std::uint32_t wide, const LeafLists& lists) {
  WideNode& node = nodes_[wide];
  std::size_t length = 0;
  listed_[wide] = 0;
  for (std::uint32_t lane = 0; lane < node.leaf_count; ++lane) {
    length = std::max(length, lists[lane].size());
    listed_[wide] += std::uint32_t(lists[lane].size());
  }
  if (length > std::numeric_limits<std::uint16_t>::max())
    throw std::length_error("a leaf has " + std::to_string(length) + " vertices; 65535 are possible");
  node.length = std::uint16_t(length);
}

template <class S>
std::uint32_t WideHierarchy<S>::new_list(std::size_t length) {
  const std::size_t first = vertices_.size(), end = first + length * topology_.width;
  if (end > std::numeric_limits<std::uint32_t>::max())
    throw std::length_error("the vertex lists of a hierarchy exceed 2^32 entries");
  vertices_.resize(end);
  return std::uint32_t(first);
}

template <class S>
void WideHierarchy<S>::write_lists(std::uint32_t wide, const LeafLists& lists) {
  const WideNode& node = nodes_[wide];
  if (node.leaf_count == 0) return;
  const std::uint32_t width = topology_.width;
  for (std::uint32_t lane = 0; lane < width; ++lane) {
    const auto list = lists[lane < node.leaf_count ? lane : 0];
    for (std::size_t i = 0; i < node.length; ++i)
      vertices_[node.list + i * width + list_place(lane, width)] = 3 * list[std::min(i, list.size() - 1)];
  }
}

template <class S>
void WideHierarchy<S>::list_leaves(const Primitives& primitives) {
  std::uint32_t leaves = 0;
  for (const TopologyNode& node : topology_.nodes) leaves += node.is_leaf() ? 1 : 0;
  std::vector<std::uint32_t> source(leaves);  // topology node of each numbered leaf
  for (std::uint32_t i = 0; i < topology_.size(); ++i)
    if (topology_.nodes[i].is_leaf()) source[nodes_[places_[i].node].first_leaf + places_[i].lane] = i;
  first_entry_.assign(1, 0);
  primitives_.clear();
  for (const std::uint32_t i : source) {
    const TopologyNode node = topology_.nodes[i];
    for (std::uint32_t k = node.first(); k < node.first() + node.count(); ++k) {
      primitives_.push_back(topology_.primitives[k]);
    }
    first_entry_.push_back(std::uint32_t(primitives_.size()));
  }
  this->list_corners(primitives);
  stamps_.assign(leaves, 0);
  fetched_.assign(leaves, 0);
  stamp_ = 1;
  // Leaves of one primitive need no boxes other than their own.
  rows_.clear();
  rows_.resize(padded_leaf_size() == 1 ? 0 : leaves * lane_scalars(padded_leaf_size()));
}

template <class S>
typename WideHierarchy<S>::Placed WideHierarchy<S>::new_place() const {
  Placed placed;
  placed.child_bounds.resize(child_bounds_.size());
  placed.node_bounds.resize(node_bounds_.size());
  placed.vertices.resize(vertices_.size());
  return placed;
}

template <class S>
void WideHierarchy<S>::place(Placed& to, std::uint32_t begin, std::uint32_t end) const {
  KBVH_ASSERT(!edited_ && !refilled_);
  const auto copy = [](const auto& from, auto& target, std::size_t first, std::size_t last) {
    std::copy(from.begin() + std::ptrdiff_t(first), from.begin() + std::ptrdiff_t(last),
              target.begin() + std::ptrdiff_t(first));
  };
  const std::size_t lanes = lane_scalars(topology_.width);
  copy(child_bounds_, to.child_bounds, begin * lanes, end * lanes);
  copy(node_bounds_, to.node_bounds, std::size_t(8) * begin, std::size_t(8) * end);
  for (std::uint32_t n = begin; n < end; ++n)
    if (nodes_[n].leaf_count > 0)
      copy(vertices_, to.vertices, nodes_[n].list,
           nodes_[n].list + std::size_t(nodes_[n].length) * topology_.width);
}

template <class S>
void WideHierarchy<S>::take_place(Placed&& placed) {
  child_bounds_ = std::move(placed.child_bounds);
  node_bounds_ = std::move(placed.node_bounds);
  vertices_ = std::move(placed.vertices);
}

template <class S>
Box<S> WideHierarchy<S>::box_in(const S* child_bounds, const S* node_bounds, std::uint32_t node) const {
  const Place place = places_[node];
  Box<S> box;
  if (place.node == none) {
    for (int axis = 0; axis < 3; ++axis) {
      box.lower[axis] = node_bounds[axis];
      box.upper[axis] = node_bounds[axis + 4];
    }
    return box;
  }
  const std::uint32_t width = topology_.width;
  const S* rows = child_bounds + place.node * lane_scalars(width) + place.lane;
  for (std::uint32_t axis = 0; axis < 3; ++axis) {
    box.lower[axis] = rows[axis * width];
    box.upper[axis] = -rows[(axis + 3) * width];
  }
  return box;
}

template <class S>
void WideHierarchy<S>::set_box(std::uint32_t node, const Box<S>& box) {
  const Place place = places_[node];
  const std::uint32_t width = topology_.width;
  for (std::uint32_t axis = 0; axis < 3; ++axis) {
    if (place.node != none) {
      S* rows = child_bounds_.data() + place.node * lane_scalars(width) + place.lane;
      rows[axis * width] = box.lower[axis];
      rows[(axis + 3) * width] = -box.upper[axis];
    }
    // The root's own box is read even if the root is a leaf.
    const std::uint32_t wide = place.wide != none ? place.wide : node == 0 ? 0 : none;
    if (wide == none) continue;
    node_bounds_[std::size_t(8) * wide + axis] = box.lower[axis];
    node_bounds_[std::size_t(8) * wide + axis + 4] = box.upper[axis];
  }
}

template <class S>
std::size_t WideHierarchy<S>::bytes() const {
  return this->tree_bytes() + topology_.bytes() +
         (leaf_vertices_.offsets.capacity() + leaf_vertices_.vertices.capacity() + parent_.capacity() +
          listed_.capacity()) *
             sizeof(std::uint32_t) +
         places_.capacity() * sizeof(Place) + subtrees_.capacity() * sizeof(Subtree) +
         above_subtrees_.capacity() * sizeof(std::uint32_t) + edits_.bytes() + refill_.bytes();
}

template <class S>
WideHierarchy<S>::WideHierarchy() = default;
template <class S>
WideHierarchy<S>::~WideHierarchy() = default;
template <class S>
WideHierarchy<S>::WideHierarchy(const WideHierarchy&) = default;
template <class S>
WideHierarchy<S>::WideHierarchy(WideHierarchy&&) noexcept = default;
template <class S>
WideHierarchy<S>& WideHierarchy<S>::operator=(const WideHierarchy&) = default;
template <class S>
WideHierarchy<S>& WideHierarchy<S>::operator=(WideHierarchy&&) noexcept = default;

template class WideHierarchy<float>;
template class WideHierarchy<double>;

}  // namespace kbvh
