#include "core/families/build/built_tree.hpp"

#include <stdexcept>
#include <string>

#include "core/base/assert.hpp"
#include "core/families/wide/tree_topology.hpp"

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
std::uint32_t BuiltTree<S>::add_leaves(std::uint32_t count) {
  const std::uint32_t first = leaves_;
  leaves_ += count;
  if (this->first_entry_.size() < leaves_) {
    this->first_entry_.resize(leaves_);
    this->end_entry_.resize(leaves_);
  }
  return first;
}

template <class S>
std::uint32_t BuiltTree<S>::add_nodes(std::uint32_t count) {
  const std::size_t first = this->nodes_.size();
  if (first + count > WidePair::leaf_bit >> 3) throw std::length_error("a hierarchy of more than 2^28 nodes");
  this->nodes_.resize(first + count);
  return std::uint32_t(first);
}

template <class S>
void BuiltTree<S>::grow() {
  const auto grow_to = [](auto& list, std::size_t size) {
    if (list.size() < size) list.resize(size);
  };
  const std::uint32_t padded = this->padded_leaf_size();
  grow_to(this->child_bounds_, node_count() * lane_scalars(most_children));
  grow_to(this->node_bounds_, std::size_t(8) * node_count());
  grow_to(leaf_boxes_, std::size_t(8) * leaves_);
  if (padded > 1) grow_to(this->rows_, leaves_ * lane_scalars(padded));
  // The rows of leaves are made with the boxes, so that queries find all of them current.
  grow_to(this->fetched_, leaves_);
  if (this->stamps_.size() < leaves_) this->stamps_.resize(leaves_, this->stamp_);
}

template <class S>
void BuiltTree<S>::fit_leaves(const S* primitive_boxes, std::uint32_t begin, std::uint32_t end) {
  const std::uint32_t padded = this->padded_leaf_size();
  S* const rows = padded > 1 ? this->rows_.data() + begin * lane_scalars(padded) : nullptr;
  build_kernels<S>(this->kernels_)
      .leaf_rows[padded == 1   ? 0
                 : padded == 4 ? 1
                 : padded == 8 ? 2
                               : 3]({primitive_boxes, this->primitives_.data(),
                                     this->first_entry_.data() + begin, this->end_entry_.data() + begin,
                                     end - begin, rows, leaf_boxes_.data() + std::size_t(8) * begin});
}

template <class S>
void BuiltTree<S>::fit(const S* primitive_boxes) {
  if (this->empty()) return;
  grow();
  fit_leaves(primitive_boxes, 0, leaves_);
  build_kernels<S>(this->kernels_).nodes(this->arrays(), leaf_boxes_.data(), 0, node_count());
}

template <class S>
void BuiltTree<S>::find_levels() {
  levels_.clear();
  std::uint32_t end = 1;
  for (std::uint32_t begin = 0; begin < end;) {
    levels_.push_back(begin);
    std::uint32_t last = end;  // the last node of the level that has nodes below ends the next level
    while (last > begin && this->nodes_[last - 1].leaf_count == this->nodes_[last - 1].count) --last;
    std::uint32_t below = end;
    if (last > begin) {
      const WideNode& node = this->nodes_[last - 1];
      below = node.first_child + node.count - node.leaf_count;
    }
    begin = end;
    end = below;
  }
  levels_.push_back(end);
  KBVH_ASSERT(end == node_count());
}

template <class S>
void BuiltTree<S>::fit(Workers& workers, const S* primitive_boxes) {
  if (this->empty() || !workers.several()) return fit(primitive_boxes);
  grow();
  find_levels();
  const Parts leaves{leaves_, 256};
  workers.for_each(leaves.parts(), [&](std::size_t part, std::uint32_t) {
    fit_leaves(primitive_boxes, std::uint32_t(leaves.begin(part)), std::uint32_t(leaves.end(part)));
  });
  for (std::size_t level = levels_.size() - 1; level-- > 0;) {
    const std::uint32_t begin = levels_[level];
    const Parts nodes{levels_[level + 1] - begin, 64};
    workers.for_each(nodes.parts(), [&](std::size_t part, std::uint32_t) {
      build_kernels<S>(this->kernels_)
          .nodes(this->arrays(), leaf_boxes_.data(), std::uint32_t(begin + nodes.begin(part)),
                 std::uint32_t(begin + nodes.end(part)));
    });
  }
}

template <class S>
Topology BuiltTree<S>::topology(std::vector<Box<double>>& boxes) const {
  return topology_of(
      std::span<const WideNode>(this->nodes_), this->child_bounds_.data(), this->node_bounds_.data(),
      most_children, this->leaf_size_, [&](std::uint32_t leaf) { return this->leaf_primitives(leaf); },
      boxes);
}

template class BuiltTree<float>;
template class BuiltTree<double>;

}  // namespace kbvh
