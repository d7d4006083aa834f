#pragma once
#include <span>
#include <vector>

#include "core/families/wide/near_bodies.hpp"
#include "core/families/wide/wide_query.hpp"

namespace kbvh {

/// Boxes that contain everything at both ends of a motion and therefore, if the motion is linear, throughout:
/// hierarchies over primitives that contain every vertex twice, at its old and its new position, refitted
/// bottom-up. Boxes are not rounded.
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
    for (std::uint32_t body = 0; body < hierarchies_.size(); ++body) assign(body, hierarchy_of(body));
  }

  /// Refits to a motion from `before` (positions of each body) to the current positions of the motion view.
  void refit(std::span<const S* const> before, const SampledMotion<S>& motion);

  /// Appends the pairs of primitives whose boxes overlap; within a body, including those that share a vertex.
  void pairs(WideQuery<S>& query, PairBuffer& out, std::uint64_t& tests);

  std::size_t bytes() const;

 private:
  void assign(std::uint32_t body, const WideHierarchy<S>& hierarchy);
  WideSide<S> side(std::uint32_t body) { return {&hierarchies_[body], body, positions_[body].data()}; }

  SceneView<S> scene_;
  NearBodies near_bodies_;
  std::vector<WideHierarchy<S>> hierarchies_;
  std::vector<std::vector<S>> positions_;  ///< [body][before, now][vertex][3], one scalar past the end
};

extern template class SweptHierarchies<float>;
extern template class SweptHierarchies<double>;

}  // namespace kbvh
