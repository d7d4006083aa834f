#pragma once
#include <utility>
#include <vector>

#include "core/families/wide/wide_tree.hpp"
#include "core/topology/collapse.hpp"
#include "core/topology/topology_edit.hpp"

namespace kbvh {

/// Converts a wide tree without a topology to a topology, and returns the box of each node: for audits.
/// `nodes`, `child_bounds` and `node_bounds` are as in WideArrays, node 0 being the root; primitives_of(leaf)
/// returns the primitives of a leaf. O(nodes).
template <class S, class PrimitivesOf>
Topology topology_of(std::span<const WideNode> nodes, const S* child_bounds, const S* node_bounds,
                     std::uint32_t width, std::uint32_t leaf_size, const PrimitivesOf& primitives_of,
                     std::vector<Box<double>>& boxes) {
  boxes.clear();
  if (nodes.empty()) {
    Topology topology;
    topology.width = width;
    topology.leaf_size = leaf_size;
    return topology;
  }
  Topology topology = with_root(width, leaf_size);
  Box<double> root;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    root.lower[axis] = node_bounds[axis];
    root.upper[axis] = node_bounds[axis + 4];
  }
  boxes.push_back(root);
  const auto make_leaf = [&](std::uint32_t index, std::uint32_t leaf) {
    const auto entries = primitives_of(leaf);
    topology.nodes[index] =
        TopologyNode::leaf(std::uint32_t(topology.primitives.size()), std::uint32_t(entries.size()));
    topology.primitives.insert(topology.primitives.end(), entries.begin(), entries.end());
  };
  if (nodes[0].count == 1) {
    make_leaf(0, nodes[0].first_leaf);
    topology.perfect = is_perfect(topology);
    return topology;
  }
  std::vector<std::pair<std::uint32_t, std::uint32_t>> open{{0, 0}};  // wide nodes, and nodes
  while (!open.empty()) {
    const auto [wide, index] = open.back();
    open.pop_back();
    const WideNode& node = nodes[wide];
    const std::uint32_t first = add_children(topology, index, node.count);
    for (std::uint32_t lane = 0; lane < node.count; ++lane) {
      Box<double> box;
      const S* const rows = child_bounds + wide * lane_scalars(width) + lane;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        box.lower[axis] = rows[axis * width];
        box.upper[axis] = -rows[(axis + 3) * width];
      }
      boxes.push_back(box);
      if (lane < node.leaf_count)
        make_leaf(first + lane, node.first_leaf + lane);
      else
        open.emplace_back(node.first_child + lane - node.leaf_count, first + lane);
    }
  }
  topology.perfect = is_perfect(topology);
  return topology;
}

}  // namespace kbvh
