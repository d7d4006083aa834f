#pragma once
#include <span>
#include <vector>

#include "core/families/wide/kernels/wide_rays.hpp"
#include "core/families/wide/wide_hierarchy.hpp"
#include "core/families/wide/wide_query.hpp"
#include "core/scene/rays.hpp"

namespace kbvh {

/// Answers rays over the wide hierarchies of all bodies of a scene; keeps its buffers from call to call. A
/// tree over the bodies' boxes, refitted at each call and built anew when the bodies have mixed, leads to the
/// bodies, which are searched nearest first.
template <class S>
class WideRays {
 public:
  WideRays(const SceneView<S>& scene, const SampledMotion<S>& motion) : scene_(scene), motion_(motion) {}

  /// Sets hits[i] to the answer to rays[i]. side_of(body) returns the WideSide<S> of a body, of which the
  /// hierarchy and the marks of stale nodes are used; the boxes of roots must be current. make(body, wide
  /// node) computes the boxes of the node's children and clears the node's mark. All positions of bodies that
  /// rays come near are fetched. Adds box tests, those of the filter of triangles included, to `tests`.
  template <class SideOf, class Make>
  void find(RayQuery query, std::span<const Ray<S>> rays, std::span<RayHit> hits, const SideOf& side_of,
            const Make& make, TriangleTestStats& stats, std::uint64_t& tests) {
    sides_.clear();
    for (std::uint32_t body = 0; body < scene_.body_count(); ++body) sides_.push_back(side_of(body));
    make_context_ = const_cast<Make*>(&make);
    make_ = [](void* context, std::uint32_t body, std::uint32_t node) {
      (*static_cast<const Make*>(context))(body, node);
    };
    run(query, rays, hits, stats, tests);
  }
  /// Does the same for hierarchies whose boxes are all current.
  template <class SideOf>
  void find(RayQuery query, std::span<const Ray<S>> rays, std::span<RayHit> hits, const SideOf& side_of,
            TriangleTestStats& stats, std::uint64_t& tests) {
    find(
        query, rays, hits, side_of, [](std::uint32_t, std::uint32_t) {}, stats, tests);
  }

  /// Builds the tree over the bodies anew at the next call, so that a restarted clip costs the same as
  /// before.
  void start_over() { built_area_ = -1; }

  std::size_t bytes() const;

 private:
  void run(RayQuery query, std::span<const Ray<S>> rays, std::span<RayHit> hits, TriangleTestStats& stats,
           std::uint64_t& tests);
  void refit_bodies();
  void follow(WideTree<S>& tree, WideRayJob<S>& job, std::vector<WideRayItem<S>>& stack);
  /// Follows the current ray through one body. Returns whether the search is over.
  bool enter(std::uint32_t body);

  SceneView<S> scene_;
  SampledMotion<S> motion_;
  std::vector<WideSide<S>> sides_;
  void* make_context_ = nullptr;
  void (*make_)(void* context, std::uint32_t body, std::uint32_t node) = nullptr;
  // The tree over bodies: one primitive of two corners for each body that rays can meet.
  WideHierarchy<S> bodies_;
  Primitives primitives_;
  std::vector<std::uint32_t> ids_;  ///< of the bodies in the tree
  std::vector<S> corners_;          ///< [primitive][lower, upper][3], one scalar past the end
  double built_area_ = -1;          ///< sum over its nodes when it was built; negative: to be built
  std::vector<WideRayItem<S>> body_stack_, stack_;
  // The current ray.
  WideRay<S> ray_{};
  RaySearch<S>* search_ = nullptr;
  std::uint32_t body_ = 0;
  TriangleTestStats* stats_ = nullptr;
  std::uint64_t tests_ = 0;
};

extern template class WideRays<float>;
extern template class WideRays<double>;

}  // namespace kbvh
