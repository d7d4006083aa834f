#pragma once
#include <cstdint>
#include <vector>

#include "core/topology/topology_edit.hpp"

namespace kbvh {

/// Exchanges two subtrees of a binary topology in place; with a child and a grandchild of one node it is a
/// tree rotation (Kopta et al. 2012). All that `check_topology` checks is kept: parents precede their
/// children, and `parents` and `depths` are right, so a reverse sweep over the nodes is still bottom-up.
///
/// The work is in proportion to what changes: O(1) for the two nodes; their subtrees where they move to
/// another depth; and those nodes that would precede their parents otherwise, which exchange ids among
/// themselves (the pairs of siblings between the two places that are above the one or below the other, Pearce
/// & Kelly 2007). Entries of leaves stay where they are, so leaves are not in the order of their entries any
/// more, and `perfect` is taken back, since positions of children are not implicit any more; `compacted`
/// restores both.
///
/// The object only holds memory that is used again: once warm, a swap allocates nothing.
class SubtreeSwap {
 public:
  /// Exchanges the subtrees at two nodes. Throws std::invalid_argument, with nothing changed, if the topology
  /// is wider than 2, an id is out of range, or one node is the other or above it.
  ///
  /// `edit` is cleared before. `moved` then tells under which ids contents lie now, each id once: what lay at
  /// `from` before the call lies at `to` after it, all at once, and no id becomes free. `changed` has the
  /// nodes that got another child: the parents of the two places, after the call. Bounds change there and
  /// above.
  void swap(Topology& topology, std::uint32_t first, std::uint32_t second, TopologyEdit& edit);

  /// Rotates: the child of a node changes places with a child of its sibling. Throws std::invalid_argument,
  /// with nothing changed, if the second is not a child of the first's sibling.
  void rotate(Topology& topology, std::uint32_t child, std::uint32_t grandchild, TopologyEdit& edit);

  std::size_t bytes() const {
    return (below_.capacity() + open_.capacity()) * sizeof(std::uint32_t) + moves_.capacity() * sizeof(Move);
  }

 private:
  /// Two siblings on their way to other ids.
  struct Move {
    std::uint32_t from, to, parent;
    std::uint8_t depth;
    TopologyNode nodes[2];
  };
  void exchange(Topology& topology, std::uint32_t first, std::uint32_t second);
  void set_depths_below(Topology& topology, std::uint32_t node);
  void order(Topology& topology, std::uint32_t parent);
  const Move* move_of(std::uint32_t node) const;
  std::uint32_t moved_to(std::uint32_t node) const;

  std::vector<Move> moves_;           ///< by `from`
  std::vector<std::uint32_t> below_;  ///< first ids of pairs of siblings
  std::vector<std::uint32_t> open_;
};

}  // namespace kbvh
