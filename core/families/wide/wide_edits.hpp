#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/families/wide/height_order.hpp"
#include "core/families/wide/kernels/wide_layout.hpp"
#include "core/topology/topology_edit.hpp"

namespace kbvh {

/// The place of a topology node in a wide hierarchy.
struct WidePlace {
  static constexpr std::uint32_t none = ~std::uint32_t(0);
  std::uint32_t node = none, lane = 0;  ///< place in the parent; the root has none
  std::uint32_t wide = none;            ///< of inner nodes
};

/// The unique vertices of the leaves of a wide node, by lane.
using LeafLists = std::array<std::span<const std::uint32_t>, 8>;

/// The part of a wide hierarchy that only edits need: empty until the first edit. Released nodes and leaves
/// form linked lists through the arrays of the layout, one list per number of neighbours.
template <class S>
struct WideEdits {
  static constexpr std::uint32_t none = WidePlace::none;

  Topology start;  ///< as assigned
  TopologyEdit edit;
  HeightOrder order;
  std::vector<std::uint32_t> home;       ///< [leaf]: its node in `start`
  std::vector<std::uint16_t> list_room;  ///< [wide node]: largest length of its vertex lists in their place
  std::array<std::uint32_t, 9> free_nodes{}, free_leaves{};  ///< [count]: first of that many
  std::vector<std::uint32_t> free_lists;                     ///< [length]

  /// A node whose children were changed by the edit.
  struct Changed {
    std::uint32_t node = none;
    std::uint32_t first = 0;  ///< of its children in `children`; leaves come first
    std::uint32_t leaves = 0, inner = 0;
    WideNode layout{};  ///< before, and then after, the edit; without children if the node is new
  };
  struct Child {
    std::uint32_t node;
    std::uint32_t number;   ///< leaf or wide node, before and then after the edit; none before if new
    std::uint32_t carried;  ///< its place in `contents`, or none
    std::uint32_t first_entry, end_entry, home;  ///< of a leaf
    S bounds[6];                                 ///< as in a row
  };
  /// All stored data of a wide node that leaves its place.
  struct Content {
    WideNode node;
    std::uint32_t listed, rank, height;
    std::uint16_t list_room;
    S own[8];
    S rows[lane_scalars(8)];
  };
  struct Gone {
    WideNode node;
    std::uint16_t list_room;
  };
  // Of the last edit, or for temporary use.
  std::vector<Changed> changed;
  std::vector<Child> children;
  std::vector<Content> contents;
  std::vector<Gone> gone;
  std::vector<WidePlace> places;
  std::vector<std::uint32_t> nodes;
  std::vector<std::uint8_t> node_marks, wide_marks;  ///< all 0 between edits

  std::size_t bytes() const;
};

}  // namespace kbvh
