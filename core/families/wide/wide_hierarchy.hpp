#pragma once
#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "core/base/assert.hpp"
#include "core/families/wide/kernels/wide_refit.hpp"
#include "core/families/wide/wide_edits.hpp"
#include "core/families/wide/wide_refill.hpp"
#include "core/families/wide/wide_tree.hpp"
#include "core/kernels/kernel_set.hpp"
#include "core/topology/topology.hpp"

namespace kbvh {

/// One body's hierarchy with stored boxes, laid out for refits and queries that process all children of a
/// node at once: structure of arrays per node, -upper instead of upper, the unique vertices of a node's
/// leaves in lists of equal length (core/families/wide/kernels/wide_layout.hpp). Any topology fits; perfect
/// ones are fastest.
///
/// The topology may be edited. Wide nodes then keep their numbers as far as possible, so parents may have
/// larger numbers than their children, and refits follow a list of nodes; without edits there is no list.
template <class S>
class WideHierarchy : public WideTree<S> {
 public:
  using WideTree<S>::empty;
  using WideTree<S>::leaf_count;
  using WideTree<S>::padded_leaf_size;

  // Compiled once, instead of with every strategy.
  WideHierarchy();
  ~WideHierarchy();
  WideHierarchy(const WideHierarchy&);
  WideHierarchy(WideHierarchy&&) noexcept;
  WideHierarchy& operator=(const WideHierarchy&);
  WideHierarchy& operator=(WideHierarchy&&) noexcept;

  /// Takes a topology over the primitives, in built layout; boxes are invalid until they are computed. Throws
  /// std::length_error beyond 2^28 nodes, 65,535 vertices in a leaf, or 2^32 entries of vertex lists.
  void assign(Topology topology, const Primitives& primitives, KernelSet kernels);

  /// Returns the topology. After edits, ids may be unused, and parents may have larger ids than their
  /// children.
  const Topology& topology() const { return topology_; }

  /// Edits the topology in place: change(topology, edit) changes it and lists the changes, as SubtreeSwap and
  /// TopologyEditor do. Leaves may move, but their primitives must stay the same. The layout follows: nodes
  /// with other children are rewritten, and subtrees that moved are not touched below their roots. O(width +
  /// greatest height) per changed node. Boxes move along; `refit_edited` or `refit` must compute those of
  /// changed nodes and all above. The first edit after `assign` is O(nodes). Allocates only if it needs more
  /// nodes, more leaves or longer lists of one size than ever before.
  template <class Change>
  void edit(Change&& change) {
    begin_edits();
    edits_.edit.clear();
    change(topology_, edits_.edit);
    follow_edit();
  }
  /// Recomputes the boxes of the nodes that the last edit changed, and of all nodes above them; all others
  /// must be current.
  void refit_edited(const S* positions);
  /// Returns whether the topology was edited since `assign`.
  bool edited() const { return edited_; }
  /// Gives the leaves other primitives, each leaf as many as before. `order` holds them by entry of the
  /// topology and is a permutation of the topology's primitives. Nodes stay unchanged. Boxes of changed
  /// leaves and above are invalid until they are computed. Returns the number of wide nodes with a changed
  /// leaf. O(primitives) to compare, and O(vertices) per changed leaf. Allocates at the first call after
  /// `assign`, and when a leaf has more vertices than ever before. Not allowed after edits; no edits are
  /// allowed afterwards.
  std::uint32_t refill(std::span<const std::uint32_t> order, const Primitives& primitives);
  /// Restores the topology of the last `assign`; boxes are invalid until they are computed. O(nodes).
  void undo_edits(const Primitives& primitives);
  /// Returns the topology in built layout; nodes[i] becomes the node of `topology` that corresponds to its
  /// node i.
  Topology built_topology(std::vector<std::uint32_t>& nodes) const;

  /// Recomputes every box from positions [vertex][3], children first. O(nodes + vertices of leaves).
  void refit(const S* positions) { refit_all(this->arrays(), positions); }
  /// Recomputes the boxes of the wide nodes [begin, end). Children must be current, or lie in the range and
  /// after their parents. (After edits, they need not lie after them, and nodes may be unused.)
  void refit_nodes(const S* positions, std::uint32_t begin, std::uint32_t end) {
    refit_(this->arrays(), positions, begin, end);
  }
  /// Refits into rows and node boxes stored elsewhere, in the layout of `arrays`.
  void refit_into(S* child_bounds, S* node_bounds, const S* positions) const {
    refit_all({nodes_.data(), child_bounds, node_bounds, vertices_.data()}, positions);
  }
  void refit_into(S* child_bounds, S* node_bounds, const S* positions, std::uint32_t begin,
                  std::uint32_t end) const {
    refit_({nodes_.data(), child_bounds, node_bounds, vertices_.data()}, positions, begin, end);
  }
  std::uint32_t node_count() const { return std::uint32_t(nodes_.size()); }
  /// Ranges of wide nodes that do not depend on each other, and the nodes above them, children first: work
  /// that threads can share. There are no ranges if this would not pay, or if the topology is not numbered
  /// depth first.
  struct Subtree {
    std::uint32_t begin, end;
  };
  const std::vector<Subtree>& subtrees() const { return subtrees_; }
  /// Returns whether there are ranges, and no edit has changed the order of the nodes.
  bool can_be_shared() const { return !subtrees_.empty() && !edited_; }
  const std::vector<std::uint32_t>& above_subtrees() const { return above_subtrees_; }
  /// Boxes and vertex lists as in WideArrays, to be moved to the memory of the threads that work on them.
  /// new_place makes uninitialised arrays; place copies the nodes [begin, end), and several threads may call
  /// it for different nodes; take_place replaces the arrays. Not after edits or refills.
  struct Placed {
    UnfilledArray<S> child_bounds, node_bounds;
    UnfilledArray<std::uint32_t> vertices;
  };
  Placed new_place() const;
  void place(Placed& to, std::uint32_t begin, std::uint32_t end) const;
  void take_place(Placed&& placed);

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
  /// Returns the unique vertices of a leaf, ascending; nothing for an inner node. Not after `refill`.
  std::span<const std::uint32_t> leaf_vertices(std::uint32_t node) const {
    KBVH_ASSERT(!refilled_);
    if (!edited_) return leaf_vertices_[node];
    if (!topology_.nodes[node].is_leaf()) return {};
    return leaf_vertices_[edits_.home[nodes_[places_[node].node].first_leaf + places_[node].lane]];
  }
  /// Returns the number of unique vertices of each leaf, summed over all leaves.
  std::size_t leaf_vertex_count() const { return listed_total_; }

  /// Returns the memory in bytes.
  std::size_t bytes() const;
  /// Returns the number of entries of the padded vertex lists.
  std::size_t listed_vertices() const { return vertices_.size(); }

 private:
  template <class>
  friend class WideFollower;
  using Place = WidePlace;
  static constexpr std::uint32_t none = WidePlace::none;
  void place_nodes();
  void find_subtrees();
  void list_vertices();
  void list_leaves(const Primitives& primitives);
  void check_node_count() const;
  /// Sets the length of a node's vertex lists, and the total number of their vertices.
  void measure_lists(std::uint32_t wide, const LeafLists& lists);
  /// Returns the place of new lists of one length for all lanes.
  std::uint32_t new_list(std::size_t length);
  void write_lists(std::uint32_t wide, const LeafLists& lists);
  void begin_refills(const Primitives& primitives);
  void list_refilled(std::uint32_t wide, const Primitives& primitives);
  void begin_edits();
  void follow_edit();
  void refit_all(const WideArrays<S>& arrays, const S* positions) const {
    if (edited_)
      refit_listed(arrays, positions, edits_.order.nodes());
    else
      refit_(arrays, positions, 0, node_count());
  }
  void refit_listed(const WideArrays<S>& arrays, const S* positions,
                    std::span<const std::uint32_t> nodes) const {
    wide_refit_kernels<S>(kernels_).listed(topology_.width)(arrays, positions, nodes.data(),
                                                            std::uint32_t(nodes.size()));
  }

  using WideTree<S>::kernels_;
  using WideTree<S>::nodes_;
  using WideTree<S>::child_bounds_;
  using WideTree<S>::node_bounds_;
  using WideTree<S>::vertices_;
  using WideTree<S>::first_entry_;
  using WideTree<S>::end_entry_;
  using WideTree<S>::first_corner_;
  using WideTree<S>::corners_;
  using WideTree<S>::primitives_;
  using WideTree<S>::stamps_;
  using WideTree<S>::fetched_;
  using WideTree<S>::rows_;
  using WideTree<S>::stamp_;

  Topology topology_;
  LeafVertices leaf_vertices_;  // by node of the topology as assigned
  typename WideRefitKernels<S>::Refit refit_ = nullptr;
  std::vector<Place> places_;          // of the topology's nodes
  std::vector<std::uint32_t> parent_;  // of wide nodes
  std::vector<std::uint32_t> listed_;  // of wide nodes: vertices of their leaves
  std::vector<Subtree> subtrees_;
  std::vector<std::uint32_t> above_subtrees_;
  std::size_t listed_total_ = 0;  // vertices of all leaves
  WideEdits<S> edits_;
  bool edited_ = false;
  WideRefill refill_;
  bool refilled_ = false;
};

extern template class WideHierarchy<float>;
extern template class WideHierarchy<double>;

}  // namespace kbvh
