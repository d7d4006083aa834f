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

/// The stored data of a BoxTree of one body. The tree is binary. Each node except the root owns one side of
/// its box, or none; a vertex realises that side, and the node inherits the other sides from its parent. The
/// root owns all six sides. As in the paper, the left child of a node that is split on an axis owns an upper
/// side on that axis, and the right child a lower side (the paper counts both planes with the parent). Other
/// constructions let each child own any side.
///
/// Bounds are numbered by place: places 0 to 5 are the root's sides; place node + 5 is the own side of any
/// other node.
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
  /// Returns the topology. After insertions or deletions its layout is that of TopologyEditor, with ids in no
  /// particular order.
  const Topology& topology() const { return topology_; }
  /// Returns whether the topology has been edited since construction.
  bool edited() const { return editor_.has_value(); }
  /// Returns the topology in a builder's layout: node i of the result is node order[i] of the tree.
  Topology compacted_topology(std::vector<std::uint32_t>& order) const {
    if (editor_) return compacted(topology_, order);
    order.resize(topology_.size());
    std::iota(order.begin(), order.end(), 0u);
    return topology_;
  }
  /// Returns a number that rises with every change of the topology or of the own sides.
  std::uint32_t version() const { return version_; }

  /// Returns the node to which a slot of the queue belongs.
  std::uint32_t node_of(std::uint32_t slot) const { return node_at(slots_.place(slot)); }
  /// Returns the side that a node does not inherit, or `no_side`. Not valid for the root, which inherits
  /// none.
  Side own_side(std::uint32_t node) const { return own_sides_[node]; }
  /// Returns the vertex that realises a node's own side, or any side of the root.
  std::uint32_t realiser(std::uint32_t node, Side side) const { return bounds_[place(node, side)].realiser; }
  std::uint32_t realiser(std::uint32_t node) const { return bounds_[node + 5].realiser; }
  /// Returns the vertex that realises the bound at a place.
  std::uint32_t realiser_at(std::uint32_t place) const { return bounds_[place].realiser; }
  /// Returns the vertex that realises a side of a node, or `no_vertex` for an inherited side.
  std::uint32_t realiser_or_none(std::uint32_t node, Side side) const {
    return (sides_of(node) >> side & 1) != 0 ? realiser(node, side) : no_vertex;
  }
  /// Returns the queue slot of a side that the node owns.
  std::uint32_t slot(std::uint32_t node, Side side) const { return slots_.slot(place(node, side)); }
  /// Returns the node whose certificate has this node's realiser as a candidate. Not valid for the root.
  std::uint32_t certificate_above(std::uint32_t node, Side side) const {
    do node = topology_.parents[node];
    while ((sides_of(node) >> side & 1) == 0);
    return node;
  }
  /// Returns the realisers of the root: [lower x, upper x, lower y, ...].
  std::array<std::uint32_t, 6> root_realisers() const {
    std::array<std::uint32_t, 6> all;
    for (std::uint32_t side = 0; side < 6; ++side) all[side] = bounds_[side].realiser;
    return all;
  }
  /// Returns the vertices of a leaf, unique and ascending.
  std::span<const std::uint32_t> leaf_vertices(std::uint32_t node) const {
    return leaves_[topology_.nodes[node]];
  }
  /// Returns a node's inherited box at the motion's time. O(depth).
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
  /// The data of a bound that an event reads. Where candidates are listed, those of the bound's certificate
  /// are the realisers of the bounds at the places in entries [first, vertices) of the list, and the vertices
  /// in its entries [vertices, last).
  struct Bound {
    std::uint32_t realiser = 0;
    std::uint32_t above = 0;  ///< place whose certificate has this realiser as a candidate
    std::uint32_t first = 0, vertices = 0, last = 0;
  };
  static constexpr std::uint32_t all_sides = 0x3f;

  static std::uint32_t place(std::uint32_t node, Side side) { return node == 0 ? side : node + 5; }
  static std::uint32_t node_at(std::uint32_t place) { return place < 6 ? 0 : place - 5; }
  Side side_at(std::uint32_t place) const { return place < 6 ? place : own_sides_[place - 5]; }
  /// Returns the sides that the node owns, one bit each.
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
  std::optional<TopologyEditor> editor_;  ///< made at the first change of geometry
};

}  // namespace kbvh
