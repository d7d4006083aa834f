#pragma once
#include <span>

#include "core/topology/builders.hpp"

namespace kbvh {

/// Builds one topology for several times. Leaves and nodes are as full as those of BuildMethod::median, but
/// each split may follow the order along the longest axis at any of the times: it takes the order whose two
/// parts have the least surface summed over all times (the temporal surface-area heuristic of Bittner &
/// Meister 2015, here for splits at medians). `positions` are those of the body at each time, [vertex][3];
/// `config` gives width and leaf size. Deterministic: ties are broken by the earlier time, then by primitive
/// id. O(t^2 n log n) for t times. Throws std::invalid_argument without any time, and on an inadmissible
/// width or leaf size.
template <class S>
Topology build_topology_over_time(const Primitives& primitives, std::span<const S* const> positions,
                                  const BuilderConfig& config);

}  // namespace kbvh
