#pragma once
#include <algorithm>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "core/topology/topology.hpp"

namespace kbvh {

/// Appends `count` adjacent children to a node; returns the first.
inline std::uint32_t add_children(Topology& topology, std::uint32_t parent, std::uint32_t count) {
  const std::uint32_t first = topology.size();
  topology.nodes.resize(first + count);
  topology.parents.resize(first + count, parent);
  topology.depths.resize(first + count, std::uint8_t(std::min(255, topology.depths[parent] + 1)));
  topology.nodes[parent] = TopologyNode::inner(first, count);
  return first;
}

/// Returns a topology of one node, which is neither a leaf nor an inner node yet.
inline Topology with_root(std::uint32_t width, std::uint32_t leaf_size) {
  Topology topology;
  topology.width = width;
  topology.leaf_size = leaf_size;
  topology.nodes.resize(1);
  topology.parents.push_back(0);
  topology.depths.push_back(0);
  return topology;
}

/// Collapses a binary tree into nodes of up to `topology.width` children: a node takes the two children of
/// its binary node, then repeatedly replaces the heaviest inner child (the first of equals) by that child's
/// own two children, until it is full (Wald et al. 2008). Nodes are numbered depth first: those of a subtree
/// are contiguous, and leaves keep their order from left to right. `topology` comes from `with_root`.
/// `Binary` is copied and has
/// copied and has
///   children(node)   the two children, or {0, 0} for a leaf; node 0 is the root
///   weight(node)     of inner nodes
///   leaf(node)       called for each leaf in order; returns its TopologyNode
/// Returns the binary node of each node of `topology`. O(nodes x width).
template <class Binary>
std::vector<std::uint32_t> collapse_into(Topology& topology, Binary binary) {
  std::vector<std::uint32_t> sources{0}, open{0}, children;  // [node]; nodes; binary nodes
  const auto is_leaf = [&](std::uint32_t node) { return binary.children(node).first == 0; };
  while (!open.empty()) {
    const std::uint32_t index = open.back(), source = sources[index];
    open.pop_back();
    if (is_leaf(source)) {
      topology.nodes[index] = binary.leaf(source);
      continue;
    }
    const auto [left, right] = binary.children(source);
    children = {left, right};
    while (children.size() < topology.width) {
      std::size_t heaviest = children.size();
      for (std::size_t c = 0; c < children.size(); ++c)
        if (!is_leaf(children[c]) &&
            (heaviest == children.size() || binary.weight(children[c]) > binary.weight(children[heaviest])))
          heaviest = c;
      if (heaviest == children.size()) break;
      const auto [first, second] = binary.children(children[heaviest]);
      children[heaviest] = first;
      children.insert(children.begin() + std::ptrdiff_t(heaviest) + 1, second);
    }
    const std::uint32_t first = add_children(topology, index, std::uint32_t(children.size()));
    sources.insert(sources.end(), children.begin(), children.end());
    for (std::uint32_t child = topology.size(); child-- > first;) open.push_back(child);
  }
  return sources;
}

/// Returns the number of leaves below each node of a topology in built layout: weights for `collapsed`.
std::vector<double> leaves_below(const Topology& topology);

/// Collapses a binary topology, which may have been edited, into nodes of 4 or 8 children; `weights` (of its
/// nodes) are for example the surfaces of the boxes. Replaces `node_of` by the binary node of each node of
/// the result. Throws std::invalid_argument unless `binary` has width 2 and as many weights as nodes.
Topology collapsed(const Topology& binary, std::uint32_t width, std::span<const double> weights,
                   std::vector<std::uint32_t>& node_of);

}  // namespace kbvh
