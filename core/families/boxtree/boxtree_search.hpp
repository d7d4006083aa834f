#pragma once
#include <algorithm>
#include <cstdint>
#include <vector>

#include "core/families/boxtree/boxtree_leaves.hpp"
#include "core/families/events/event.hpp"
#include "core/topology/topology.hpp"

namespace kbvh {

/// The cost of a BoxTree's certificate searches since construction or the last call of `forget`.
struct SearchCost {
  std::uint64_t searches = 0;
  std::uint64_t nodes = 0;       ///< nodes visited by all searches
  std::uint64_t most_nodes = 0;  ///< nodes visited by the most expensive search
  void add(std::uint64_t visited) {
    ++searches;
    nodes += visited;
    most_nodes = std::max(most_nodes, visited);
  }
  /// Adds the cost of the searches of another tree.
  void add(const SearchCost& other) {
    searches += other.searches;
    nodes += other.nodes;
    most_nodes = std::max(most_nodes, other.most_nodes);
  }
  void forget() { *this = {}; }
};

/// Finds the candidates of a BoxTree's certificates (Z&W figs. 8, 9). The search is depth first. It stops at
/// children with the same own side, whose realisers stand for all vertices below. At a leaf every vertex is a
/// candidate.
class CandidateSearch {
 public:
  explicit CandidateSearch(std::uint32_t vertex_count) : seen_(vertex_count, 0) {}
  /// Makes room for added vertices.
  void resize(std::uint32_t vertex_count) { seen_.resize(vertex_count, 0); }

  /// Searches the candidates of a node's certificate for one side. Calls on_child(child) for every child with
  /// the same own side that the search meets, and on_vertex(vertex) for the vertices of the leaves that it
  /// meets, each once. `own_sides` is [node]. Returns the number of visited nodes, up to O(nodes).
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
        } else {
          open_.push_back(child);
        }
    }
    return visited;
  }
  /// Marks a vertex as visited by the current search. Returns whether this was its first visit.
  bool first_visit(std::uint32_t vertex) {
    if (seen_[vertex] == search_) return false;
    seen_[vertex] = search_;
    return true;
  }

  std::size_t bytes() const { return seen_.size() * sizeof(std::uint32_t); }

 private:
  std::vector<std::uint32_t> open_;
  std::vector<std::uint32_t> seen_;  ///< [vertex]: last search that visited it; leaves may share vertices
  std::uint32_t search_ = 0;
};

}  // namespace kbvh
