#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "core/families/wide/kernels/wide_rays.hpp"
#include "core/families/wide/wide_hierarchy.hpp"
#include "core/families/wide/wide_probes.hpp"

namespace kbvh {

/// Answers rays over the wide hierarchies of all bodies of a scene; keeps its buffers from call to call.
///
/// A tree over the bodies' boxes, refitted at each call and rebuilt when the bodies have mixed, leads to the
/// bodies, which are searched nearest first. This is occlusion culling: a body behind the hits of all rays is
/// never searched, its positions are not fetched, and none of its stale boxes are made.
template <class S>
class WideRays {
 public:
  WideRays(const SceneView<S>& scene, const SampledMotion<S>& motion) : scene_(scene), motion_(motion) {}

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
  /// The traversal of one tree, prepared for the rays of a call.
  struct Traversal {
    WideRayJob<S> job{};
    typename WideRayKernels<S>::Follow kernel = nullptr;
    typename WideRayKernels<S>::Together together = nullptr;
  };
  struct OfBody {
    Traversal search;
    bool entered = false;  ///< by this call
    // The corners of its leaves, copied by the rays of a call; memory is kept.
    UnfilledArray<S> corners;
    std::vector<WideLeafCopy> copies;
  };

  void refit_bodies();
  /// Prepares the traversals for the rays of this call, and forgets the copied corners of the last one.
  void prepare(std::size_t rays);
  WideRayJob<S> job_in(WideTree<S>& tree);
  /// Returns bit i unless rays[i] certainly misses all bodies; takes at most as many rays as a block has.
  std::uint64_t screen(std::span<const Ray<S>> rays);
  /// Makes a packet of the rays of a block that are `met`; they may be followed together only if this returns
  /// true: if their directions have the same signs, and can be inverted.
  bool pack(std::span<const Ray<S>> rays, std::uint64_t met);
  /// Follows the job's ray through a tree, from a node or leaf. Returns whether the search has ended.
  bool follow(Traversal& search, std::uint32_t from, std::vector<WideRayItem<S>>& stack);
  /// Follows the packet through the only body.
  void follow_packet();
  /// Prepares a body for a ray that enters it.
  OfBody& enter(std::uint32_t body);
  /// Decides a primitive of the current body for the ray of its job; `corners`, [3][3], are those of a
  /// triangle, or null. Returns whether the search has ended.
  bool decide(std::uint32_t primitive, const S* corners);

  SceneView<S> scene_;
  SampledMotion<S> motion_;
  std::span<const WideProbeSide<S>> sides_;
  WideBoxMaker make_;
  std::span<RayWork> work_;
  // The tree over bodies: one primitive of two corners for each body that rays can meet.
  WideHierarchy<S> bodies_;
  Primitives primitives_;
  std::vector<std::uint32_t> ids_;  ///< of the bodies in the tree
  std::vector<S> corners_;          ///< [primitive][lower, upper][3], one scalar past the end
  double built_area_ = -1;          ///< sum over its nodes when it was built; negative: to be built
  Traversal all_bodies_;
  std::vector<OfBody> of_bodies_;  ///< [body]
  std::uint32_t stamp_ = 0;        ///< of this call's copies
  std::vector<WideRayItem<S>> body_stack_, stack_;
  WideRayBlock<S> block_{};
  WideRayPacket<S> packet_{};
  std::vector<WidePacketItem<S>> packet_stack_;
  // The rays that are followed: those of a packet, by place in the block, or the first one.
  WideRay<S> rays_[WideRayBlock<S>::size] = {};
  RaySearch<S>* searches_[WideRayBlock<S>::size] = {};
  std::vector<RaySearch<S>> packet_searches_;
  std::uint32_t body_ = 0;  ///< in which they are
  TriangleTestStats* stats_ = nullptr;
  std::uint64_t tests_ = 0;
};

extern template class WideRays<float>;
extern template class WideRays<double>;

}  // namespace kbvh
