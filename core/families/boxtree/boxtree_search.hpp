#pragma once
#include <algorithm>
#include <cstdint>
#include <vector>

#include "core/families/boxtree/boxtree_leaves.hpp"
#include "core/families/events/event.hpp"
#include "core/topology/topology.hpp"

namespace kbvh {

/// What a kinetic BoxTree may be told otherwise: trees with forced axes (Z&W fig. 10), seeded faults.
struct BoxTreeRules {
  /// The axis on which every inner node of a depth is split; 3: the best for its children's boxes.
  static int split_axis(int /*depth*/) { return 3; }
  /// Does a certificate search of `sought` go down to a child whose own side is another? It must.
  static bool descends(Side /*own*/, Side /*sought*/) { return true; }
  /// Is a certificate looked at again when a change has replaced a realiser among its candidates? It must.
  static bool carries_up() { return true; }
};

/// What the certificate searches of a BoxTree cost since it was made or `forget` was called.
struct SearchCost {
  std::uint64_t searches = 0;
  std::uint64_t nodes = 0;       ///< nodes looked at by all of them
  std::uint64_t most_nodes = 0;  ///< by the dearest one
  void add(std::uint64_t visited) {
    ++searches;
    nodes += visited;
    most_nodes = std::max(most_nodes, visited);
  }
  void forget() { *this = {}; }
};

/// Finds the candidates of a BoxTree's certificates (Z&W figs. 8, 9): depth first, down to children with the
/// same own side, whose realisers answer for all below them, and to leaves, of which every vertex is one.
template <class Rules>
class CandidateSearch {
 public:
  explicit CandidateSearch(std::uint32_t vertex_count) : seen_(vertex_count, 0) {}
  /// Vertices may have been added.
  void resize(std::uint32_t vertex_count) { seen_.resize(vertex_count, 0); }

  /// Calls on_child(child) for every child with the same own side that the search of a node's certificate for
  /// one side meets, and on_vertex(vertex) for the vertices of the leaves that it meets, each once;
  /// `own_sides` [node]. Returns how many nodes were looked at, up to O(nodes).
  template <class OnChild, class OnVertex>
  std::uint64_t run(const Topology& topology, const BoxTreeLeaves& leaves, const std::uint8_t* own_sides,
                    std::uint32_t node, Side side, OnChild&& on_child, OnVertex&& on_vertex) {
    std::uint64_t visited = 0;
    if (++search_ == 0) {
      std::fill(seen_.begin(), seen_.end(), 0);
      search_ = 1;
    }
    open_.clear();
    open_.push_back(node);
    while (!open_.empty()) {
      const std::uint32_t at = open_.back();
      open_.pop_back();
      ++visited;
      const TopologyNode n = topology.nodes[at];
      if (n.is_leaf()) {
        for (std::uint32_t v : leaves[n])
          if (first_visit(v)) on_vertex(v);
        continue;
      }
      for (std::uint32_t child = n.first() + 2; child-- > n.first();)
        if (own_sides[child] == side) {
          ++visited;
          on_child(child);
        } else if (Rules::descends(own_sides[child], side)) {
          open_.push_back(child);
        }
    }
    return visited;
  }
  /// Within a search: was the vertex not met before? It is now.
  bool first_visit(std::uint32_t vertex) {
    if (seen_[vertex] == search_) return false;
    seen_[vertex] = search_;
    return true;
  }

  std::size_t bytes() const { return seen_.size() * sizeof(std::uint32_t); }

 private:
  std::vector<std::uint32_t> open_;
  std::vector<std::uint32_t> seen_;  ///< [vertex]: the last search that met it, for leaves share vertices
  std::uint32_t search_ = 0;
};

}  // namespace kbvh
