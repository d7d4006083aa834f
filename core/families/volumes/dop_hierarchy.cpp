#include "core/families/volumes/dop_hierarchy.hpp"

#include <algorithm>
#include <array>

namespace kbvh {
namespace {

/// Constants of the padded slabs of a k-DOP.
template <class S, int K>
struct DopSlabs {
  static constexpr std::size_t slabs = padded_sides(K) / 2;
  std::array<S, 3 * slabs> directions{};
  std::array<S, slabs>
      margins{};  ///< relative to the largest coordinate: 2^-23 (float) or 2^-52 times twice the terms

  constexpr DopSlabs() {
    for (std::size_t slab = 0; slab < Dop<S, K>::slabs; ++slab) {
      int terms = 0;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const int n = Dop<S, K>::directions[slab][axis];
        directions[axis * slabs + slab] = S(n);
        terms += n != 0 ? 1 : 0;
      }
      if (terms > 1) margins[slab] = S(2 * terms) * std::numeric_limits<S>::epsilon();
    }
  }
};

template <class S, int K>
constexpr DopSlabs<S, K> dop_slabs{};

}  // namespace

template <class S, int K>
DopHierarchy<S, K>::DopHierarchy(Topology topology, const Primitives& primitives, Cover cover,
                                 KernelSet kernels)
    : kernels_(&dop_kernels<S>(kernels)), cover_(cover) {
  assign(std::move(topology), primitives);
}

template <class S, int K>
void DopHierarchy<S, K>::assign(Topology topology, const Primitives& primitives) {
  topology_ = std::move(topology);
  primitives_ = &primitives;
  LeafVertices lists = points_of_leaves(topology_, primitives, cover_);
  nodes_.clear();
  for (std::uint32_t node = 0; node < topology_.size(); ++node) {
    const TopologyNode content = topology_.nodes[node];
    if (content.is_leaf())
      nodes_.push_back({lists.offsets[node], lists.offsets[node + 1], true});
    else
      nodes_.push_back({content.first(), content.first() + content.count(), false});
  }
  points_ = std::move(lists.vertices);
  point_count_ = 0;
  for (const std::uint32_t point : points_) point_count_ = std::max(point_count_, point + 1);
  sides_.assign(padded * topology_.size(), 0);
  corners_.resize(cover_ == Cover::boxes ? std::size_t(3) * corners_each * primitives.count() : 0);
}

template <class S, int K>
void DopHierarchy<S, K>::refit(const S* positions) {
  if (cover_ == Cover::boxes) place_corners(topology_, *primitives_, positions, corners_.data());
  constexpr const DopSlabs<S, K>& slabs = dop_slabs<S, K>;
  const S* const points = cover_ == Cover::boxes ? corners_.data() : positions;
  const S reach = kernels_->reach(points, std::size_t(3) * point_count_);
  std::array<S, padded / 2> margins;
  for (std::size_t slab = 0; slab < half; ++slab) margins[slab] = slabs.margins[slab] * reach;
  kernels_->refit(K)({nodes_.data(), std::uint32_t(nodes_.size()), points_.data(), points,
                      slabs.directions.data(), margins.data(), sides_.data()});
}

template <class S, int K>
typename DopHierarchy<S, K>::Volume DopHierarchy<S, K>::volume(std::uint32_t node) const {
  Volume volume;
  const S* const sides = sides_.data() + padded * node;
  for (std::size_t slab = 0; slab < Volume::slabs; ++slab) {
    volume.upper[slab] = sides[slab];
    volume.lower[slab] = -sides[half + slab];
  }
  return volume;
}

template <class S, int K>
std::vector<Dop<S, K>> DopHierarchy<S, K>::volumes() const {
  std::vector<Volume> all;
  for (std::uint32_t node = 0; node < topology_.size(); ++node) all.push_back(volume(node));
  return all;
}

template <class S, int K>
std::size_t DopHierarchy<S, K>::bytes() const {
  return topology_.bytes() + nodes_.capacity() * sizeof(DopNode) +
         points_.capacity() * sizeof(std::uint32_t) + (sides_.capacity() + corners_.capacity()) * sizeof(S);
}

template class DopHierarchy<float, 14>;
template class DopHierarchy<float, 18>;
template class DopHierarchy<float, 26>;
template class DopHierarchy<double, 14>;
template class DopHierarchy<double, 18>;
template class DopHierarchy<double, 26>;

}  // namespace kbvh
