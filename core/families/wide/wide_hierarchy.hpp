#pragma once
#include <boost/align/aligned_allocator.hpp>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <vector>

#include "core/base/counters.hpp"
#include "core/families/wide/kernels/wide_linear.hpp"
#include "core/families/wide/kernels/wide_overlap.hpp"
#include "core/families/wide/kernels/wide_refit.hpp"
#include "core/kernels/kernel_set.hpp"
#include "core/scene/motion_view.hpp"
#include "core/scene/pairs.hpp"
#include "core/topology/topology.hpp"
#include "core/topology/traversal.hpp"

namespace kbvh {

/// An array that starts on a cache line.
template <class T>
using AlignedArray = std::vector<T, boost::alignment::aligned_allocator<T, 64>>;

/// One body's hierarchy with stored boxes, laid out for refits and queries that process all children of a
/// node at once: structure of arrays per node, -upper instead of upper, the unique vertices of a node's
/// leaves in lists of equal length (core/families/wide/kernels/wide_layout.hpp). Any topology fits; perfect
/// ones are fastest.
template <class S>
class WideHierarchy {
 public:
  /// Takes a topology over the primitives; boxes are invalid until they are computed. Only this function
  /// allocates. Throws std::length_error beyond 2^28 nodes, 65,535 vertices in a leaf, or 2^32 entries of
  /// vertex lists.
  void assign(Topology topology, const Primitives& primitives, KernelSet kernels);

  const Topology& topology() const { return topology_; }
  bool empty() const { return topology_.empty(); }

  /// Recomputes every box from positions [vertex][3], children first. O(nodes + vertices of leaves).
  void refit(const S* positions) { refit_nodes(positions, 0, node_count()); }
  /// Recomputes the boxes of the wide nodes [begin, end); children must be current or in the range.
  void refit_nodes(const S* positions, std::uint32_t begin, std::uint32_t end) {
    refit_(arrays(), positions, begin, end);
  }
  /// Refits into rows and node boxes stored elsewhere, in the layout of `arrays`.
  void refit_into(S* child_bounds, S* node_bounds, const S* positions) const {
    refit_into(child_bounds, node_bounds, positions, 0, node_count());
  }
  void refit_into(S* child_bounds, S* node_bounds, const S* positions, std::uint32_t begin,
                  std::uint32_t end) const {
    refit_({nodes_.data(), child_bounds, node_bounds, vertices_.data()}, positions, begin, end);
  }
  std::uint32_t node_count() const { return std::uint32_t(nodes_.size()); }
  /// Ranges of wide nodes that do not depend on each other, and the nodes above them, children first: work
  /// that threads can share. No ranges where this would not pay, or where the topology is not numbered depth
  /// first.
  struct Subtree {
    std::uint32_t begin, end;
  };
  const std::vector<Subtree>& subtrees() const { return subtrees_; }
  const std::vector<std::uint32_t>& above_subtrees() const { return above_subtrees_; }

  static constexpr std::uint32_t no_node = ~std::uint32_t(0);
  /// Returns the wide node of an inner node of the topology; `no_node` for a leaf.
  std::uint32_t wide_node(std::uint32_t node) const { return places_[node].wide; }
  /// Returns the wide node that holds the box of a node of the topology; `no_node` for a root that is not a
  /// leaf.
  std::uint32_t wide_parent(std::uint32_t node) const { return places_[node].node; }
  /// Returns the index of a bound of a topology node in arrays with the layout of `WideArrays::child_bounds`,
  /// rows in the order given there; not for a root that is not a leaf.
  std::size_t row_place(std::uint32_t node, std::uint32_t row) const {
    return places_[node].node * lane_scalars(topology_.width) + row * topology_.width + places_[node].lane;
  }
  /// Returns the number of unique vertices of each leaf of one wide node, summed over its leaves.
  std::uint32_t leaf_vertices_of(std::uint32_t wide) const { return listed_[wide]; }

  /// Returns the box of a node of the topology.
  Box<S> box(std::uint32_t node) const { return box_in(child_bounds_.data(), node_bounds_.data(), node); }
  /// Returns the same from rows and node boxes written by `refit_into`.
  Box<S> box_in(const S* child_bounds, const S* node_bounds, std::uint32_t node) const;
  void set_box(std::uint32_t node, const Box<S>& box);
  /// Returns the unique vertices of a leaf, ascending; nothing for an inner node.
  std::span<const std::uint32_t> leaf_vertices(std::uint32_t node) const { return leaf_vertices_[node]; }
  std::size_t leaf_vertex_count() const { return leaf_vertices_.vertices.size(); }

  /// Invalidates the boxes of primitives, because positions changed; queries recompute them on demand.
  void positions_changed() {
    if (++stamp_ == 0) {
      std::fill(stamps_.begin(), stamps_.end(), 0);
      std::fill(fetched_.begin(), fetched_.end(), 0);
      stamp_ = 1;
    }
  }

  WideArrays<S> arrays() {
    return {nodes_.data(), child_bounds_.data(), node_bounds_.data(), vertices_.data()};
  }
  WideLeaves<S> leaves(const S* positions) {
    return {leaf_lists(), rows_.data(), stamps_.data(), stamp_, positions};
  }
  WideLeafLists leaf_lists() const {
    return {first_entry_.data(), first_corner_.data(), corners_.data(), primitives_.data()};
  }
  std::uint32_t leaf_count() const { return std::uint32_t(stamps_.size()); }
  /// Returns true at the first call since `positions_changed` for a leaf, numbered as by
  /// `WideNode::first_leaf`.
  bool to_be_fetched(std::uint32_t leaf) {
    const bool first = fetched_[leaf] != stamp_;
    fetched_[leaf] = stamp_;
    return first;
  }
  std::uint32_t leaf_number(LeafSlot slot) const { return nodes_[slot.node()].first_leaf + slot.lane(); }
  std::span<const std::uint32_t> leaf_primitives(std::uint32_t leaf) const {
    return {primitives_.data() + first_entry_[leaf], primitives_.data() + first_entry_[leaf + 1]};
  }
  /// Returns the number of lanes for the primitives of a leaf in a query; 1: the leaf's box is that of its
  /// primitive.
  std::uint32_t padded_leaf_size() const {
    return topology_.leaf_size == 1 ? 1 : topology_.leaf_size <= 4 ? 4 : topology_.leaf_size <= 8 ? 8 : 16;
  }
  KernelSet kernels() const { return kernels_; }
  /// Returns whether one query can take both hierarchies.
  bool suits(const WideHierarchy& other) const {
    return empty() || other.empty() ||
           (topology_.width == other.topology_.width && padded_leaf_size() == other.padded_leaf_size());
  }

  /// Returns the memory in bytes.
  std::size_t bytes() const;
  /// Returns the number of entries of the padded vertex lists.
  std::size_t listed_vertices() const { return vertices_.size(); }

 private:
  struct Place {
    std::uint32_t node = none, lane = 0;  // place in the parent; the root has none
    std::uint32_t wide = none;            // of inner nodes
  };
  static constexpr std::uint32_t none = ~std::uint32_t(0);
  void place_nodes();
  void find_subtrees();
  void list_vertices();
  void list_leaves(const Primitives& primitives);

  Topology topology_;
  LeafVertices leaf_vertices_;
  KernelSet kernels_ = KernelSet::portable;
  typename WideRefitKernels<S>::Refit refit_ = nullptr;
  std::vector<Place> places_;          // of the topology's nodes
  std::vector<std::uint32_t> parent_;  // of wide nodes
  std::vector<std::uint32_t> listed_;  // of wide nodes: vertices of their leaves
  std::vector<Subtree> subtrees_;
  std::vector<std::uint32_t> above_subtrees_;
  AlignedArray<WideNode> nodes_;
  AlignedArray<S> child_bounds_, node_bounds_;
  AlignedArray<std::uint32_t> vertices_;
  std::vector<std::uint32_t> first_entry_, first_corner_, corners_, primitives_, stamps_, fetched_;
  AlignedArray<S> rows_;
  std::uint32_t stamp_ = 1;
};

/// Queries two wide hierarchies; keeps its buffers from frame to frame.
template <class S>
class WideQuery {
 public:
  /// Appends the pairs of primitives whose boxes, and those of all nodes above them, overlap. Both
  /// hierarchies need the same width and leaf size. If both bodies are the same, the hierarchies must be the
  /// same, too; the result is the pairs within the body, without those that share a vertex. Returns the work
  /// that the budget left undone; adds the box tests made to `tests`.
  QueryStatus run(WideHierarchy<S>& a, std::uint32_t body_a, WideHierarchy<S>& b, std::uint32_t body_b,
                  const SceneView<S>& scene, const SampledMotion<S>& motion, const Budget& budget,
                  PairBuffer& out, std::uint64_t& tests);

  /// Queries hierarchies over primitives and positions that are not a scene's, and keeps pairs that share a
  /// vertex.
  void run_over(WideHierarchy<S>& a, std::uint32_t body_a, const S* positions_a, WideHierarchy<S>& b,
                std::uint32_t body_b, const S* positions_b, PairBuffer& out, std::uint64_t& tests);

  /// Queries the boxes of one moment of a segment in which they are linear in time: boxes that the query
  /// reads are computed from the moments' ends, into the hierarchies. The caller marks all nodes as stale
  /// first.
  QueryStatus run_at(WideHierarchy<S>& a, const WideMoment<S>& moment_a, std::uint32_t body_a,
                     WideHierarchy<S>& b, const WideMoment<S>& moment_b, std::uint32_t body_b,
                     const SceneView<S>& scene, const SampledMotion<S>& motion, const Budget& budget,
                     PairBuffer& out, std::uint64_t& tests);

  /// One side of a lazy query: `stale[wide node]` is not 0 while the boxes of the node's children are not
  /// current. The boxes of the roots must be current.
  struct LazySide {
    WideHierarchy<S>* hierarchy;
    std::uint32_t body;
    const std::uint8_t* stale;
  };
  /// Wide nodes whose boxes a lazy query waits for; `none`: no wait on that side.
  struct Wanted {
    static constexpr std::uint32_t none = ~std::uint32_t(0);
    std::uint32_t first = none, second = none;
    explicit operator bool() const { return first != none || second != none; }
  };
  /// Starts the same query for hierarchies whose boxes are computed at their first use:
  ///   query.start_lazy(a, b, budget);
  ///   while (const auto wanted = query.step(a, b, scene, motion, out, tests))
  ///     compute the boxes of their children, and clear the marks
  /// The query reads no marked box. It costs `run` nothing, because it uses a separate traversal.
  void start_lazy(const LazySide& a, const LazySide& b, const Budget& budget);
  Wanted step(const LazySide& a, const LazySide& b, const SceneView<S>& scene, const SampledMotion<S>& motion,
              PairBuffer& out, std::uint64_t& tests);
  /// Returns the work that the budget left undone, once `step` waits for nothing.
  QueryStatus lazy_status() const { return {lazy_.depth}; }

  /// Returns the memory of the buffers in bytes.
  std::size_t bytes() const {
    return stack_.capacity() * sizeof(WidePair) + leaf_pairs_.capacity() * sizeof(LeafSlot) +
           chunk_.capacity() * sizeof(FoundPair) + to_fetch_.capacity() * sizeof(std::uint32_t);
  }

 private:
  /// Returns an empty traversal in this query's buffers.
  WideTraversal fresh_traversal(const Budget& budget);
  void grow(WideTraversal& state);
  /// Traverses and processes the found pairs until nothing is left or the budget is used up.
  template <class Traverse, class Take>
  QueryStatus complete(WideTraversal& state, const Traverse& traverse, const Take& take,
                       std::uint64_t& tests);
  void leaves_to_pairs(WideHierarchy<S>& a, std::uint32_t body_a, WideHierarchy<S>& b, std::uint32_t body_b,
                       const SceneView<S>& scene, const SampledMotion<S>& motion, std::size_t count,
                       PairBuffer& out, std::uint64_t& tests);
  void fetch_leaves(WideHierarchy<S>& h, std::uint32_t body, std::size_t side, std::size_t count,
                    const SceneView<S>& scene, const SampledMotion<S>& motion);
  /// Leaves out pairs within one body that share a vertex, unless `neighbours` is null.
  void leaves_to_pairs(WideHierarchy<S>& a, std::uint32_t body_a, const S* positions_a, WideHierarchy<S>& b,
                       std::uint32_t body_b, const S* positions_b, const Primitives* neighbours,
                       std::size_t count, PairBuffer& out, std::uint64_t& tests);
  void append_pairs(WideHierarchy<S>& a, std::uint32_t body_a, const S* positions_a, WideHierarchy<S>& b,
                    std::uint32_t body_b, const S* positions_b, std::size_t begin, std::size_t end,
                    PairBuffer& out, std::uint64_t& tests);
  std::vector<WidePair> stack_;
  std::vector<LeafSlot> leaf_pairs_;
  std::vector<FoundPair> chunk_;
  std::vector<std::uint32_t> to_fetch_;
  WideTraversal lazy_{};
};

/// Checks that queries of two bodies have one layout: throws std::invalid_argument unless, for each pair of
/// bodies, the hierarchies hierarchy_of(body) have one width and leaf size.
template <class HierarchyOf>
void check_layouts(std::span<const BodyPair> pairs, HierarchyOf&& hierarchy_of) {
  for (const BodyPair& pair : pairs)
    if (!hierarchy_of(pair.first).suits(hierarchy_of(pair.second)))
      throw std::invalid_argument("topologies of all bodies need one width and leaf size");
}

extern template class WideHierarchy<float>;
extern template class WideHierarchy<double>;
extern template class WideQuery<float>;
extern template class WideQuery<double>;

}  // namespace kbvh
