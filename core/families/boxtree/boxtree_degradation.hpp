#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "core/geometry/box.hpp"
#include "core/topology/topology.hpp"

namespace kbvh {

/// How far the parts of a BoxTree have degenerated, so that they can be rebuilt (the future work of Z&W
/// s.10). A box is cut by two planes per level only and keeps sides that were chosen for where its vertices
/// once were. Measure: the cost of a subtree is the summed surface area of its boxes over the area of its
/// root's box (the surface-area heuristic with all costs 1, indifferent to growth and to what happens above);
/// its degradation is this cost over what it was when the subtree was built, or last edited at its root.
/// Every call is O(nodes); no allocation but the first time, and where nodes are added.
///
/// Topologies are given with their nodes in an `order` that has parents before children.
class BoxTreeDegradation {
 public:
  /// Takes the tree as freshly built. `boxes(node)` is a box.
  template <class Boxes>
  void start(const Topology& topology, std::span<const std::uint32_t> order, const Boxes& boxes) {
    measure(topology, order, boxes);
    built_ = costs_;
    content_ = topology.nodes;
  }

  /// Nodes may have been added, moved and removed: those that have other children or primitives now are taken
  /// as freshly built.
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

  /// The highest nodes whose degradation exceeds the threshold, in order; no node lies below another.
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

  /// The nodes found last have been rebuilt: takes them and all below as freshly built.
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

  /// Of the last measurement: at least 1.
  double cost(std::uint32_t node) const { return costs_[node]; }
  std::size_t bytes() const {
    return (costs_.size() + built_.size()) * sizeof(double) + covered_.size() +
           content_.size() * sizeof(TopologyNode) + found_.capacity() * sizeof(std::uint32_t);
  }

 private:
  template <class Boxes>
  void measure(const Topology& topology, std::span<const std::uint32_t> order, const Boxes& boxes) {
    costs_.resize(topology.size());
    // Sums first, which a parent needs of its children, then quotients.
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
  std::vector<std::uint8_t> covered_;  ///< [node]: at or below a node that was found
  std::vector<std::uint32_t> found_;
  std::vector<TopologyNode> content_;  ///< [node]: what it was when built or edited
};

}  // namespace kbvh
