#include "core/topology/collapse.hpp"

#include "core/base/assert.hpp"
#include "core/topology/topology_edit.hpp"

namespace kbvh {

std::vector<double> leaves_below(const Topology& topology) {
  std::vector<double> leaves(topology.size(), 0);
  for (std::uint32_t node = topology.size(); node-- > 0;) {
    const TopologyNode n = topology.nodes[node];
    if (n.is_leaf()) leaves[node] = 1;
    for (std::uint32_t i = 0; i < n.count() && !n.is_leaf(); ++i) leaves[node] += leaves[n.first() + i];
  }
  return leaves;
}

Topology collapsed(const Topology& binary, std::uint32_t width, std::span<const double> weights,
                   std::vector<std::uint32_t>& node_of) {
  if (binary.width != 2)
    throw std::invalid_argument("only binary topologies are collapsed; this one has width " +
                                std::to_string(binary.width));
  if (width != 4 && width != 8)
    throw std::invalid_argument("topologies are collapsed to width 4 or 8, not " + std::to_string(width));
  if (weights.size() != binary.size())
    throw std::invalid_argument(std::to_string(weights.size()) + " weights for " +
                                std::to_string(binary.size()) + " nodes");
  node_of.clear();
  if (binary.empty()) {
    Topology topology;
    topology.width = width;
    topology.leaf_size = binary.leaf_size;
    return topology;
  }
  Topology topology = with_root(width, binary.leaf_size);
  topology.primitives.reserve(binary.primitives.size());
  struct Source {
    const Topology* binary;
    std::span<const double> weights;
    std::vector<std::uint32_t>* primitives;
    std::pair<std::uint32_t, std::uint32_t> children(std::uint32_t node) const {
      const TopologyNode n = binary->nodes[node];
      KBVH_ASSERT(n.is_leaf() || n.count() == 2);
      return n.is_leaf() ? std::pair{0U, 0U} : std::pair{n.first(), n.first() + 1};
    }
    double weight(std::uint32_t node) const { return weights[node]; }
    TopologyNode leaf(std::uint32_t node) {
      const TopologyNode n = binary->nodes[node];
      const auto first = std::uint32_t(primitives->size());
      const auto entries = binary->primitives.begin() + n.first();
      primitives->insert(primitives->end(), entries, entries + n.count());
      return TopologyNode::leaf(first, n.count());
    }
  };
  node_of = collapse_into(topology, Source{&binary, weights, &topology.primitives});
  topology.perfect = is_perfect(topology);
  return topology;
}

}  // namespace kbvh
