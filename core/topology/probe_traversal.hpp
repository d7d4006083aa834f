#pragma once
#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "core/base/counters.hpp"
#include "core/scene/motion_view.hpp"
#include "core/scene/probes.hpp"
#include "core/topology/topology.hpp"

namespace kbvh {

/// A node that a probe may meet, and where a ray would enter; other probes find every node near.
template <class Node>
struct ProbeNode {
  double near;
  Node node;
};

/// Sorts the nodes from index `first` on, the nearest last, so that it is popped first: the few children of
/// one node.
template <class Node>
void sort_nearest_last(std::vector<ProbeNode<Node>>& nodes, std::size_t first) {
  for (std::size_t i = first + 1; i < nodes.size(); ++i) {
    const ProbeNode<Node> node = nodes[i];
    std::size_t place = i;
    for (; place > first && nodes[place - 1].near < node.near; --place) nodes[place] = nodes[place - 1];
    nodes[place] = node;
  }
}

/// Follows one search of a probe (core/scene/probes.hpp) through one hierarchy, nearer children first. `tree`
/// gives access to it:
///   Node                                    names a node; `tree.root()` is one
///   box(Node)                               its Box<S>, which contains the primitives below
///   children(Node, visit)                   calls visit(child) for each child of an inner node
///   bool leaf(Node, test)                   returns false for an inner node, else calls test(primitive) for
///                                           each primitive until one call returns true
/// The caller owns the stack. Adds the box tests to `tests`. Returns whether the search has ended.
template <class Tree, class Search, class S>
bool follow_probe(const Tree& tree, Search& search, std::uint32_t body, const Primitives& primitives,
                  const S* positions, std::vector<ProbeNode<typename Tree::Node>>& stack,
                  std::uint64_t& tests, TriangleTestStats& stats) {
  using Node = typename Tree::Node;
  const auto boxes = search.box_test();
  std::uint64_t made = 0;
  stack.clear();
  const auto enter = [&](Node node) {
    double near = 0;
    ++made;
    if (boxes.meet(tree.box(node), search.limit(), near)) stack.push_back({near, node});
  };
  enter(tree.root());
  bool over = false;
  while (!over && !stack.empty()) {
    const ProbeNode<Node> top = stack.back();
    stack.pop_back();
    if (!RaySlabs::within(top.near, search.limit())) continue;
    const bool is_leaf = tree.leaf(top.node, [&](std::uint32_t primitive) {
      return over = search.offer(body, primitive, primitives.triangles(primitive), positions, stats);
    });
    if (is_leaf) continue;
    const std::size_t before = stack.size();
    tree.children(top.node, enter);
    sort_nearest_last(stack, before);
  }
  tests += made;
  return over;
}

/// A topology with boxes as a tree for `follow_probe`: box_of(node) returns a node's box, valid at the
/// query's time.
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

/// The bodies of a scene in the order in which a probe may meet them; keeps its buffers from call to call.
class BodyOrder {
 public:
  /// Starts a call: box_of(body) returns a box around a body, empty if there is nothing to meet;
  /// meets(kind) says whether the probes meet primitives of a kind.
  template <class S, class BoxOf>
  void start(const SceneView<S>& scene, bool (*meets)(PrimitiveKind), const BoxOf& box_of) {
    bodies_.clear();
    for (std::uint32_t body = 0; body < scene.body_count(); ++body) {
      if (!meets(scene.primitives(body).kind)) continue;
      const Box<double> box = to_double(box_of(body));
      if (!box.empty()) bodies_.push_back({box, body, Seen::unmet});
    }
  }

  /// Follows one search. Calls enter(body, first), where `first` marks the body's first time in this call,
  /// for the bodies whose boxes it may meet at a parameter of at most its limit at that time, front to back,
  /// until a call returns true. Skips bodies behind what has been found. Returns the number of box tests.
  template <class Search, class Enter>
  std::uint64_t follow(const Search& search, const Enter& enter) {
    const auto boxes = search.box_test();
    met_.clear();
    for (std::uint32_t i = 0; i < bodies_.size(); ++i) {
      double near = 0;
      if (boxes.meet(bodies_[i].box, search.limit(), near)) met_.push_back({near, i});
    }
    std::sort(met_.begin(), met_.end(), [](const auto& a, const auto& b) {
      return a.near != b.near ? a.near < b.near : a.node < b.node;
    });
    bool over = false;
    for (const ProbeNode<std::uint32_t>& next : met_) {
      Body& body = bodies_[next.node];
      over = over || !RaySlabs::within(next.near, search.limit());
      if (over) {
        body.seen = std::max(body.seen, Seen::hidden);
        continue;
      }
      const bool first = body.seen != Seen::entered;
      body.seen = Seen::entered;
      over = enter(body.id, first);
    }
    return bodies_.size();
  }

  /// Adds how the call treated each body; null: nothing.
  void count(RayBodies* bodies) const;

  std::size_t bytes() const {
    return bodies_.capacity() * sizeof(Body) + met_.capacity() * sizeof(ProbeNode<std::uint32_t>);
  }

 private:
  enum class Seen : std::uint8_t { unmet, hidden, entered };
  struct Body {
    Box<double> box;
    std::uint32_t id;
    Seen seen;
  };

  std::vector<Body> bodies_;
  std::vector<ProbeNode<std::uint32_t>> met_;
};

/// Answers probes over all bodies of a scene, front to back: the shared part of strategies without a wide
/// hierarchy. box_of(body) returns a box around a body, empty if it has none. follow(body, search, tests)
/// follows a search through one body, adds its box tests to `tests`, and returns whether the search has
/// ended. Fetches the positions of the bodies that a search enters. Adds to `counts` how rays treated each
/// body (null: not counted); returns the box tests.
template <class S, class BoxOf, class Follow>
std::uint64_t answer_by_body(const SceneView<S>& scene, const SampledMotion<S>& motion,
                             const Probes<S>& probes, BodyOrder& order, RayBodies* counts,
                             const BoxOf& box_of, Follow&& follow) {
  std::uint64_t tests = 0;
  std::visit(
      [&](const auto& asked) {
        order.start(scene, &asked.meets, box_of);
        for (std::size_t i = 0; i < asked.size(); ++i) {
          auto search = asked.search(i);
          const std::uint64_t bodies_tested = order.follow(search, [&](std::uint32_t body, bool first) {
            if (first) motion.fetch_all(body);
            return follow(body, search, tests);
          });
          tests += bodies_tested;
          asked.take(i, search);
        }
      },
      probes);
  if (std::holds_alternative<RayProbes<S>>(probes)) order.count(counts);
  return tests;
}

}  // namespace kbvh
