#pragma once
#include <algorithm>
#include <cstdint>
#include <vector>

#include "core/topology/topology.hpp"

namespace kbvh::test {

/// Returns the vertices below each node, ascending, each once. The tree must know its topology and the
/// vertices of its leaves.
template <class Tree>
std::vector<std::vector<std::uint32_t>> vertices_below(const Tree& tree) {
  const Topology& topology = tree.topology();
  std::vector<std::vector<std::uint32_t>> below(topology.size());
  for (std::uint32_t node = topology.size(); node-- > 0;) {
    auto& here = below[node];
    if (topology.nodes[node].is_leaf()) {
      const auto leaf = tree.leaf_vertices(node);
      here.assign(leaf.begin(), leaf.end());
    }
    std::sort(here.begin(), here.end());
    here.erase(std::unique(here.begin(), here.end()), here.end());
    if (node == 0) continue;
    auto& above = below[topology.parents[node]];
    above.insert(above.end(), here.begin(), here.end());
  }
  return below;
}

}  // namespace kbvh::test
