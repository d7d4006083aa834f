#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "core/geometry/box.hpp"
#include "core/topology/topology.hpp"

namespace kbvh {

/// Measures how far the parts of a BoxTree have degenerated, so that they can be rebuilt (the future work of
/// Z&W s.10). A box is cut by only two planes per level, and its own sides were chosen for former positions
/// of its vertices. The cost of a subtree is the summed surface area of its boxes divided by the area of its
/// root's box (the surface-area heuristic with all costs 1, independent of scale and of the nodes above). The
/// degradation of a subtree is its cost divided by its cost when it was built, or when its root was last
/// edited. Every measuring call is O(nodes). Allocates only in the first call, and for added nodes.
///
/// `order` lists the nodes of the topology, parents before children.
class BoxTreeDegradation {
 public:
  /// Records the tree as freshly built. `boxes(node)` is the box of a node.
  template <class Boxes>
  void start(const Topology& topology, std::span<const std::uint32_t> order, const Boxes& boxes) {
    measure(topology, order, boxes);
    built_ = costs_;
    content_ = topology.nodes;
  }

  /// Follows an edit of the tree. Nodes with other children or primitives than before count as freshly built.
  template <class Boxes>
  void edited(const Topology& topology, std::span<const std::uint32_t> order, const Boxes& boxes) {
    measure(topology, order, boxes);
    built_.resize(topology.size());
    content_.resize(topology.size());
    for (const std::uint32_t node : order) {
      if (content_[node] == topology.nodes[node]) continue;
      content_[node] = topology.nodes[node];
      built_[node] = costs_[node];
    }
  }

  /// Returns the highest nodes whose degradation exceeds the threshold, in the order of `order`. No returned
  /// node lies below another.
  template <class Boxes>
  const std::vector<std::uint32_t>& beyond(double threshold, const Topology& topology,
                                           std::span<const std::uint32_t> order, const Boxes& boxes) {
    measure(topology, order, boxes);
    found_.clear();
    covered_.assign(topology.size(), 0);
    for (const std::uint32_t node : order) {
      covered_[node] = node != 0 && covered_[topology.parents[node]] != 0;
      if (covered_[node] != 0 || !(costs_[node] > threshold * built_[node])) continue;
      covered_[node] = 1;
      found_.push_back(node);
    }
    return found_;
  }

  /// Records the nodes that `beyond` returned last, and all nodes below them, as freshly built.
  template <class Boxes>
  void rebuilt(const Topology& topology, std::span<const std::uint32_t> order, const Boxes& boxes) {
    measure(topology, order, boxes);
    for (const std::uint32_t node : found_) built_[node] = costs_[node];
    std::fill(covered_.begin(), covered_.end(), std::uint8_t(0));
    for (const std::uint32_t node : found_) covered_[node] = 1;
    for (const std::uint32_t node : order) {
      if (node != 0 && covered_[topology.parents[node]] != 0) {
        covered_[node] = 1;
        built_[node] = costs_[node];
      }
      content_[node] = topology.nodes[node];
    }
  }

  /// Returns the cost of a node in the last measurement, at least 1.
  double cost(std::uint32_t node) const { return costs_[node]; }
  std::size_t bytes() const {
    return (costs_.size() + built_.size()) * sizeof(double) + covered_.size() +
           content_.size() * sizeof(TopologyNode) + found_.capacity() * sizeof(std::uint32_t);
  }

 private:
  template <class Boxes>
  void measure(const Topology& topology, std::span<const std::uint32_t> order, const Boxes& boxes) {
    costs_.resize(topology.size());
    // Sums first, because a parent needs the sums of its children; then quotients.
    for (std::size_t i = order.size(); i-- > 0;) {
      const std::uint32_t node = order[i];
      const TopologyNode n = topology.nodes[node];
      costs_[node] = surface_area(boxes(node));
      if (!n.is_leaf())
        for (std::uint32_t child = n.first(); child < n.first() + n.count(); ++child)
          costs_[node] += costs_[child];
    }
    for (const std::uint32_t node : order) {
      const double area = surface_area(boxes(node));
      costs_[node] = area > 0 ? costs_[node] / area : 1;
    }
  }

  std::vector<double> costs_, built_;  ///< [node]
  std::vector<std::uint8_t> covered_;  ///< [node]: at or below a node in found_
  std::vector<std::uint32_t> found_;
  std::vector<TopologyNode> content_;  ///< [node]: children or primitives when built or edited
};

}  // namespace kbvh
