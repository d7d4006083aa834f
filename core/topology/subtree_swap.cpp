#include "core/topology/subtree_swap.hpp"

#include <stdexcept>
#include <string>
#include <utility>

namespace kbvh {

namespace {
bool is_above(const Topology& topology, std::uint32_t upper, std::uint32_t node) {
  while (node != upper && node != 0) node = topology.parents[node];
  return node == upper;
}

std::invalid_argument refusal(std::uint32_t first, std::uint32_t second, const std::string& why) {
  return std::invalid_argument("cannot exchange nodes " + std::to_string(first) + " and " +
                               std::to_string(second) + ": " + why);
}
void check_places(const Topology& topology, std::uint32_t first, std::uint32_t second) {
  for (const std::uint32_t node : {first, second})
    if (node >= topology.size() || topology.parents[node] >= topology.size())
      throw refusal(first, second,
                    "node " + std::to_string(node) + " is none of " + std::to_string(topology.size()));
  if (is_above(topology, first, second) || is_above(topology, second, first))
    throw refusal(first, second, "one is the other or above it");
}
}  // namespace

void SubtreeSwap::exchange(Topology& topology, std::uint32_t first, std::uint32_t second,
                           TopologyEdit& edit) {
  check_places(topology, first, second);
  edit.clear();
  topology.perfect = false;
  std::swap(topology.nodes[first], topology.nodes[second]);
  for (const std::uint32_t node : {first, second}) {
    const TopologyNode content = topology.nodes[node];
    if (content.is_leaf()) continue;
    for (std::uint32_t c = content.first(); c < content.first() + content.count(); ++c)
      topology.parents[c] = node;
  }
  if (topology.depths[first] != topology.depths[second])
    for (const std::uint32_t node : {first, second}) set_depths_below(topology, node, open_);
  edit.moved.push_back({first, second});
  edit.moved.push_back({second, first});
  edit.changed.push_back(topology.parents[first]);
  if (topology.parents[second] != topology.parents[first]) edit.changed.push_back(topology.parents[second]);
}

}  // namespace kbvh
