#include "core/families/volumes/sphere_hierarchy.hpp"

#include <algorithm>
#include <cmath>

namespace kbvh {
namespace {

/// The range of coordinates whose squares neither overflow nor lose more than `least` covers.
template <class S>
struct SquareRange {
  static constexpr S least = sizeof(S) == 4 ? S(0x1p-70) : S(0x1p-500);
  static constexpr S smallest = sizeof(S) == 4 ? S(0x1p-40) : S(0x1p-300);
  static constexpr S largest = sizeof(S) == 4 ? S(0x1p60) : S(0x1p400);
};

}  // namespace

template <class S, SphereBounds bounds>
SphereHierarchy<S, bounds>::SphereHierarchy(Topology topology, const Primitives& primitives, Cover cover,
                                            KernelSet kernels)
    : Base(sphere_kernels<S>(kernels), kernels, cover) {
  assign(std::move(topology), primitives);
}

template <class S, SphereBounds bounds>
void SphereHierarchy<S, bounds>::assign(Topology topology, const Primitives& primitives) {
  this->assign_tree(std::move(topology), primitives);
  boxes_.assign(std::size_t(8) * tree_.node_count(), S(0));
  coordinates_.assign(bounds == SphereBounds::wrapped ? 3 * tree_.points().size() : 0, S(0));
}

template <class S, SphereBounds bounds>
void SphereHierarchy<S, bounds>::refit(const S* positions) {
  placed_ = tree_.place(positions);
  if (this->empty()) return;
  const SphereRefit<S> job{
      tree_.nodes(),         tree_.node_count(),    tree_.lists(),         placed_,
      scratch_.data(),       rows_.data(),          own_.data(),           boxes_.data(),
      SquareRange<S>::least, tree_.points().data(), tree_.points().size(), &tree_.ranges()[0].begin,
      coordinates_.data()};
  (bounds == SphereBounds::wrapped ? kernels_->wrapped : kernels_->layered)(job);
  S reach = 0;
  for (std::size_t d = 0; d < 3; ++d) reach = std::max({reach, std::abs(boxes_[d]), std::abs(boxes_[4 + d])});
  if (!(reach >= SquareRange<S>::smallest && reach <= SquareRange<S>::largest)) refit_without_kernels();
}

template <class S, SphereBounds bounds>
void SphereHierarchy<S, bounds>::refit_without_kernels() {
  for (std::uint32_t n = tree_.node_count(); n-- > 0;) {
    const WideNode& node = tree_.nodes()[n];
    Sphere<S> children[8], own;
    for (std::uint32_t lane = 0; lane < node.count; ++lane) {
      if (lane < node.leaf_count) {
        list_.clear();
        for (std::uint32_t i = 0; i < node.length; ++i)
          list_.push_back(tree_.lists()[node.list + 8 * i + list_place(lane, 8)] / 3);
        fit(children[lane], PointSet<S>(list_, placed_));
      } else {
        const S* const child = own_.data() + std::size_t(4) * (node.first_child + lane - node.leaf_count);
        std::copy_n(child, 3, children[lane].centre);
        children[lane].radius = child[3];
      }
    }
    enclose(own, std::span<const Sphere<S>>(children, node.count));
    for (std::uint32_t lane = 0; lane < 8; ++lane) {
      const Sphere<S>& child = children[lane < node.count ? lane : 0];
      S* const rows = rows_.data() + std::size_t(32) * n + lane;
      for (std::size_t d = 0; d < 3; ++d) rows[8 * d] = child.centre[d];
      rows[24] = child.radius;
    }
    std::copy_n(own.centre, 3, own_.data() + std::size_t(4) * n);
    own_[std::size_t(4) * n + 3] = own.radius;
  }
}

template class LaneVolumes<float, SphereLayout<float>>;
template class LaneVolumes<double, SphereLayout<double>>;
template class SphereHierarchy<float, SphereBounds::wrapped>;
template class SphereHierarchy<float, SphereBounds::layered>;
template class SphereHierarchy<double, SphereBounds::wrapped>;
template class SphereHierarchy<double, SphereBounds::layered>;

}  // namespace kbvh
