#include "core/families/build/built_tree.hpp"

#include <stdexcept>
#include <string>

#include "core/base/assert.hpp"
#include "core/topology/collapse.hpp"
#include "core/topology/topology_edit.hpp"

namespace kbvh {

template <class S>
void BuiltTree<S>::start(std::uint32_t leaf_size, KernelSet kernels) {
  if (leaf_size < 1 || leaf_size > 16)
    throw std::invalid_argument("leaf size must be 1 to 16, got " + std::to_string(leaf_size));
  this->width_ = most_children;
  this->leaf_size_ = leaf_size;
  this->kernels_ = kernels;
}

template <class S>
void BuiltTree<S>::clear(std::uint32_t primitives) {
  this->nodes_.clear();
  leaves_ = 0;
  if (this->primitives_.size() < primitives) this->primitives_.resize(primitives);
}

template <class S>
void BuiltTree<S>::add_leaf(std::uint32_t begin, std::uint32_t end) {
  KBVH_ASSERT(begin < end && end - begin <= this->leaf_size_);
  if (this->first_entry_.size() <= leaves_) {
    this->first_entry_.push_back(begin);
    this->end_entry_.push_back(end);
  } else {
    this->first_entry_[leaves_] = begin;
    this->end_entry_[leaves_] = end;
  }
  ++leaves_;
}

template <class S>
std::uint32_t BuiltTree<S>::add_nodes(std::uint32_t count) {
  const std::size_t first = this->nodes_.size();
  if (first + count > WidePair::leaf_bit >> 3) throw std::length_error("a hierarchy of more than 2^28 nodes");
  this->nodes_.resize(first + count);
  return std::uint32_t(first);
}

template <class S>
void BuiltTree<S>::fit(const S* primitive_boxes) {
  if (this->empty()) return;
  const auto grow = [](auto& list, std::size_t size) {
    if (list.size() < size) list.resize(size);
  };
  const std::uint32_t padded = this->padded_leaf_size();
  grow(this->child_bounds_, node_count() * lane_scalars(most_children));
  grow(this->node_bounds_, std::size_t(8) * node_count());
  grow(leaf_boxes_, std::size_t(8) * leaves_);
  if (padded > 1) grow(this->rows_, leaves_ * lane_scalars(padded));
  // The rows of leaves are made here, so that queries find all of them current.
  grow(this->fetched_, leaves_);
  if (this->stamps_.size() < leaves_) this->stamps_.resize(leaves_, this->stamp_);
  const auto& kernels = build_kernels<S>(this->kernels_);
  kernels.leaf_rows[padded == 1   ? 0
                    : padded == 4 ? 1
                    : padded == 8 ? 2
                                  : 3]({primitive_boxes, this->primitives_.data(), this->first_entry_.data(),
                                        this->end_entry_.data(), leaves_, this->rows_.data(),
                                        leaf_boxes_.data()});
  kernels.nodes(this->arrays(), leaf_boxes_.data(), node_count());
}

namespace {
template <class S>
Box<double> box_at(const S* corners) {
  Box<double> box;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    box.lower[axis] = corners[axis];
    box.upper[axis] = corners[axis + 4];
  }
  return box;
}
}  // namespace

template <class S>
Topology BuiltTree<S>::topology(std::vector<Box<double>>& boxes) const {
  boxes.clear();
  if (this->empty()) {
    Topology topology;
    topology.width = most_children;
    topology.leaf_size = this->leaf_size_;
    return topology;
  }
  Topology topology = with_root(most_children, this->leaf_size_);
  boxes.push_back(box_at(this->node_bounds_.data()));
  const auto make_leaf = [&](std::uint32_t index, std::uint32_t leaf) {
    const auto entries = this->leaf_primitives(leaf);
    topology.nodes[index] =
        TopologyNode::leaf(std::uint32_t(topology.primitives.size()), std::uint32_t(entries.size()));
    topology.primitives.insert(topology.primitives.end(), entries.begin(), entries.end());
  };
  if (this->nodes_[0].count == 1) {
    make_leaf(0, 0);
    topology.perfect = is_perfect(topology);
    return topology;
  }
  struct Open {
    std::uint32_t wide, index;
  };
  std::vector<Open> open{{0, 0}};
  while (!open.empty()) {
    const auto [wide, index] = open.back();
    open.pop_back();
    const WideNode& node = this->nodes_[wide];
    const std::uint32_t first = add_children(topology, index, node.count);
    for (std::uint32_t lane = 0; lane < node.count; ++lane) {
      Box<double> box;
      const S* const rows = this->child_bounds_.data() + wide * lane_scalars(most_children) + lane;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        box.lower[axis] = rows[axis * most_children];
        box.upper[axis] = -rows[(axis + 3) * most_children];
      }
      boxes.push_back(box);
      if (lane < node.leaf_count)
        make_leaf(first + lane, node.first_leaf + lane);
      else
        open.push_back({node.first_child + lane - node.leaf_count, first + lane});
    }
  }
  topology.perfect = is_perfect(topology);
  return topology;
}

template class BuiltTree<float>;
template class BuiltTree<double>;

}  // namespace kbvh
