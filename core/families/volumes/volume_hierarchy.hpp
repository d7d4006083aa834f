#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "core/contract/audited_volumes.hpp"
#include "core/families/wide/near_bodies.hpp"
#include "core/geometry/lane_box.hpp"
#include "core/geometry/volumes/bounding_volume.hpp"
#include "core/topology/topology.hpp"

namespace kbvh {

/// The part of each primitive that the volume of a leaf must contain.
enum class Cover : std::uint8_t {
  vertices,  ///< its vertices, and therefore their convex hull
  boxes,     ///< its axis-aligned box, for pairs of which only the boxes are compared
};

/// The corners of a primitive's box.
inline constexpr std::uint32_t corners_each = 8;

/// Lists the points that the volumes of leaves must contain: vertices, or corners of boxes, numbered as
/// `place_corners` writes them.
inline LeafVertices points_of_leaves(const Topology& topology, const Primitives& primitives, Cover cover) {
  if (cover == Cover::vertices) return unique_leaf_vertices(topology, primitives);
  LeafVertices result;
  result.offsets.push_back(0);
  for (const TopologyNode& node : topology.nodes) {
    if (node.is_leaf())
      for (std::uint32_t k = node.first(); k < node.first() + node.count(); ++k)
        for (std::uint32_t corner = 0; corner < corners_each; ++corner)
          result.vertices.push_back(corners_each * topology.primitives[k] + corner);
    result.offsets.push_back(std::uint32_t(result.vertices.size()));
  }
  return result;
}

/// Writes the corners of the boxes of a topology's primitives: [primitive][8][3].
template <class S>
void place_corners(const Topology& topology, const Primitives& primitives, const S* positions, S* corners) {
  for (const std::uint32_t primitive : topology.primitives) {
    const Box<S> box = primitive_box(primitives[primitive], positions);
    S* out = corners + std::size_t(3) * corners_each * primitive;
    for (std::size_t corner = 0; corner < corners_each; ++corner)
      for (std::size_t d = 0; d < 3; ++d) *out++ = (corner >> d) & 1 ? box.upper[d] : box.lower[d];
  }
}

/// The hierarchy of one body that stores a bounding volume of any kind per node. The topology may have any
/// width.
template <BoundingVolume V>
class VolumeHierarchy {
 public:
  using S = VolumeScalar<V>;
  using Volume = V;
  /// The memory of searches; one serves all bodies.
  struct Scratch {
    std::vector<NodePair> stack;
    std::size_t bytes() const { return stack.capacity() * sizeof(NodePair); }
  };

  VolumeHierarchy(Topology topology, const Primitives& primitives, Cover cover) : cover_(cover) {
    assign(std::move(topology), primitives);
  }

  /// Takes a topology over primitives that must outlive this object; volumes are empty until the next refit.
  void assign(Topology topology, const Primitives& primitives) {
    topology_ = std::move(topology);
    primitives_ = &primitives;
    volumes_.assign(topology_.size(), V{});
    leaf_vertices_ = unique_leaf_vertices(topology_, primitives);
    corners_.resize(cover_ == Cover::boxes ? std::size_t(topology_.leaf_size) * corners_each * 3 : 0);
  }

  /// Computes all volumes from positions [vertex][3], readable up to one scalar past the end: leaves from
  /// their geometry, parents from their children. O(nodes + leaf vertices).
  void refit(const S* positions) {
    for (std::uint32_t node = topology_.size(); node-- > 0;)
      if (topology_.nodes[node].is_leaf())
        fit_leaf(node, positions);
      else
        enclose_children(node);
  }

  const Topology& topology() const { return topology_; }
  bool empty() const { return topology_.empty(); }
  const V& volume(std::uint32_t node) const { return volumes_[node]; }
  void set_volume(std::uint32_t node, const V& volume) { volumes_[node] = volume; }
  /// Returns the vertices of a leaf, each once, ascending.
  std::span<const std::uint32_t> vertices(std::uint32_t leaf) const { return leaf_vertices_[leaf]; }
  std::size_t leaf_vertex_count() const { return leaf_vertices_.vertices.size(); }
  /// Returns a copy of all volumes, for audits.
  std::vector<V> volumes() const { return volumes_; }

  /// Calls on_leaves(leaf a, leaf b) for each two leaves whose volumes, and those of all nodes above them,
  /// overlap; within one body, for each two leaves once and for each leaf with itself. Counts the tests.
  /// Returns the number of pairs of nodes that the budget left undone.
  template <class OnLeaves>
  static std::size_t search(const VolumeHierarchy& a, const VolumeHierarchy& b, Scratch& scratch,
                            std::uint64_t& tests, const Budget& budget, OnLeaves&& on_leaves) {
    const auto once = [&](std::uint32_t leaf_a, std::uint32_t leaf_b) {
      if (&a != &b || leaf_a <= leaf_b) on_leaves(leaf_a, leaf_b);
    };
    return traverse(a.topology(), Stored{a}, b.topology(), Stored{b}, scratch.stack, tests,
                    rest_of(budget, tests), once)
        .pending;
  }

  std::size_t bytes() const {
    return topology_.bytes() + volumes_.size() * sizeof(V) +
           (leaf_vertices_.offsets.size() + leaf_vertices_.vertices.size()) * sizeof(std::uint32_t) +
           corners_.size() * sizeof(S);
  }

 private:
  /// A bounds view of stored volumes.
  struct Stored {
    void ensure(std::uint32_t /*node*/) const {}
    const V& operator()(std::uint32_t node) const { return hierarchy.volume(node); }
    const VolumeHierarchy& hierarchy;
  };

  void fit_leaf(std::uint32_t leaf, const S* positions) {
    if (cover_ == Cover::vertices) {
      fit(volumes_[leaf], PointSet<S>(vertices(leaf), positions));
      return;
    }
    const TopologyNode content = topology_.nodes[leaf];
    S* out = corners_.data();
    for (std::uint32_t k = content.first(); k < content.first() + content.count(); ++k) {
      const Box<S> box = primitive_box((*primitives_)[topology_.primitives[k]], positions);
      for (std::size_t corner = 0; corner < corners_each; ++corner)
        for (std::size_t d = 0; d < 3; ++d) *out++ = (corner >> d) & 1 ? box.upper[d] : box.lower[d];
    }
    fit(volumes_[leaf], PointSet<S>(corners_.data(), content.count() * corners_each));
  }
  void enclose_children(std::uint32_t node) {
    const TopologyNode content = topology_.nodes[node];
    enclose(volumes_[node], std::span<const V>(volumes_.data() + content.first(), content.count()));
  }

  Topology topology_;
  const Primitives* primitives_ = nullptr;
  Cover cover_;
  std::vector<V> volumes_;  ///< one per node
  LeafVertices leaf_vertices_;
  std::vector<S> corners_;
};

}  // namespace kbvh
