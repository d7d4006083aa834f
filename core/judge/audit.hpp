#pragma once
#include <string>

#include "core/contract/strategy.hpp"

namespace kbvh {

/// What an audit of one body's hierarchy found at one time. Stale nodes (that no query read) are skipped and
/// counted.
struct Audit {
  std::uint64_t nodes = 0, stale = 0;
  std::uint64_t invalid = 0;    ///< nodes whose box does not contain a vertex below it
  std::uint64_t not_tight = 0;  ///< nodes whose box is not exactly the box of the vertices below it
  double protrusion = 0;        ///< furthest that a vertex leaves a box above it, along one axis; valid = 0
  double area = 0, tight_area = 0;  ///< summed surface areas, in double
  std::string topology_error;       ///< first broken combinatorial invariant, or empty
  std::string first_fault;          ///< node, axis and amount of the first invalid box, or empty

  /// Summed surface area over tight, minus one (0/0 = 0).
  double looseness() const { return tight_area > 0 ? area / tight_area - 1 : 0; }
  void add(const Audit& other);
};

/// Audits topology, validity and tightness of one body against its current positions [vertex][3]. O(nodes +
/// vertices).
template <class S>
Audit audit(const AuditView& view, const Primitives& primitives, const S* positions,
            const Topology* sound = nullptr);

/// Exact boxes of all nodes, in double; the reference for validity and tightness.
template <class S>
std::vector<Box<double>> tight_boxes(const Topology& topology, const Primitives& primitives,
                                     const S* positions);

/// Expected cost of a random query by the surface-area heuristic: sum over inner nodes of area x
/// traversal_cost plus over leaves of area x primitives, relative to the root's area. 0 for an empty
/// hierarchy.
double sah_cost(const Topology& topology, const std::vector<Box<double>>& boxes, double traversal_cost = 1.0);

}  // namespace kbvh
