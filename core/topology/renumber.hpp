#pragma once
#include "core/scene/scene.hpp"
#include "core/topology/builders.hpp"

namespace kbvh {

/// A scene whose vertices and primitives are stored in the order of a hierarchy's leaves, so that updates
/// read memory in order. Ids change: the maps give the old ids.
template <class S>
struct RenumberedScene {
  Scene<S> scene;
  std::vector<std::vector<std::uint32_t>> old_vertex;     ///< [body][new vertex]; unused vertices come last
  std::vector<std::vector<std::uint32_t>> old_primitive;  ///< [body][new primitive]
};

/// Renumbers every body along the leaves of the topology that `config` builds at the first frame. Geometry
/// and motion stay the same; corners of a primitive keep their order. The vertices of a vertex set are
/// stored in the order of the leaves of its first body, then of the next one for vertices that are not
/// in it; primitives of each body in that of its own leaves. O(n log n), and a copy of all keyframes. Plan
/// changes at run time are not carried over: renumber before a session starts.
template <class S>
RenumberedScene<S> renumber_in_leaf_order(const Scene<S>& scene, const BuilderConfig& config);

}  // namespace kbvh
