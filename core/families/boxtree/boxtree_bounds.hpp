#pragma once
#include <array>
#include <bit>
#include <cstdint>
#include <numeric>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/contract/event_source.hpp"
#include "core/families/boxtree/boxtree.hpp"
#include "core/families/boxtree/boxtree_sides.hpp"
#include "core/families/events/certificate_slots.hpp"
#include "core/families/events/event.hpp"
#include "core/topology/topology_edit.hpp"

namespace kbvh {

/// What a BoxTree of one body stores: a binary tree of which every node but the root owns one side of its
/// box, or none, realised by a vertex, and inherits the others from its parent. The root owns all six sides.
/// As in the paper the left child of a node that is split on an axis owns an upper side on it, the right
/// child a lower one (the paper counts the two planes with the parent); other constructions let each child
/// own any side.
///
/// Bounds have places: 0 to 5 are the root's sides, node + 5 is the own side of any other node.
class BoxTreeBounds {
 public:
  /// Throws std::invalid_argument if the topology is not binary.
  BoxTreeBounds(Topology topology, const Primitives& primitives, std::uint32_t body, std::uint32_t first_slot)
      : topology_(std::move(topology)),
        leaves_(topology_, primitives),
        body_(body),
        slots_(first_slot, std::uint32_t(slot_count(topology_))),
        own_sides_(topology_.size(), 0),
        bounds_(slot_count(topology_)) {
    if (topology_.width != 2)
      throw std::invalid_argument("a BoxTree is binary, the topology's width is " +
                                  std::to_string(topology_.width));
  }

  static std::uint64_t slot_count(const Topology& topology) {
    return topology.empty() ? 0 : std::uint64_t(topology.size()) + 5;
  }
  std::uint32_t first_slot() const { return slots_.slot(0); }
  /// After insertions or deletions it is laid out as TopologyEditor says, with ids that mean nothing.
  const Topology& topology() const { return topology_; }
  /// Has it been edited since it was made?
  bool edited() const { return editor_.has_value(); }
  /// The topology as a builder lays it out: node i of it is node order[i] of the tree.
  Topology compacted_topology(std::vector<std::uint32_t>& order) const {
    if (editor_) return compacted(topology_, order);
    order.resize(topology_.size());
    std::iota(order.begin(), order.end(), 0u);
    return topology_;
  }
  /// Rises whenever the topology or the choice of own sides has changed.
  std::uint32_t version() const { return version_; }

  /// The node that a slot of the queue belongs to.
  std::uint32_t node_of(std::uint32_t slot) const { return node_at(slots_.place(slot)); }
  /// The one side that a node does not inherit, or `no_side`; not for the root, which inherits none.
  Side own_side(std::uint32_t node) const { return own_sides_[node]; }
  /// The vertex that realises a node's own side; any side of the root.
  std::uint32_t realiser(std::uint32_t node, Side side) const { return bounds_[place(node, side)].realiser; }
  std::uint32_t realiser(std::uint32_t node) const { return bounds_[node + 5].realiser; }
  /// The vertex that realises the bound at a place.
  std::uint32_t realiser_at(std::uint32_t place) const { return bounds_[place].realiser; }
  /// The vertex that realises a side of a node; `no_vertex` for a side that it inherits.
  std::uint32_t realiser_or_none(std::uint32_t node, Side side) const {
    return (sides_of(node) >> side & 1) != 0 ? realiser(node, side) : no_vertex;
  }
  /// Of a side that the node owns.
  std::uint32_t slot(std::uint32_t node, Side side) const { return slots_.slot(place(node, side)); }
  /// The node whose certificate has this node's realiser among its candidates; not of the root.
  std::uint32_t certificate_above(std::uint32_t node, Side side) const {
    do node = topology_.parents[node];
    while ((sides_of(node) >> side & 1) == 0);
    return node;
  }
  /// Of the root: [lower x, upper x, lower y, ...].
  std::array<std::uint32_t, 6> root_realisers() const {
    std::array<std::uint32_t, 6> all;
    for (std::uint32_t side = 0; side < 6; ++side) all[side] = bounds_[side].realiser;
    return all;
  }
  /// Unique, ascending; of a leaf.
  std::span<const std::uint32_t> leaf_vertices(std::uint32_t node) const {
    return leaves_[topology_.nodes[node]];
  }
  /// A node's box at the motion's time, as inherited. O(depth).
  template <class S>
  Box<S> box_of(std::uint32_t node, const SampledMotion<S>& motion) const {
    std::uint32_t realisers[6] = {}, open = all_sides;
    for (; open != 0; node = topology_.parents[node]) {
      const std::uint32_t here = open & sides_of(node);
      for (std::uint32_t sides = here; sides != 0; sides &= sides - 1) {
        const Side side = Side(std::countr_zero(sides));
        realisers[side] = realiser(node, side);
      }
      open &= ~here;
    }
    return box_of_realisers(realisers, motion, body_);
  }

 protected:
  /// All that an event reads of a bound. The candidates of its certificate, where they are listed, are the
  /// realisers of the bounds at the places [first, vertices) of the list, and its entries [vertices, last).
  struct Bound {
    std::uint32_t realiser = 0;
    std::uint32_t above = 0;  ///< the place whose certificate has this realiser among its candidates
    std::uint32_t first = 0, vertices = 0, last = 0;
  };
  static constexpr std::uint32_t all_sides = 0x3f;

  static std::uint32_t place(std::uint32_t node, Side side) { return node == 0 ? side : node + 5; }
  static std::uint32_t node_at(std::uint32_t place) { return place < 6 ? 0 : place - 5; }
  Side side_at(std::uint32_t place) const { return place < 6 ? place : own_sides_[place - 5]; }
  /// The sides that the node owns, one bit each.
  std::uint32_t sides_of(std::uint32_t node) const {
    return node == 0 ? all_sides : (1U << own_sides_[node]) & all_sides;
  }
  std::size_t stored_bytes() const {
    return topology_.bytes() + leaves_.bytes() + own_sides_.size() + slots_.bytes() +
           bounds_.size() * sizeof(Bound) + (editor_ ? editor_->bytes() : 0);
  }

  Topology topology_;
  BoxTreeLeaves leaves_;
  std::uint32_t body_;
  std::uint32_t version_ = 0;
  CertificateSlots slots_;
  std::vector<std::uint8_t> own_sides_;   ///< [node]
  std::vector<Bound> bounds_;             ///< [place]
  std::optional<TopologyEditor> editor_;  ///< made when geometry first changes
};

}  // namespace kbvh
