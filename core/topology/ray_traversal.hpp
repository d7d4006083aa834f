#pragma once
#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "core/base/counters.hpp"
#include "core/geometry/ray_box.hpp"
#include "core/scene/motion_view.hpp"
#include "core/scene/rays.hpp"
#include "core/topology/topology.hpp"

namespace kbvh {

/// A node that a ray may meet, and where it would enter.
template <class Node>
struct RayNode {
  double near;
  Node node;
};

/// Follows one ray through one hierarchy, nearer children first. `tree` gives access to it:
///   Node                                    names a node; `tree.root()` is one
///   box(Node)                               its Box<S>, which contains the polygons below
///   children(Node, visit)                   calls visit(child) for each child of an inner node
///   bool leaf(Node, test)                   returns false for an inner node, else calls test(primitive) for
///                                           each primitive until one call returns true
/// The caller owns the stack. Returns whether the search is over (RaySearch).
template <class Tree, class S, class Count>
bool follow_ray(const Tree& tree, RaySearch<S>& search, std::uint32_t body, const Primitives& primitives,
                const S* positions, std::vector<RayNode<typename Tree::Node>>& stack, Count& count,
                TriangleTestStats& stats) {
  using Node = typename Tree::Node;
  const RaySlabs slabs(search.line());
  std::uint64_t tests = 0;
  stack.clear();
  const auto enter = [&](Node node) {
    double near = 0;
    ++tests;
    if (slabs.meet(tree.box(node), search.limit(), near)) stack.push_back({near, node});
  };
  enter(tree.root());
  bool over = false;
  while (!over && !stack.empty()) {
    const RayNode<Node> top = stack.back();
    stack.pop_back();
    if (!RaySlabs::within(top.near, search.limit())) continue;
    const bool is_leaf = tree.leaf(top.node, [&](std::uint32_t primitive) {
      return over = search.offer(body, primitive, primitives[primitive], positions, stats);
    });
    if (is_leaf) continue;
    const std::size_t before = stack.size();
    tree.children(top.node, enter);
    std::sort(stack.begin() + std::ptrdiff_t(before), stack.end(),
              [](const auto& a, const auto& b) { return a.near > b.near; });
  }
  count.add(Counter::box_tests, tests);
  return over;
}

/// A topology with boxes as a tree for `follow_ray`: box_of(node) returns a node's box, valid at the query's
/// time.
template <class BoxOf>
struct TopologyTree {
  using Node = std::uint32_t;
  const Topology& topology;
  BoxOf box_of;

  Node root() const { return 0; }
  auto box(Node node) const { return box_of(node); }
  template <class Visit>
  void children(Node node, Visit&& visit) const {
    const TopologyNode content = topology.nodes[node];
    for (std::uint32_t child = content.first(); child < content.first() + content.count(); ++child)
      visit(child);
  }
  template <class Test>
  bool leaf(Node node, Test&& test) const {
    const TopologyNode content = topology.nodes[node];
    if (!content.is_leaf()) return false;
    for (std::uint32_t k = content.first(); k < content.first() + content.count(); ++k)
      if (test(topology.primitives[k])) break;
    return true;
  }
};
template <class BoxOf>
TopologyTree(const Topology&, BoxOf) -> TopologyTree<BoxOf>;

/// Answers rays over all bodies of a scene, one after the other: the shared part of strategies without a wide
/// hierarchy. follow(body, search) follows a ray through one body that consists of polygons, and returns
/// whether the search is over.
template <class S, class Follow>
void find_hits_by_body(const SceneView<S>& scene, const SampledMotion<S>& motion, RayQuery query,
                       std::span<const Ray<S>> rays, std::span<RayHit> hits, Follow&& follow) {
  for (std::uint32_t body = 0; body < scene.body_count(); ++body)
    if (scene.primitives(body).kind == PrimitiveKind::polygons) motion.fetch_all(body);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    RaySearch<S> search(rays[i], query);
    for (std::uint32_t body = 0; body < scene.body_count(); ++body)
      if (scene.primitives(body).kind == PrimitiveKind::polygons && follow(body, search)) break;
    hits[i] = search.hit();
  }
}

}  // namespace kbvh
