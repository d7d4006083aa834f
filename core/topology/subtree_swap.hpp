#pragma once
#include <cstdint>
#include <vector>

#include "core/topology/topology_edit.hpp"

namespace kbvh {

/// Exchanges two subtrees of a topology in place, of any width. With a child and a grandchild of one node
/// this is a tree rotation (Kopta et al. 2012). Only the contents of the two places get other ids; parents
/// may then have larger ids than their children. Entries of leaves stay in place, so leaves are no longer in
/// the order of their entries. `perfect` is cleared, because positions of children are no longer implicit.
/// `compacted` restores the order of both.
///
/// The object only holds reusable memory: once warm, an exchange allocates nothing.
class SubtreeSwap {
 public:
  /// Exchanges the subtrees at two nodes. Throws std::invalid_argument and changes nothing if an id is out of
  /// range or unused, or one node equals the other or is above it.
  ///
  /// Clears `edit` first. `moved` then lists the two moves, and `changed` the nodes with another child: the
  /// parents of the two places. Bounds change at these nodes and above. O(depth), and the two subtrees if
  /// their depth changes.
  void exchange(Topology& topology, std::uint32_t first, std::uint32_t second, TopologyEdit& edit);

  std::size_t bytes() const { return open_.capacity() * sizeof(std::uint32_t); }

 private:
  std::vector<std::uint32_t> open_;
};

}  // namespace kbvh
