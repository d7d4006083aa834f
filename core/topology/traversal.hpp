#pragma once
#include <cstdint>
#include <limits>
#include <vector>

#include "core/base/counters.hpp"
#include "core/geometry/box.hpp"
#include "core/topology/topology.hpp"

namespace kbvh {

/// The work limit of a query; counted, so that a budget has the same meaning on every machine.
struct Budget {
  std::uint64_t box_tests = std::numeric_limits<std::uint64_t>::max();
};

/// The unfinished work of a query; 0 and complete unless a budget ran out.
struct QueryStatus {
  std::uint64_t pending = 0;  ///< node pairs (or other units of work) not visited
  bool complete() const { return pending == 0; }
};

/// Two nodes that remain to be compared.
struct NodePair {
  std::uint32_t first, second;
};

/// Traverses two hierarchies simultaneously (Z&W Algorithm 2): visits every pair of leaves whose bounds, and
/// whose ancestors' bounds on both sides, overlap, and calls on_leaves(leaf of a, leaf of b) once for each. A
/// bounds view gives access to a hierarchy's bounds:
///   void ensure(std::uint32_t node)         makes the node's bound valid at the query's time
///   B operator()(std::uint32_t node)        its bound, read only after `ensure`
/// B is a Box<S> or any other type for which argument-dependent lookup finds `bool overlap(bound of a, bound
/// of b)`: every BoundingVolume (core/geometry/volumes) has one. An overlap may be false only if no point is
/// in both. The views of the two bodies may differ. (Stored boxes have their own query: wide_query.hpp.) Two
/// inner nodes: descend both; one leaf: descend the other. The caller owns the stack, which grows as needed,
/// so that no work is dropped and a frame allocates nothing. For a body with itself, each two leaves are
/// visited in both orders. Adds the overlap tests to `tests`; tests that on_leaves adds count towards the
/// budget, too.
template <class ViewA, class ViewB, class OnLeaves>
QueryStatus traverse(const Topology& a, ViewA&& bounds_a, const Topology& b, ViewB&& bounds_b,
                     std::vector<NodePair>& stack, std::uint64_t& tests, const Budget& budget,
                     OnLeaves&& on_leaves) {
  stack.clear();
  if (a.empty() || b.empty()) return {};
  bounds_a.ensure(0);
  bounds_b.ensure(0);
  const std::uint64_t before = tests++;
  if (overlap(bounds_a(0), bounds_b(0))) stack.push_back({0, 0});
  const TopologyNode* nodes_a = a.nodes.data();
  const TopologyNode* nodes_b = b.nodes.data();
  while (!stack.empty() && tests - before < budget.box_tests) {
    const NodePair pair = stack.back();
    stack.pop_back();
    const TopologyNode node_a = nodes_a[pair.first], node_b = nodes_b[pair.second];
    if (node_a.is_leaf() && node_b.is_leaf()) {
      on_leaves(pair.first, pair.second);
      continue;
    }
    const std::uint32_t begin_a = node_a.is_leaf() ? pair.first : node_a.first();
    const std::uint32_t end_a = node_a.is_leaf() ? pair.first + 1 : begin_a + node_a.count();
    const std::uint32_t begin_b = node_b.is_leaf() ? pair.second : node_b.first();
    const std::uint32_t end_b = node_b.is_leaf() ? pair.second + 1 : begin_b + node_b.count();
    for (std::uint32_t j = begin_b; j < end_b; ++j) bounds_b.ensure(j);
    for (std::uint32_t i = begin_a; i < end_a; ++i) {
      bounds_a.ensure(i);
      const auto bound = bounds_a(i);
      for (std::uint32_t j = begin_b; j < end_b; ++j)
        if (overlap(bound, bounds_b(j))) stack.push_back({i, j});
    }
    tests += std::uint64_t(end_a - begin_a) * (end_b - begin_b);
  }
  return {stack.size()};
}

}  // namespace kbvh
