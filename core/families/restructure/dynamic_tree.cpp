#include "core/families/restructure/dynamic_tree.hpp"

#include <utility>

#include "core/base/assert.hpp"
#include "core/topology/collapse.hpp"
#include "core/topology/topology_edit.hpp"

namespace kbvh {

namespace {

template <class S>
Box<S> joined(const Box<S>& a, const Box<S>& b) {
  Box<S> box = a;
  box.extend(b);
  return box;
}

/// Returns four times the squared distance of the centres.
template <class S>
double centre_distance(const Box<S>& a, const Box<S>& b) {
  double sum = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const double side =
        (double(a.lower[axis]) + double(a.upper[axis])) - (double(b.lower[axis]) + double(b.upper[axis]));
    sum += side * side;
  }
  return sum;
}

}  // namespace

template <class S>
void DynamicTree<S>::clear(std::uint32_t primitives) {
  nodes_.clear();
  free_.clear();
  leaf_of_.assign(primitives, none);
  root_ = none;
  visited_ = 0;
  grow(primitives);
}

template <class S>
void DynamicTree<S>::grow(std::uint32_t primitives) {
  if (primitives > leaf_of_.size()) leaf_of_.resize(primitives, none);
  nodes_.reserve(2 * leaf_of_.size());
  free_.reserve(2 * leaf_of_.size());
}

template <class S>
std::uint32_t DynamicTree<S>::new_node() {
  if (free_.empty()) {
    nodes_.emplace_back();
    return std::uint32_t(nodes_.size() - 1);
  }
  const std::uint32_t node = free_.back();
  free_.pop_back();
  nodes_[node] = {};
  return node;
}

/// Descends greedily to the place where a new leaf adds least to the sum of surface areas: a new parent for
/// the leaf and the node costs their common area, and a step down costs the growth of the node. Among
/// children of equal cost, as when both contain the leaf, takes the one with the nearer centre, and if these
/// are equal, the lower one.
template <class S>
std::uint32_t DynamicTree<S>::best_sibling(const Box<S>& box) {
  std::uint32_t index = root_;
  for (;;) {
    const Node& node = nodes_[index];
    ++visited_;
    if (node.is_leaf()) return index;
    const double together = surface_area(joined(node.box, box));
    const double grown = together - surface_area(node.box);
    const auto below = [&](std::uint32_t child) {
      const double area = surface_area(joined(nodes_[child].box, box));
      return grown + (nodes_[child].is_leaf() ? area : area - surface_area(nodes_[child].box));
    };
    const double first = below(node.first), second = below(node.second);
    if (together < first && together < second) return index;
    if (first != second) {
      index = first < second ? node.first : node.second;
      continue;
    }
    const Node &one = nodes_[node.first], &other = nodes_[node.second];
    const double near = centre_distance(one.box, box), far = centre_distance(other.box, box);
    index = near < far || (near == far && one.height < other.height) ? node.first : node.second;
  }
}

template <class S>
void DynamicTree<S>::insert(std::uint32_t primitive, const Box<S>& box) {
  KBVH_ASSERT(primitive < leaf_of_.size() && leaf_of_[primitive] == none);
  const std::uint32_t leaf = new_node();
  nodes_[leaf].box = box;
  nodes_[leaf].first = primitive;
  leaf_of_[primitive] = leaf;
  if (root_ == none) {
    root_ = leaf;
    return;
  }
  const std::uint32_t sibling = best_sibling(box), parent = new_node(), above = nodes_[sibling].parent;
  nodes_[parent].parent = above;
  nodes_[parent].first = sibling;
  nodes_[parent].second = leaf;
  nodes_[sibling].parent = nodes_[leaf].parent = parent;
  if (above == none)
    root_ = parent;
  else
    (nodes_[above].first == sibling ? nodes_[above].first : nodes_[above].second) = parent;
  refit_from(parent);
}

template <class S>
void DynamicTree<S>::remove(std::uint32_t primitive) {
  KBVH_ASSERT(contains(primitive));
  const std::uint32_t leaf = std::exchange(leaf_of_[primitive], none), parent = nodes_[leaf].parent;
  free_.push_back(leaf);
  if (parent == none) {
    root_ = none;
    return;
  }
  const std::uint32_t sibling = nodes_[parent].first == leaf ? nodes_[parent].second : nodes_[parent].first;
  const std::uint32_t above = nodes_[parent].parent;
  free_.push_back(parent);
  nodes_[sibling].parent = above;
  if (above == none) {
    root_ = sibling;
    return;
  }
  (nodes_[above].first == parent ? nodes_[above].first : nodes_[above].second) = sibling;
  refit_from(above);
}

template <class S>
void DynamicTree<S>::join(std::uint32_t index) {
  Node& node = nodes_[index];
  node.box = joined(nodes_[node.first].box, nodes_[node.second].box);
  node.height = height_above(node.first, node.second);
}

template <class S>
void DynamicTree<S>::refit_from(std::uint32_t node) {
  for (; node != none; node = nodes_[node].parent) {
    ++visited_;
    join(node);
    balance(node);
    rotate(node);
  }
}

/// Exchanges a child of a node with a child of its other child. The node's own box stays.
template <class S>
void DynamicTree<S>::exchange(std::uint32_t node, std::uint32_t down, std::uint32_t up) {
  const std::uint32_t middle = nodes_[up].parent;
  (nodes_[node].first == down ? nodes_[node].first : nodes_[node].second) = up;
  (nodes_[middle].first == up ? nodes_[middle].first : nodes_[middle].second) = down;
  nodes_[up].parent = node;
  nodes_[down].parent = middle;
  join(middle);
}

/// Lifts the higher child of the higher child until the children's heights differ by no more than allowed.
/// One exchange suffices after a change by one level; the joined subtrees may need further ones.
template <class S>
void DynamicTree<S>::balance(std::uint32_t node) {
  for (;;) {
    std::uint32_t low = nodes_[node].first, high = nodes_[node].second;
    if (nodes_[low].height > nodes_[high].height) std::swap(low, high);
    if (balanced(nodes_[low].height, nodes_[high].height)) return;
    ++visited_;
    const std::uint32_t first = nodes_[high].first, second = nodes_[high].second;
    exchange(node, low, nodes_[first].height > nodes_[second].height ? first : second);
    balance(high);
    nodes_[node].height = height_above(nodes_[node].first, nodes_[node].second);
  }
}

/// Exchanges a child with a child of the other child if that makes the other child's box smaller; takes the
/// best of the four exchanges that keep the heights close.
template <class S>
void DynamicTree<S>::rotate(std::uint32_t node) {
  const std::uint32_t children[2] = {nodes_[node].first, nodes_[node].second};
  double most = 0;
  std::uint32_t up = none, down = none;
  for (int side = 0; side < 2; ++side) {
    const std::uint32_t child = children[side], other = children[1 - side];
    if (nodes_[other].is_leaf()) continue;
    const double area = surface_area(nodes_[other].box);
    const std::uint32_t grandchildren[2] = {nodes_[other].first, nodes_[other].second};
    for (int k = 0; k < 2; ++k) {
      const std::uint32_t stays = grandchildren[1 - k];
      const double gain = area - surface_area(joined(nodes_[child].box, nodes_[stays].box));
      if (!(gain > most) || !balanced(nodes_[child].height, nodes_[stays].height) ||
          !balanced(nodes_[grandchildren[k]].height, height_above(child, stays)))
        continue;
      most = gain, up = grandchildren[k], down = child;
    }
  }
  if (up == none) return;
  exchange(node, down, up);
  nodes_[node].height = height_above(nodes_[node].first, nodes_[node].second);
}

template <class S>
Topology DynamicTree<S>::topology(std::vector<Box<double>>& boxes) const {
  boxes.clear();
  if (empty()) {
    Topology none_at_all;
    none_at_all.width = 2;
    none_at_all.leaf_size = 1;
    return none_at_all;
  }
  Topology topology = with_root(2, 1);
  std::vector<std::uint32_t> source{root_};
  for (std::uint32_t index = 0; index < source.size(); ++index) {
    const Node& node = nodes_[source[index]];
    boxes.push_back(to_double(node.box));
    if (node.is_leaf()) {
      topology.nodes[index] = TopologyNode::leaf(std::uint32_t(topology.primitives.size()), 1);
      topology.primitives.push_back(node.first);
    } else {
      add_children(topology, index, 2);
      source.push_back(node.first);
      source.push_back(node.second);
    }
  }
  topology.perfect = is_perfect(topology);
  return topology;
}

template class DynamicTree<float>;
template class DynamicTree<double>;

}  // namespace kbvh
