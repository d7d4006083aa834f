#pragma once
#include <cstdint>
#include <vector>

#include "core/families/wide/lazy_query.hpp"
#include "core/families/wide/near_bodies.hpp"
#include "core/families/wide/realiser_rows.hpp"

namespace kbvh {

/// The boxes of a kinetic AABB tree of one body, in the rows of a wide hierarchy, computed on demand from the
/// realisers. Binary trees are collapsed into nodes of eight children; wider trees keep their nodes.
template <class S>
class KineticRows {
 public:
  /// Lays out the rows for a tree, after construction and changes of its topology. O(nodes).
  template <class Tree>
  void follow(const Tree& tree, const Primitives& primitives) {
    std::vector<std::uint32_t> order;
    lay_out(tree.compacted_topology(order), order, primitives);
  }

  RealiserRows<S>& rows() { return rows_; }
  const WideHierarchy<S>& hierarchy() const { return rows_.hierarchy(); }

  /// Returns the slot of a leaf of the tree.
  LeafSlot leaf_slot(std::uint32_t leaf) const { return slots_[leaf]; }

  /// Computes boxes as RealiserRows does. Returns the same.
  template <class Tree>
  std::uint64_t make_visited(const Tree& tree, const SampledMotion<S>& motion, std::uint32_t body) {
    return rows_.make_visited(motion, body, places_of(tree));
  }
  template <class Tree>
  std::uint64_t make_wanted(std::uint32_t node, const Tree& tree, const SampledMotion<S>& motion,
                            std::uint32_t body) {
    return rows_.make_wanted(node, motion, body, places_of(tree));
  }

  /// Returns the box of a node of the tree, stored in `room`, if a query may have read it. Returns null
  /// otherwise.
  const Box<S>* read_box(std::uint32_t node, Box<S>& room) const;

  std::size_t bytes() const {
    return rows_.bytes() +
           (lane_nodes_.capacity() + wide_of_.capacity() + slots_.capacity()) * sizeof(std::uint32_t);
  }

 private:
  void lay_out(Topology topology, const std::vector<std::uint32_t>& order, const Primitives& primitives);

  /// Returns a callable for RealiserRows.
  template <class Tree>
  auto places_of(const Tree& tree) const {
    const std::uint32_t width = hierarchy().topology().width;
    return [this, &tree, width](std::uint32_t node, std::uint32_t* room) {
      const std::uint32_t* lanes = lane_nodes_.data() + std::size_t(node) * width;
      for (std::uint32_t lane = 0; lane < width; ++lane) {
        const std::uint32_t* realisers = tree.realisers(lanes[lane]);
        for (std::uint32_t axis = 0; axis < 3; ++axis) {
          room[axis * width + lane] = 3 * realisers[2 * axis] + axis;
          room[(3 + axis) * width + lane] = 3 * realisers[2 * axis + 1] + axis;
        }
      }
      return room;
    };
  }

  RealiserRows<S> rows_;
  std::vector<std::uint32_t> lane_nodes_;  ///< [wide node][width]: nodes of the tree; the root in empty lanes
  std::vector<std::uint32_t> wide_of_;     ///< by node of the tree: node of the wide topology, or none
  std::vector<LeafSlot> slots_;            ///< by node of the tree, of leaves
};

extern template class KineticRows<float>;
extern template class KineticRows<double>;

/// Queries of the kinetic AABB trees of all bodies of a scene, through their rows.
template <class S>
class KineticRowsQuery {
 public:
  KineticRowsQuery(const SceneView<S>& scene, const SampledMotion<S>& motion) : query_(scene, motion) {}

  /// Lays out the rows of all trees. Throws std::invalid_argument if trees of a pair of bodies have different
  /// widths or leaf sizes.
  template <class Forest>
  void assign(const Forest& forest, const SceneView<S>& scene) {
    rows_.resize(scene.body_count());
    for (std::uint32_t body = 0; body < rows_.size(); ++body) follow(forest, scene, body);
    check_layouts(
        scene.pairs(), [&](std::uint32_t body) -> const auto& { return rows_[body].hierarchy(); });
  }
  /// Lays out the rows of one body again, after a change of its tree. O(nodes).
  template <class Forest>
  void follow(const Forest& forest, const SceneView<S>& scene, std::uint32_t body) {
    rows_[body].follow(forest.tree(body), scene.primitives(body));
    plans_changed(body);
  }
  void start_over() {
    for (auto& rows : rows_) rows.rows().start_over();
  }
  void plans_changed(std::uint32_t body) { rows_[body].rows().plans_changed(); }
  void new_frame(const SegmentMotion<S>& motion) {
    for (std::uint32_t body = 0; body < rows_.size(); ++body) rows_[body].rows().new_frame(motion, body);
  }

  /// Appends the candidates of the current frame. Adds the number of box tests to `tests`, and the number of
  /// positions read without being fetched to `reads`.
  template <class Forest>
  QueryStatus find(const Forest& forest, NearBodies& near_bodies, const SceneView<S>& scene,
                   const SampledMotion<S>& motion, const Budget& budget, PairBuffer& out,
                   std::uint64_t& tests, std::uint64_t& reads) {
    for (std::uint32_t body = 0; body < rows_.size(); ++body)
      reads += rows_[body].make_visited(forest.tree(body), motion, body);
    const auto side_of = [&](std::uint32_t body) -> WideSide<S> {
      RealiserRows<S>& rows = rows_[body].rows();
      return {.hierarchy = &rows.hierarchy(), .body = body, .stale = rows.stale()};
    };
    const auto make = [&](std::uint32_t body, std::uint32_t node) {
      reads += rows_[body].make_wanted(node, forest.tree(body), motion, body);
    };
    return query_lazily(query_, near_bodies, scene.pairs(), budget, side_of, make, out, tests);
  }

  /// Appends the pairs of primitives whose boxes overlap in pairs of leaves of two bodies' trees:
  /// for_leaves(add) calls add(leaf of the first body, leaf of the second). Within one body, each two leaves
  /// are given once, and each leaf with itself. Counts as `find` does.
  template <class Forest, class ForLeaves>
  void find_in_leaves(const Forest& forest, const BodyPair& pair, const ForLeaves& for_leaves,
                      const SampledMotion<S>& motion, PairBuffer& out, std::uint64_t& tests,
                      std::uint64_t& reads) {
    KineticRows<S>&a = rows_[pair.first], &b = rows_[pair.second];
    reads += b.make_visited(forest.tree(pair.second), motion, pair.second);
    leaves_.clear();
    for_leaves([&](std::uint32_t leaf_a, std::uint32_t leaf_b) {
      const LeafSlot slot = b.leaf_slot(leaf_b);
      if (b.rows().stale()[slot.node()] != 0)
        reads += b.make_wanted(slot.node(), forest.tree(pair.second), motion, pair.second);
      leaves_.push_back(a.leaf_slot(leaf_a));
      leaves_.push_back(slot);
    });
    query_.run_leaves({.hierarchy = &a.rows().hierarchy(), .body = pair.first},
                      {.hierarchy = &b.rows().hierarchy(), .body = pair.second}, leaves_, out, tests);
  }

  /// Returns the box of a node of a body's tree, stored in `room`, if a query may have read it. Returns null
  /// otherwise.
  const Box<S>* read_box(std::uint32_t body, std::uint32_t node, Box<S>& room) const {
    return rows_[body].read_box(node, room);
  }

  std::size_t bytes() const {
    std::size_t total =
        query_.bytes() + rows_.capacity() * sizeof(KineticRows<S>) + leaves_.capacity() * sizeof(LeafSlot);
    for (const auto& rows : rows_) total += rows.bytes();
    return total;
  }

 private:
  std::vector<KineticRows<S>> rows_;  ///< [body]
  std::vector<LeafSlot> leaves_;      ///< of the present pair of bodies
  WideQuery<S> query_;
};

}  // namespace kbvh
