#pragma once
#include <span>
#include <string>

#include "core/contract/strategy.hpp"

namespace kbvh {

/// The result of an audit of one body's hierarchy at one time. Stale nodes (that no query read) are skipped
/// and counted.
struct Audit {
  std::uint64_t nodes = 0, stale = 0;
  std::uint64_t invalid = 0;    ///< nodes whose bound does not contain a vertex below it
  std::uint64_t not_tight = 0;  ///< nodes whose bound is not exactly the bound of the vertices below it
  /// The largest distance by which a vertex leaves a bound above it: along one axis for boxes, otherwise as
  /// measured by the volume (AuditVolumes::protrusion); valid = 0.
  double protrusion = 0;
  double area = 0, tight_area = 0;  ///< summed surface areas, in double
  std::string topology_error;       ///< first broken combinatorial invariant, or empty
  std::string first_fault;          ///< node, place and amount of the first invalid bound, or empty

  /// Returns the summed surface area over the tight one, minus one (0/0 = 0). The tight bounds of volumes are
  /// of the same kind, fitted directly to the vertices; the looseness may be negative for kinds whose fit is
  /// not optimal.
  double looseness() const { return tight_area > 0 ? area / tight_area - 1 : 0; }
  void add(const Audit& other);
};

/// Whether an audit sums the surface areas of bounds. For k-DOPs the areas take most of the audit's time.
enum class Areas : std::uint8_t { summed, left_out };

/// Audits topology, validity and tightness of one body against its current positions [vertex][3]. Cost for
/// boxes: O(nodes + vertices). Volumes (`view.volumes`) are queried about every vertex below every node,
/// inner nodes included: O(nodes + vertices x depth). A volume counts as tight if it equals a volume fitted
/// directly. `sound` is a topology that has passed the check, or null; an equal topology is not checked
/// again.
template <class S>
Audit audit(const AuditView& view, const Primitives& primitives, const S* positions,
            const Topology* sound = nullptr, Areas areas = Areas::summed);

/// Computes the exact boxes of all nodes, in double: the reference for validity and tightness.
template <class S>
std::vector<Box<double>> tight_boxes(const Topology& topology, const Primitives& primitives,
                                     const S* positions);

/// Computes the expected cost of a random query by the surface-area heuristic: the sum over inner nodes of
/// area x traversal_cost plus the sum over leaves of area x primitives, relative to the root's area. 0 for an
/// empty hierarchy. `areas` has the surface area of each node's bound.
double sah_cost(const Topology& topology, std::span<const double> areas, double traversal_cost = 1.0);
/// Computes the same from boxes.
double sah_cost(const Topology& topology, const std::vector<Box<double>>& boxes, double traversal_cost = 1.0);

}  // namespace kbvh
