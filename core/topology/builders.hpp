#pragma once
#include <span>
#include <string_view>

#include "core/topology/topology.hpp"

namespace kbvh {

/// The method of building a topology from primitive boxes at one time.
enum class BuildMethod : std::uint8_t {
  median,  ///< exact median along the longest axis of the centroids; full leaves and nodes, one depth,
           ///< perfect when sizes allow
  sah,     ///< binned surface-area heuristic (Wald 2007), cost = 1 + area ratio x primitives
  morton,  ///< linear BVH over 63-bit Morton codes of the centroids (Lauterbach et al. 2009)
};
const char* name(BuildMethod method);
/// Finds a method by its name. Throws std::invalid_argument that lists the known methods.
BuildMethod build_method(std::string_view name);

struct BuilderConfig {
  BuildMethod method = BuildMethod::median;
  std::uint32_t width = 2;      ///< 2, 4 or 8
  std::uint32_t leaf_size = 4;  ///< most primitives per leaf, 1..16
  std::uint32_t sah_bins = 16;  ///< candidate planes + 1 per axis
};

/// Throws std::invalid_argument on an inadmissible width, leaf size, or number of bins.
void check_builder(const BuilderConfig& config);

/// Computes the boxes of all primitives; empty for removed ones. O(primitives).
template <class S>
std::vector<Box<S>> primitive_boxes(const Primitives& primitives, const S* positions);

/// Sorts the primitives within each leaf. Builders call it last: partitions leave the order within a leaf to
/// the standard library, and a tree must not depend on that. O(n log leaf size).
void sort_leaves(Topology& topology);

/// Builds a topology over the boxes. Deterministic: ties are broken by primitive id. O(n log n). Nodes are
/// stored depth first. SAH and Morton trees are built as binary trees and then collapsed, largest child
/// first. Throws std::invalid_argument on an inadmissible width or leaf size.
template <class S>
Topology build_topology(std::span<const Box<S>> boxes, const BuilderConfig& config);

/// Builds a topology over the living primitives of one body from positions [vertex][3].
template <class S>
Topology build_topology(const Primitives& primitives, const S* positions, const BuilderConfig& config);

}  // namespace kbvh
