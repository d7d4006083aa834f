#pragma once
#include "core/judge/session.hpp"

namespace kbvh::test {

/// Options of a script of random insertions and deletions.
struct GeometryScriptStyle {
  std::uint64_t seed = 1;
  bool integers = false;    ///< positions and knots on a small grid: ties
  bool to_nothing = false;  ///< now and then a body loses everything, and later gets something again
  bool plans = false;       ///< plans change at the same times
};

/// A script for any scene: changes at the first frame, at keyframes and in between; primitives on new, old
/// and mixed vertices; primitives removed with and without the vertices that become unused, and inserted
/// again on the same vertices in the same change.
template <class S>
PlanScript<S> make_geometry_script(const Scene<S>& scene, std::uint32_t frames_per_keyframe,
                                   const GeometryScriptStyle& style);

}  // namespace kbvh::test
