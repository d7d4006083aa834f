#pragma once
#include <algorithm>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/families/restructure/kernels/reinsertion.hpp"
#include "core/families/wide/height_order.hpp"
#include "core/families/wide/kernels/wide_refit.hpp"
#include "core/families/wide/wide_tree.hpp"
#include "core/topology/topology.hpp"

namespace kbvh {

/// One body's 8-wide tree in which a child of any node can move to any other place, together with everything
/// below it. A move writes the two nodes that lose and get a child, and the boxes above them; only siblings
/// may move in memory. Every node has room for 8 children from the start: nodes with the same parent lie in a
/// block of 8 numbers, and leaf `lane` of node n has the number 8 n + lane.
///
/// Leaves keep their primitives. Boxes are exact after every move if they were before.
template <class S>
class MovingTree : public WideTree<S> {
 public:
  static constexpr std::uint32_t none = ~std::uint32_t(0), into = ReinsertionSearch<S>::into;

  /// Takes a topology of width 8 over the primitives, in built layout; boxes are invalid until `refit`.
  /// Throws std::length_error beyond 2^28 nodes, 65,535 vertices in a leaf, or 2^32 entries of vertex lists.
  /// O(nodes).
  void assign(const Topology& topology, const Primitives& primitives, KernelSet kernels);
  /// Recomputes all boxes from positions [vertex][3]. O(nodes + vertices of leaves).
  void refit(const S* positions);

  /// Finds the best place for a child of a node; the child must not be an only child. The result's `gain` is
  /// 0 if no place is better, or if the child is one of the root's only two. `lane_price`, `least` and
  /// `most_visits` are those of ReinsertionSearch. Boxes must be current.
  ReinsertionSearch<S> best_place(std::uint32_t node, std::uint32_t lane, S lane_price, S least,
                                  std::uint32_t most_visits);
  /// Moves a child to the place found. Also removes the node that it leaves if its other children are better
  /// placed above, or if only one remains. Throws std::invalid_argument, and changes nothing, if the place
  /// lies below the child. O(8 x depth). Allocates if it needs more blocks than ever before.
  void move(const ReinsertionSearch<S>& found);
  /// Writes the gains of taking out each of the 8 children of a node, like ReinsertionKernels.
  void gains(std::uint32_t node, S* gains) {
    reinsertion_kernels<S>(this->kernels_).gains(this->arrays(), node, gains);
  }
  /// Writes how much nodes have grown since they settled, like ReinsertionKernels.
  double growths(std::span<const std::uint32_t> nodes, S growth, S* scores) {
    return reinsertion_kernels<S>(this->kernels_)
        .growths(this->arrays(), nodes.data(), std::uint32_t(nodes.size()), settled_.data(), growth, scores);
  }
  /// Records that a node, or all nodes, cannot be improved at present.
  void settle(std::uint32_t node) { settled_[node] = surface(node); }
  void settle();

  /// Returns the nodes, children before their parents.
  std::span<const std::uint32_t> nodes() const { return order_.nodes(); }

  /// Returns the number of node numbers, used or free; nodes have smaller numbers.
  std::uint32_t numbers() const { return std::uint32_t(this->nodes_.size()); }
  std::uint32_t node_count() const { return std::uint32_t(order_.nodes().size()); }
  const WideNode& node(std::uint32_t index) const { return this->nodes_[index]; }
  std::size_t leaf_vertex_count() const { return leaf_vertices_.vertices.size(); }

  /// Returns the tree as a topology, and the box of each node. O(nodes).
  Topology topology(std::vector<Box<double>>& boxes) const;
  /// Checks that nodes, blocks, leaves and the order of the refit are consistent. Returns an empty text, or
  /// the first fault. O(nodes).
  std::string check() const;

  std::size_t bytes() const;

 private:
  friend struct MovingTreeFaults;
  static std::uint32_t inner_count(const WideNode& node) { return node.count - node.leaf_count; }
  std::uint32_t parent(std::uint32_t node) const { return block_parent_[node / 8]; }
  std::uint32_t lane_in_parent(std::uint32_t node) const {
    return this->nodes_[parent(node)].leaf_count + node % 8;
  }
  S* rows(std::uint32_t node) { return this->child_bounds_.data() + node * lane_scalars(8); }
  S* own(std::uint32_t node) { return this->node_bounds_.data() + std::size_t(8) * node; }
  S surface(std::uint32_t node);

  std::uint32_t new_block(std::uint32_t parent);
  void grow(std::uint32_t numbers);
  void make_node(std::uint32_t node);
  void move_node(std::uint32_t from, std::uint32_t to);
  void write_lists(std::uint32_t node);
  void put_leaf(std::uint32_t number, std::uint32_t leaf);
  void copy_lane(std::uint32_t node, std::uint32_t from, std::uint32_t to);
  void read_lane(std::uint32_t node, std::uint32_t lane, S* box);
  void set_lane(std::uint32_t node, std::uint32_t lane, const S* box);
  void add_leaf(std::uint32_t node, std::uint32_t leaf, const S* box);
  void remove_leaf(std::uint32_t node, std::uint32_t lane);
  std::uint32_t add_inner(std::uint32_t node, const S* box);
  void remove_inner(std::uint32_t node, std::uint32_t child);
  std::uint32_t lane_of_leaf(std::uint32_t node, std::uint32_t leaf) const;
  void put_child(std::uint32_t node, std::uint32_t leaf, std::uint32_t child, const S* box);
  std::uint32_t pair_place(const ReinsertionSearch<S>& found);
  void absorb(std::uint32_t node);
  bool absorbs(std::uint32_t node, S lane_price);
  void box_changed(std::uint32_t node);
  void update_heights(std::uint32_t node);

  std::vector<std::uint32_t> block_parent_;  // [node / 8]; none: a free block
  std::vector<std::uint32_t> free_blocks_;
  std::vector<std::uint32_t> leaf_at_;  // [number of a leaf]: its id
  std::vector<TopologyNode> leaves_;    // [id]: entries
  LeafVertices leaf_vertices_;          // by id
  std::uint32_t list_room_ = 0;         // vertices per lane
  std::vector<S> settled_;              // [node]: half its surface when it settled
  HeightOrder order_;
  std::vector<ReinsertionOpen<S>> stack_;
};

extern template class MovingTree<float>;
extern template class MovingTree<double>;

}  // namespace kbvh
