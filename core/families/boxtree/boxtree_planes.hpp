#pragma once
#include <algorithm>
#include <array>
#include <cstdint>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

#include "core/base/assert.hpp"
#include "core/geometry/box.hpp"
#include "core/topology/builders.hpp"
#include "core/topology/topology.hpp"

namespace kbvh {

/// The split axis of an inner node that is split on the axis with the best boxes.
inline constexpr int best_axis = 3;

/// Chooses the planes of a subtree. For each inner node, chooses the axis and the left child such that the
/// children's inherited boxes have the least summed area x primitives (the local surface-area cost). Of equal
/// areas the least summed edge length x primitives counts, then the first choice. Parents are cut before
/// children, because a child can only cut the box that its ancestors left.
template <class S>
class BoxTreePlanes {
 public:
  /// `nodes` lists a node and all nodes below it, ascending. The topology must have a builder's layout.
  BoxTreePlanes(const Topology& topology, std::span<const std::uint32_t> nodes)
      : topology_(&topology), nodes_(nodes), tight_(nodes.size()), weights_(nodes.size()) {}

  /// Sets the tight box of leaf nodes[i].
  void set_leaf(std::size_t i, const Box<S>& box) {
    tight_[i] = box;
    weights_[i] = topology_->nodes[nodes_[i]].count();
  }

  /// Sets own_sides[node] for all nodes but the first. The first node has the box `box`, or its tight box if
  /// null. axis(node) returns the split axis (0, 1, 2) of an inner node, or `best_axis`. O(nodes log nodes).
  template <class Axis>
  void choose(const Box<S>* box, Axis&& axis, std::vector<std::uint8_t>& own_sides) {
    for (std::size_t i = nodes_.size(); i-- > 0;) {
      if (topology_->nodes[nodes_[i]].is_leaf()) continue;
      for (std::size_t child : children(i)) {
        tight_[i].extend(tight_[child]);
        weights_[i] += weights_[child];
      }
    }
    inherited_.assign(nodes_.size(), {});
    inherited_[0] = box != nullptr ? *box : tight_[0];
    for (std::size_t i = 0; i < nodes_.size(); ++i)
      if (!topology_->nodes[nodes_[i]].is_leaf()) split(i, axis(nodes_[i]), own_sides);
  }

 private:
  std::array<std::size_t, 2> children(std::size_t i) const {
    const std::uint32_t first = topology_->nodes[nodes_[i]].first();
    const auto at = std::size_t(std::lower_bound(nodes_.begin(), nodes_.end(), first) - nodes_.begin());
    return {at, at + 1};
  }

  void split(std::size_t i, int forced, std::vector<std::uint8_t>& own_sides) {
    const auto pair = children(i);
    std::pair<double, double> best;
    bool found = false;
    const bool free = forced == best_axis;
    for (int axis = free ? 0 : forced; axis < (free ? 3 : forced + 1); ++axis)
      for (const std::size_t left : {0, 1}) {
        const std::array<Box<S>, 2> boxes =
            cut(inherited_[i], axis, tight_[pair[left]], tight_[pair[1 - left]]);
        const double weights[2] = {double(weights_[pair[left]]), double(weights_[pair[1 - left]])};
        const std::pair<double, double> cost{
            surface_area(boxes[0]) * weights[0] + surface_area(boxes[1]) * weights[1],
            edges(boxes[0]) * weights[0] + edges(boxes[1]) * weights[1]};
        if (found && !(cost < best)) continue;
        found = true;
        best = cost;
        inherited_[pair[left]] = boxes[0];
        inherited_[pair[1 - left]] = boxes[1];
        own_sides[nodes_[pair[left]]] = std::uint8_t(2 * axis + 1);
        own_sides[nodes_[pair[1 - left]]] = std::uint8_t(2 * axis);
      }
  }
  static std::array<Box<S>, 2> cut(const Box<S>& box, int axis, const Box<S>& left, const Box<S>& right) {
    std::array<Box<S>, 2> boxes{box, box};
    boxes[0].upper[axis] = left.upper[axis];
    boxes[1].lower[axis] = right.lower[axis];
    return boxes;
  }
  static double edges(const Box<S>& box) {
    double sum = 0;
    for (int axis = 0; axis < 3; ++axis) sum += double(box.upper[axis]) - double(box.lower[axis]);
    return sum;
  }

  const Topology* topology_;
  std::span<const std::uint32_t> nodes_;
  std::vector<Box<S>> tight_, inherited_;
  std::vector<std::uint32_t> weights_;  ///< number of primitives below
};

/// Returns a node and all nodes below it, parents before children. The topology may have any layout,
/// including that of edited ones.
inline std::vector<std::uint32_t> subtree_of(const Topology& topology, std::uint32_t top) {
  std::vector<std::uint32_t> ids{top};
  for (std::size_t i = 0; i < ids.size(); ++i)
    if (const TopologyNode n = topology.nodes[ids[i]]; !n.is_leaf())
      ids.insert(ids.end(), {n.first(), n.first() + 1});
  return ids;
}

/// Returns the own sides that BoxTreePlanes chooses for the nodes of a subtree, in the order of `ids`, which
/// `subtree_of` returned. The entry of the first node has no meaning. box_of(leaf) is a leaf's tight box.
/// `box` and axis(node) are those of BoxTreePlanes::choose.
template <class S, class BoxOf, class Axis>
std::vector<std::uint8_t> choose_own_sides(const Topology& topology, const std::vector<std::uint32_t>& ids,
                                           BoxOf&& box_of, const Box<S>* box, Axis&& axis) {
  // Copies the subtree to a topology in the layout that BoxTreePlanes needs.
  Topology part;
  std::vector<std::uint32_t> places(ids.size());
  std::iota(places.begin(), places.end(), 0u);
  std::uint32_t next = 1;
  for (const std::uint32_t id : ids) {
    const TopologyNode n = topology.nodes[id];
    part.nodes.push_back(n.is_leaf() ? n : TopologyNode::inner(next, 2));
    if (!n.is_leaf()) next += 2;
  }
  std::vector<std::uint8_t> own_sides(ids.size(), 0);
  BoxTreePlanes<S> planes(part, places);
  for (std::size_t i = ids.size(); i-- > 0;)
    if (part.nodes[i].is_leaf()) planes.set_leaf(i, box_of(part.nodes[i]));
  planes.choose(
      box, [&](std::uint32_t place) { return axis(ids[place]); }, own_sides);
  return own_sides;
}

/// Rebuilds the inner nodes of a subtree over its leaves. Leaves keep their content and change places. `ids`
/// lists the nodes of the subtree, the top first and the others ascending; `boxes` the boxes of its leaves in
/// that order.
template <class S>
void regrow_subtree(Topology& topology, std::span<const std::uint32_t> ids, std::span<const Box<S>> boxes,
                    BuildMethod method) {
  std::vector<TopologyNode> leaves;
  for (const std::uint32_t id : ids)
    if (const TopologyNode n = topology.nodes[id]; n.is_leaf()) leaves.push_back(n);
  const Topology made = build_topology<S>(boxes, {.method = method, .width = 2, .leaf_size = 1});
  KBVH_ASSERT(made.size() == ids.size());
  // Children are pairs of neighbours in both topologies. The renaming preserves the order, and thus these
  // pairs.
  for (std::uint32_t i = 0; i < made.size(); ++i) {
    const TopologyNode n = made.nodes[i];
    const std::uint32_t id = ids[i];
    topology.nodes[id] =
        n.is_leaf() ? leaves[made.primitives[n.first()]] : TopologyNode::inner(ids[n.first()], 2);
    if (i == 0) continue;
    topology.parents[id] = ids[made.parents[i]];
    topology.depths[id] = std::uint8_t(std::min(255, topology.depths[topology.parents[id]] + 1));
  }
  topology.perfect = false;
}

}  // namespace kbvh
