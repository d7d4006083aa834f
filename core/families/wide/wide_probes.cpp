#include "core/families/wide/wide_probes.hpp"

#include <utility>

#include "core/families/wide/wide_rays.hpp"

namespace kbvh {

template <class S>
WideProbes<S>::WideProbes(const SceneView<S>& scene, const SampledMotion<S>& motion)
    : scene_(scene), motion_(motion), rays_(std::make_unique<WideRays<S>>(scene, motion)) {}
template <class S>
WideProbes<S>::~WideProbes() = default;

template <class S>
void WideProbes<S>::start_over() {
  rays_->start_over();
}

template <class S>
template <class Search>
void WideProbes<S>::search_body(std::uint32_t body, Search& search, TriangleTestStats& stats,
                                std::uint64_t& tests) {
  const WideProbeSide<S>& side = sides_[body];
  const Primitives& primitives = scene_.primitives(body);
  WideTree<S>& hierarchy = *side.hierarchy;
  const WideArrays<S> arrays = hierarchy.arrays();
  const S* const bounds = side.child_bounds != nullptr ? side.child_bounds : arrays.child_bounds;
  const std::size_t width = hierarchy.width();
  const S* const positions = motion_.positions(body);
  const auto boxes = search.box_test();
  nodes_.assign(1, 0);
  while (!nodes_.empty()) {
    const std::uint32_t number = nodes_.back();
    nodes_.pop_back();
    if (side.stale != nullptr && side.stale[number] != 0) make_(body, number);
    const WideNode node = arrays.nodes[number];
    const S* const rows = bounds + number * lane_scalars(hierarchy.width());
    tests += node.count;
    for (std::uint32_t lane = 0; lane < node.count; ++lane) {
      Box<S> box;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        box.lower[axis] = rows[axis * width + lane];
        box.upper[axis] = -rows[(axis + 3) * width + lane];
      }
      double near = 0;
      if (!boxes.meet(box, search.limit(), near)) continue;
      if (lane >= node.leaf_count) {
        nodes_.push_back(node.first_child + lane - node.leaf_count);
        continue;
      }
      for (const std::uint32_t primitive : hierarchy.leaf_primitives(node.first_leaf + lane))
        if (search.offer(body, primitive, primitives.triangles(primitive), positions, stats)) return;
    }
  }
}

template <class S>
template <class Kind>
void WideProbes<S>::run_by_body(const Kind& probes, TriangleTestStats& stats, std::uint64_t& tests) {
  entered_.assign(sides_.size(), 0);
  for (std::size_t i = 0; i < probes.size(); ++i) {
    auto search = probes.search(i);
    const auto boxes = search.box_test();
    for (std::uint32_t body = 0; body < sides_.size(); ++body) {
      if (!Kind::meets(scene_.primitives(body).kind) || sides_[body].hierarchy->empty()) continue;
      double near = 0;
      ++tests;
      if (!boxes.meet(sides_[body].root_box(), search.limit(), near)) continue;
      if (std::exchange(entered_[body], 1) == 0) motion_.fetch_all(body);
      search_body(body, search, stats, tests);
    }
    probes.take(i, search);
  }
}

template <class S>
void WideProbes<S>::run(const Probes<S>& probes, TriangleTestStats& stats, std::uint64_t& tests,
                        RayBodies* bodies) {
  work_.assign(sides_.size(), {});
  if (const auto* rays = std::get_if<RayProbes<S>>(&probes)) {
    rays_->answer(*rays, sides_, make_, work_, stats, tests);
    if (bodies != nullptr) rays_->count_bodies(rays->rays, *bodies);
  } else {
    run_by_body(std::get<BallProbes<S>>(probes), stats, tests);
  }
}

template <class S>
std::size_t WideProbes<S>::bytes() const {
  return sizeof(WideRays<S>) + rays_->bytes() + sides_.capacity() * sizeof(WideProbeSide<S>) +
         work_.capacity() * sizeof(RayWork) + nodes_.capacity() * sizeof(std::uint32_t) + entered_.capacity();
}

template class WideProbes<float>;
template class WideProbes<double>;

}  // namespace kbvh
