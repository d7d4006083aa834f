#include "core/topology/topology.hpp"

#include <algorithm>

namespace kbvh {

LeafVertices unique_leaf_vertices(const Topology& topology, const Primitives& primitives) {
  LeafVertices result;
  result.offsets.reserve(topology.nodes.size() + 1);
  result.offsets.push_back(0);
  for (const TopologyNode& node : topology.nodes) {
    const auto begin = std::ptrdiff_t(result.vertices.size());
    if (node.is_leaf()) {
      for (std::uint32_t i = 0; i < node.count(); ++i) {
        const auto vertices = primitives[topology.primitives[node.first() + i]];
        result.vertices.insert(result.vertices.end(), vertices.begin(), vertices.end());
      }
      std::sort(result.vertices.begin() + begin, result.vertices.end());
      result.vertices.erase(std::unique(result.vertices.begin() + begin, result.vertices.end()),
                            result.vertices.end());
    }
    result.offsets.push_back(std::uint32_t(result.vertices.size()));
  }
  return result;
}

void set_depths_below(Topology& topology, std::uint32_t node, std::vector<std::uint32_t>& open) {
  open.assign(1, node);
  while (!open.empty()) {
    const std::uint32_t parent = open.back();
    open.pop_back();
    const TopologyNode content = topology.nodes[parent];
    if (content.is_leaf()) continue;
    const auto depth = std::uint8_t(std::min(255, topology.depths[parent] + 1));
    for (std::uint32_t child = content.first(); child < content.first() + content.count(); ++child) {
      topology.depths[child] = depth;
      open.push_back(child);
    }
  }
}

namespace {
/// `ids`: number of primitive ids; `count`: number of `alive` ones.
template <class Alive>
std::string check(const Topology& topology, std::uint32_t ids, std::uint32_t count, const Alive& alive) {
  const std::size_t n = topology.nodes.size();
  if (n == 0) return count == 0 ? "" : "no nodes for " + std::to_string(count) + " primitives";
  if (topology.parents.size() != n || topology.depths.size() != n)
    return "parents or depths have a wrong size";
  if (topology.primitives.size() != count)
    return std::to_string(topology.primitives.size()) + " leaf entries for " + std::to_string(count) +
           " primitives";
  if (topology.width != 2 && topology.width != 4 && topology.width != 8)
    return "width " + std::to_string(topology.width);
  std::vector<std::uint8_t> seen_node(n, 0), seen_entry(count, 0), seen_primitive(ids, 0);
  if (topology.parents[0] != 0 || topology.depths[0] != 0) return "the root is not its own parent at depth 0";
  seen_node[0] = 1;
  std::uint32_t leaf_depth = 0;
  bool first_leaf = true, perfect = true;
  for (std::uint32_t i = 0; i < n; ++i) {
    const TopologyNode node = topology.nodes[i];
    const auto fault = [i](const std::string& what) { return "node " + std::to_string(i) + ": " + what; };
    if (!seen_node[i]) return fault("comes before its parent or has none");
    if (node.count() == 0) return fault("is empty");
    if (node.is_leaf()) {
      if (node.count() > topology.leaf_size)
        return fault(std::to_string(node.count()) + " primitives in a leaf");
      if (first_leaf) leaf_depth = topology.depths[i];
      first_leaf = false;
      perfect = perfect && topology.depths[i] == leaf_depth;
      for (std::uint32_t k = node.first(); k < node.first() + node.count(); ++k) {
        if (k >= count || seen_entry[k]++) return fault("leaf entry " + std::to_string(k) + " is shared");
        const std::uint32_t primitive = topology.primitives[k];
        if (primitive >= ids || !alive(primitive) || seen_primitive[primitive]++)
          return fault("primitive " + std::to_string(primitive) + " is in two leaves or does not exist");
      }
    } else {
      if (node.count() < 2 || node.count() > topology.width)
        return fault(std::to_string(node.count()) + " children");
      perfect = perfect && (i == 0 || node.count() == topology.width);
      for (std::uint32_t child = node.first(); child < node.first() + node.count(); ++child) {
        if (child <= i || child >= n) return fault("child " + std::to_string(child) + " does not follow it");
        if (seen_node[child]++) return fault("child " + std::to_string(child) + " has two parents");
        if (topology.parents[child] != i)
          return fault("is not recorded as parent of " + std::to_string(child));
        if (topology.depths[child] != std::min(255, topology.depths[i] + 1))
          return fault("wrong depth of child " + std::to_string(child));
      }
    }
  }
  if (topology.perfect && !perfect) return "declared perfect, but is not";
  return "";
}
}  // namespace

std::string check_topology(const Topology& topology, std::uint32_t primitive_count) {
  return check(topology, primitive_count, primitive_count, [](std::uint32_t) { return true; });
}

std::string check_topology(const Topology& topology, const Primitives& primitives) {
  return check(topology, primitives.count(), primitives.live_count(),
               [&](std::uint32_t p) { return primitives.alive(p); });
}

}  // namespace kbvh
