#pragma once
#include <cstdint>
#include <vector>

#include "core/topology/topology_edit.hpp"

namespace kbvh {

/// Exchanges two subtrees of a topology in place. With a child and a grandchild of one node this is a tree
/// rotation (Kopta et al. 2012). `swap` takes binary topologies and preserves all invariants of
/// `check_topology`: parents precede their children, and `parents` and `depths` are correct, so a reverse
/// sweep over the nodes is still bottom-up. `exchange` takes any width, and changes no ids but those of the
/// two places; parents may then have larger ids than their children.
///
/// The work of `swap` is proportional to the change: O(1) for the two nodes; their subtrees if their depth
/// changes; and the nodes that would otherwise precede their parents, which exchange ids among themselves
/// (the sibling pairs between the two places that are above one of them or below the other, Pearce & Kelly
/// 2007). Entries of leaves stay in place, so leaves are no longer in the order of their entries. `perfect`
/// is cleared, because positions of children are no longer implicit. `compacted` restores both.
///
/// The object only holds reusable memory: once warm, a swap allocates nothing.
class SubtreeSwap {
 public:
  /// Exchanges the subtrees at two nodes. Throws std::invalid_argument and changes nothing if the topology is
  /// wider than 2, an id is out of range, or one node equals the other or is above it.
  ///
  /// Clears `edit` first. `moved` then lists the new ids of moved contents, each id once: the contents of
  /// `from` before the call are at `to` after it, all moves simultaneous, and no id becomes free. `changed`
  /// lists the nodes with another child: the parents of the two places, after the call. Bounds change at
  /// these nodes and above.
  void swap(Topology& topology, std::uint32_t first, std::uint32_t second, TopologyEdit& edit);

  /// Rotates: exchanges a child of a node with a child of its sibling. Throws std::invalid_argument and
  /// changes nothing if the second is not a child of the first's sibling.
  void rotate(Topology& topology, std::uint32_t child, std::uint32_t grandchild, TopologyEdit& edit);

  /// Exchanges the subtrees at two nodes of a topology of any width; only their contents get other ids.
  /// Refuses what `swap` refuses, except the width, and unused ids. `edit` is as after `swap`. O(depth), and
  /// the two subtrees if their depth changes.
  void exchange(Topology& topology, std::uint32_t first, std::uint32_t second, TopologyEdit& edit);

  std::size_t bytes() const {
    return (below_.capacity() + open_.capacity()) * sizeof(std::uint32_t) + moves_.capacity() * sizeof(Move);
  }

 private:
  /// Two siblings that move to other ids.
  struct Move {
    std::uint32_t from, to, parent;
    std::uint8_t depth;
    TopologyNode nodes[2];
  };
  void exchange_contents(Topology& topology, std::uint32_t first, std::uint32_t second);
  void order(Topology& topology, std::uint32_t parent);
  const Move* move_of(std::uint32_t node) const;
  std::uint32_t moved_to(std::uint32_t node) const;

  std::vector<Move> moves_;           ///< by `from`
  std::vector<std::uint32_t> below_;  ///< first ids of pairs of siblings
  std::vector<std::uint32_t> open_;
};

}  // namespace kbvh
