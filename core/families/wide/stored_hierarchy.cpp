#include "core/families/wide/stored_hierarchy.hpp"

namespace kbvh {

template <class S, class Count>
FixedPlansHierarchyStrategy<S, Count>::FixedPlansHierarchyStrategy(const SceneView<S>& scene,
                                                                   const SampledMotion<S>& motion,
                                                                   Topologies topologies,
                                                                   const Params& /*params*/,
                                                                   KernelSet kernels)
    : CountedStrategy<S, Count>(scene, motion), near_bodies_(scene.pairs(), scene.body_count()) {
  hierarchies_.resize(scene.body_count());
  for (std::uint32_t body = 0; body < scene.body_count(); ++body)
    hierarchies_[body].assign(std::move(topologies[body]), scene.primitives(body), kernels);
  check_layouts(
      scene.pairs(), [&](std::uint32_t body) -> const auto& { return hierarchies_[body]; });
}

template <class S, class Count>
FixedPlansHierarchyStrategy<S, Count>::~FixedPlansHierarchyStrategy() = default;

template class FixedPlansHierarchyStrategy<float, Counting>;
template class FixedPlansHierarchyStrategy<double, Counting>;
template class StoredHierarchyStrategy<float, Counting>;
template class StoredHierarchyStrategy<double, Counting>;
#ifndef KBVH_COUNTING_ONLY
template class FixedPlansHierarchyStrategy<float, Silent>;
template class FixedPlansHierarchyStrategy<double, Silent>;
template class StoredHierarchyStrategy<float, Silent>;
template class StoredHierarchyStrategy<double, Silent>;
#endif

}  // namespace kbvh
