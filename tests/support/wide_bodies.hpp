#pragma once
#include <algorithm>
#include <cstdint>
#include <vector>

#include "core/families/wide/wide_hierarchy.hpp"
#include "core/families/wide/wide_query.hpp"
#include "core/topology/builders.hpp"

namespace kbvh::test {

/// The bodies of a scene with their hierarchies, at one time after another.
template <class S>
struct WideBodies {
  WideBodies(const Scene<S>& of, const BuilderConfig& builder, KernelSet set)
      : scene(of),
        view(scene),
        playback(scene),
        motion(playback),
        query(view, motion),
        hierarchies(scene.bodies.size()) {
    playback.evaluate_all();
    for (std::uint32_t body = 0; body < hierarchies.size(); ++body) build(body, builder, set);
  }
  void build(std::uint32_t body, const BuilderConfig& builder, KernelSet set) {
    hierarchies[body].assign(build_topology(view.primitives(body), playback.positions(body), builder),
                             view.primitives(body), set);
  }
  /// Makes the boxes at t.
  void seek(double t) {
    playback.seek(t);
    playback.evaluate_all();
    for (std::uint32_t body = 0; body < hierarchies.size(); ++body) {
      hierarchies[body].positions_changed();
      hierarchies[body].refit(playback.positions(body));
    }
  }
  WideSide<S> side(std::uint32_t body) { return {&hierarchies[body], body}; }
  /// Returns the candidates of all pairs of bodies, sorted; adds the box tests made to `tests`.
  PairBuffer candidates(std::uint64_t& tests) {
    PairBuffer pairs;
    for (const BodyPair& pair : scene.pairs) query.run(side(pair.first), side(pair.second), pairs, tests);
    std::sort(pairs.begin(), pairs.end());
    return pairs;
  }

  Scene<S> scene;
  SceneView<S> view;
  Playback<S> playback;
  SampledMotion<S> motion;
  WideQuery<S> query;
  std::vector<WideHierarchy<S>> hierarchies;
};

}  // namespace kbvh::test
