#pragma once
#include <cstddef>
#include <cstdint>

namespace kbvh {

/// One wide node: up to `width` children whose boxes lie side by side. Lanes [0, leaf_count) are leaves,
/// lanes [leaf_count, count) are nodes, the rest are empty. Children of each kind have consecutive numbers,
/// so the first number suffices. 16 bytes.
struct WideNode {
  std::uint32_t first_child = 0;  ///< wide node of lane `leaf_count`
  std::uint32_t first_leaf = 0;   ///< leaf of lane 0, counted over the whole hierarchy
  std::uint32_t list = 0;         ///< start of its leaves' vertices in `WideArrays::vertices`
  std::uint16_t length = 0;  ///< vertices per lane there: the lists of one node are padded to equal length
  std::uint8_t leaf_count = 0;
  std::uint8_t count = 0;
};
static_assert(sizeof(WideNode) == 16);

/// Raw pointers to a wide hierarchy, passed to kernels by value.
template <class S>
struct WideArrays {
  const WideNode* nodes;
  /// [node][6][width]: rows lower x, y, z, -upper x, y, z. Storing -upper makes a union one minimum per row.
  /// Empty lanes hold +infinity, which overlaps nothing.
  S* child_bounds;
  /// [node][8]: the node's own box as lower x, y, z, unused, upper x, y, z, unused.
  S* node_bounds;
  /// [list][length][width]: vertices of the leaves, times 3. Shorter lists, and lanes that are no leaves,
  /// repeat a vertex.
  const std::uint32_t* vertices;
};

/// A leaf, given by its parent node and its lane there.
struct LeafSlot {
  std::uint32_t word;
  [[gnu::always_inline]] static constexpr std::uint32_t of(std::uint32_t node, std::uint32_t lane) {
    return node * 8 + lane;
  }
  [[gnu::always_inline]] std::uint32_t node() const { return word / 8; }
  [[gnu::always_inline]] std::uint32_t lane() const { return word % 8; }
};

/// The two items of one step of a traversal: two nodes, a node and a leaf (bit 31 set: 8 * node + lane), or
/// two leaves.
struct WidePair {
  std::uint32_t first, second;
  static constexpr std::uint32_t leaf_bit = std::uint32_t(1) << 31;
};

/// Returns the place of a lane's vertex in a row of a list: lanes that share a register of two points are
/// neighbours, so that one load fetches both.
[[gnu::always_inline]] constexpr std::uint32_t list_place(std::uint32_t lane, std::uint32_t width) {
  return width < 8 ? lane : lane < 4 ? 2 * lane : 2 * lane - 7;
}

/// Returns the scalars per node in WideArrays::child_bounds.
[[gnu::always_inline]] constexpr std::size_t lane_scalars(std::uint32_t width) {
  return std::size_t(6) * width;
}

}  // namespace kbvh
