#pragma once
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "core/families/wide/wide_query.hpp"
#include "core/families/wide/wide_tree.hpp"
#include "core/scene/probes.hpp"

namespace kbvh {

/// The data of one body that probes read.
template <class S>
struct WideProbeSide {
  WideTree<S>* hierarchy;
  /// stale[wide node] is not 0 while the boxes of the node's children must be made; null: all are current.
  const std::uint8_t* stale = nullptr;
  /// A box around the body; without one, probes use that of the hierarchy's root, which must be current.
  std::optional<Box<S>> root{};
  /// Boxes of children as in `WideArrays`, in place of the hierarchy's; null: those of the hierarchy.
  S* child_bounds = nullptr;

  WideProbeSide(WideTree<S>* tree, const std::uint8_t* stale_nodes) : hierarchy(tree), stale(stale_nodes) {}
  WideProbeSide(const WideSide<S>& side) : hierarchy(side.hierarchy), stale(side.stale) {}

  Box<S> root_box() const { return root ? *root : hierarchy->root_box(); }
};

/// The work of one call's rays in a body.
struct RayWork {
  std::uint64_t tests = 0;  ///< box tests in its hierarchy
  std::uint64_t rays = 0;   ///< that entered it
};

/// Makes the boxes of the children of a body's wide node and clears the node's mark.
struct WideBoxMaker {
  void* context = nullptr;
  void (*call)(void* context, std::uint32_t body, std::uint32_t node) = nullptr;
  void operator()(std::uint32_t body, std::uint32_t node) const { call(context, body, node); }
};

template <class S>
class WideRays;

/// Answers probes over the wide hierarchies of all bodies of a scene; keeps its buffers from call to call.
/// Rays have a traversal of their own (core/families/wide/wide_rays.hpp); other probes search body by body.
template <class S>
class WideProbes {
 public:
  WideProbes(const SceneView<S>& scene, const SampledMotion<S>& motion);
  ~WideProbes();
  WideProbes(const WideProbes&) = delete;
  WideProbes& operator=(const WideProbes&) = delete;

  /// Answers `probes`. side_of(body) returns the WideProbeSide<S> of a body, or its WideSide<S>.
  /// make(body, wide node) computes the boxes of the node's children and clears the node's mark; all
  /// positions of the body are then current. Adds box tests, including those of the filter of triangles, to
  /// `tests`, and how rays treated each body to `bodies`; null: this is not counted.
  template <class SideOf, class Make>
  void answer(const Probes<S>& probes, const SideOf& side_of, const Make& make, TriangleTestStats& stats,
              std::uint64_t& tests, RayBodies* bodies = nullptr) {
    sides_.clear();
    for (std::uint32_t body = 0; body < scene_.body_count(); ++body) sides_.push_back(side_of(body));
    make_ = {const_cast<Make*>(&make), [](void* context, std::uint32_t body, std::uint32_t node) {
               (*static_cast<const Make*>(context))(body, node);
             }};
    run(probes, stats, tests, bodies);
  }
  /// Does the same for hierarchies whose boxes are all current.
  template <class SideOf>
  void answer(const Probes<S>& probes, const SideOf& side_of, TriangleTestStats& stats, std::uint64_t& tests,
              RayBodies* bodies = nullptr) {
    answer(
        probes, side_of, [](std::uint32_t, std::uint32_t) {}, stats, tests, bodies);
  }

  /// Rebuilds the tree over the bodies at the next call, so that a restarted clip costs the same as the first
  /// run.
  void start_over();

  /// Returns the work of the last call's rays in each body; 0 for other probes.
  std::span<const RayWork> work() const { return work_; }

  std::size_t bytes() const;

 private:
  void run(const Probes<S>& probes, TriangleTestStats& stats, std::uint64_t& tests, RayBodies* bodies);
  /// Answers any probes body by body, without a kernel of their own.
  template <class Kind>
  void run_by_body(const Kind& probes, TriangleTestStats& stats, std::uint64_t& tests);
  /// Follows one search through one body.
  template <class Search>
  void search_body(std::uint32_t body, Search& search, TriangleTestStats& stats, std::uint64_t& tests);

  SceneView<S> scene_;
  SampledMotion<S> motion_;
  std::vector<WideProbeSide<S>> sides_;
  std::vector<RayWork> work_;  ///< [body], by this call
  WideBoxMaker make_;
  std::unique_ptr<WideRays<S>> rays_;
  std::vector<std::uint32_t> nodes_;   ///< to be visited by `search_body`
  std::vector<std::uint8_t> entered_;  ///< [body], of this call, if it is no call of rays
};

extern template class WideProbes<float>;
extern template class WideProbes<double>;

}  // namespace kbvh
