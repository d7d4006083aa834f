#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "core/families/wide/wide_hierarchy.hpp"
#include "core/families/wide/wide_probes.hpp"
#include "core/families/wide/wide_ray_runner.hpp"
#include "core/topology/median_order.hpp"

namespace kbvh {

/// Answers rays over the wide hierarchies of all bodies of a scene; keeps its buffers from call to call.
///
/// A tree over the bodies' boxes, refitted at each call and rebuilt when the bodies have mixed, leads to the
/// bodies, which are searched nearest first. This is occlusion culling: a body behind the hits of all rays is
/// never searched, its positions are not fetched, and none of its stale boxes are made. A rebuild uses the
/// memory of the first build.
///
/// If all boxes and positions are current, the threads of the motion (SampledMotion::workers) share the rays
/// of a call: with the same hits and the same counts.
template <class S>
class WideRays {
 public:
  WideRays(const SceneView<S>& scene, const SampledMotion<S>& motion) : all_{scene, motion} {}

  /// Answers rays in the bodies' `sides`; adds the work of each body to `work`, [body], and box tests to
  /// `tests`.
  void answer(const RayProbes<S>& asked, std::span<const WideProbeSide<S>> sides, const WideBoxMaker& make,
              std::span<RayWork> work, TriangleTestStats& stats, std::uint64_t& tests);
  /// Adds to `bodies` how the rays of the last call treated each body.
  void count_bodies(std::span<const Ray<S>> rays, RayBodies& bodies) const;
  /// Rebuilds the tree over the bodies at the next call.
  void start_over() { built_area_ = -1; }
  std::size_t bytes() const;

 private:
  /// Rays that a thread answers at once: whole blocks, some ten microseconds of work.
  static constexpr std::size_t rays_at_once = 4 * WideRayBlock<S>::size;

  void refit_bodies();
  /// Builds the tree over `corners_`. Allocates only for another number of bodies than the last time.
  void build_bodies();
  /// Returns whether several threads may answer: no body changes while they do.
  bool can_be_shared() const;

  WideRayBodies<S> all_;
  std::span<RayWork> work_;
  // The tree over bodies: one primitive of two corners for each body that rays can meet.
  WideHierarchy<S> bodies_;
  Primitives primitives_;
  std::vector<S> corners_;            ///< [primitive][lower, upper][3], one scalar past the end
  std::vector<BuildItem> items_;      ///< [primitive], while the tree is built
  std::vector<std::uint32_t> order_;  ///< primitives by entry of the tree
  bool has_tree_ = false;
  double built_area_ = -1;  ///< sum over its nodes when it was built; negative: to be built
  std::vector<WideRayRunner<S>> runners_;
};

extern template class WideRays<float>;
extern template class WideRays<double>;

}  // namespace kbvh
