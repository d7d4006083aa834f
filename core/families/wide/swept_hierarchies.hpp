#pragma once
#include <algorithm>
#include <span>
#include <vector>

#include "core/families/wide/near_bodies.hpp"
#include "core/families/wide/wide_query.hpp"

namespace kbvh {

/// Boxes that contain everything at both ends of a motion and therefore, if the motion is linear, throughout:
/// hierarchies over primitives with every vertex twice, at its old and its new position, refitted bottom-up.
/// Boxes are not rounded.
template <class S>
class SweptHierarchies {
 public:
  /// Uses the topologies of other hierarchies of the scene's bodies: hierarchy_of(body).
  template <class HierarchyOf>
  SweptHierarchies(const SceneView<S>& scene, const HierarchyOf& hierarchy_of)
      : scene_(scene),
        near_bodies_(scene.pairs(), scene.body_count()),
        hierarchies_(scene.body_count()),
        positions_(scene.body_count()) {
    for (std::uint32_t body = 0; body < hierarchies_.size(); ++body) {
      const WideHierarchy<S>& hierarchy = hierarchy_of(body);
      const Primitives& primitives = scene.primitives(body);
      const std::uint32_t vertices = scene.vertex_count(body);
      Primitives twice;
      twice.kind = primitives.kind;
      std::vector<std::uint32_t> corners;
      for (std::uint32_t p = 0; p < primitives.count(); ++p) {
        corners.assign(primitives[p].begin(), primitives[p].end());
        for (const std::uint32_t v : primitives[p]) corners.push_back(v + vertices);
        twice.add(corners);
      }
      twice.removed = primitives.removed;
      twice.removed_count = primitives.removed_count;
      std::vector<std::uint32_t> nodes;
      hierarchies_[body].assign(hierarchy.built_topology(nodes), twice, hierarchy.kernels());
      positions_[body].resize(std::size_t(6) * vertices + 1);
    }
  }

  /// Refits to a motion from `before` (positions of each body) to the current positions of the motion view.
  void refit(std::span<const S* const> before, const SampledMotion<S>& motion) {
    for (std::uint32_t body = 0; body < hierarchies_.size(); ++body) {
      const std::size_t size = std::size_t(3) * scene_.vertex_count(body);
      std::copy_n(before[body], size, positions_[body].data());
      std::copy_n(motion.positions(body), size, positions_[body].data() + size);
      hierarchies_[body].positions_changed();
      hierarchies_[body].refit(positions_[body].data());
    }
  }

  /// Appends the pairs of primitives whose boxes overlap; within a body also those that share a vertex.
  void pairs(WideQuery<S>& query, PairBuffer& out, std::uint64_t& tests) {
    const auto box_of = [&](std::uint32_t body) {
      return hierarchies_[body].empty() ? Box<double>{} : to_double(hierarchies_[body].box(0));
    };
    for (const std::uint32_t i : near_bodies_.find(box_of, tests)) {
      const BodyPair& pair = scene_.pairs()[i];
      query.run(side(pair.first), side(pair.second), out, tests);
    }
  }

  std::size_t bytes() const {
    std::size_t total = near_bodies_.bytes();
    for (const auto& hierarchy : hierarchies_) total += hierarchy.bytes();
    for (const auto& positions : positions_) total += positions.size() * sizeof(S);
    return total;
  }

 private:
  WideSide<S> side(std::uint32_t body) { return {&hierarchies_[body], body, positions_[body].data()}; }

  SceneView<S> scene_;
  NearBodies near_bodies_;
  std::vector<WideHierarchy<S>> hierarchies_;
  std::vector<std::vector<S>> positions_;  ///< [body][before, now][vertex][3], one scalar past the end
};

}  // namespace kbvh
