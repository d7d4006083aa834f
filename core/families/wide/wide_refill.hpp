#pragma once
#include <cstddef>
#include <cstdint>
#include <vector>

namespace kbvh {

/// The part of a wide hierarchy that only exchanges of primitives between leaves need: empty until the first
/// exchange.
struct WideRefill {
  std::vector<std::uint32_t> start;      ///< primitives by entry of the topology, as assigned
  std::vector<std::uint32_t> leaf_node;  ///< [leaf]: its node of the topology
  std::vector<std::uint16_t> list_room;  ///< [wide node]: largest length of its vertex lists in their place
  /// Corners of every primitive; 0: the numbers differ, and all corners are listed again each time.
  std::uint32_t corners = 0;
  std::uint32_t most_vertices = 0;  ///< upper bound of a leaf's vertices
  // For temporary use.
  std::vector<std::uint32_t> seen;  ///< [vertex]: stamp of the last leaf that holds it
  std::uint32_t stamp = 0;
  std::vector<std::uint32_t> lists;  ///< unique vertices of the leaves of one wide node

  std::size_t bytes() const {
    return (start.capacity() + leaf_node.capacity() + seen.capacity() + lists.capacity()) *
               sizeof(std::uint32_t) +
           list_room.capacity() * sizeof(std::uint16_t);
  }
};

}  // namespace kbvh
