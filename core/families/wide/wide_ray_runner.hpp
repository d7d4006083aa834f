#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/families/wide/kernels/wide_rays.hpp"
#include "core/families/wide/wide_hierarchy.hpp"
#include "core/families/wide/wide_probes.hpp"
#include "core/parallel/workers.hpp"

namespace kbvh {

/// What the rays of a call read: the bodies of a scene, and a tree over the boxes of those that rays can
/// meet.
template <class S>
struct WideRayBodies {
  SceneView<S> scene;
  SampledMotion<S> motion;
  std::span<const WideProbeSide<S>> sides{};  ///< [body]
  WideBoxMaker make{};
  WideHierarchy<S>* tree = nullptr;  ///< one primitive for each of `ids`
  std::vector<std::uint32_t> ids{};  ///< bodies in the tree
};

/// Follows the rays of a call on one thread; keeps its memory from call to call.
///
/// Several runners may work at the same time if no box is stale and all positions are current: each has its
/// own copies of corners, and writes the hits of its rays only.
template <class S>
class alignas(cache_line) WideRayRunner {
 public:
  /// Prepares for a call, of whose rays this runner is expected to follow `rays`: starts counting, and
  /// forgets the copied corners of the last call.
  void prepare(const WideRayBodies<S>& all, std::size_t rays);
  /// Answers the rays [first, last). The hits do not depend on other rays, and the work only on those of the
  /// same block of 64 from `first`.
  void answer(const RayProbes<S>& asked, std::size_t first, std::size_t last);

  /// Returns the work in one of the bodies `ids` since `prepare`.
  RayWork work(std::uint32_t body) const {
    return {of_bodies_[body].search.job.tests, of_bodies_[body].rays};
  }
  /// Returns the box tests outside of bodies since `prepare`.
  std::uint64_t tests_of_bodies() const { return screen_tests_ + all_bodies_.job.tests; }
  const TriangleTestStats& stats() const { return stats_; }

  /// Sizes of stacks. All runners are given the largest, because the next call may give the same rays to
  /// another one, which then allocates nothing.
  struct Depths {
    std::size_t of_bodies, in_body, of_packets;
  };
  Depths depths() const { return {body_stack_.size(), stack_.size(), packet_stack_.size()}; }
  void deepen(const Depths& depths);

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
    bool entered = false;    ///< by this call
    std::uint64_t rays = 0;  ///< of this call that entered it
    // The corners of its leaves, copied by the rays of a call; memory is kept.
    UnfilledArray<S> corners;
    std::vector<WideLeafCopy> copies;
  };

  void prepare_body(std::uint32_t body, std::size_t rays);
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

  const WideRayBodies<S>* all_ = nullptr;
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
  TriangleTestStats stats_;
  std::uint64_t screen_tests_ = 0;
};

extern template class WideRayRunner<float>;
extern template class WideRayRunner<double>;

}  // namespace kbvh
