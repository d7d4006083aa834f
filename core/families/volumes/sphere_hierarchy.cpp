#include "core/families/volumes/sphere_hierarchy.hpp"

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
    : kernels_(&sphere_kernels<S>(kernels)), set_(kernels), cover_(cover) {
  assign(std::move(topology), primitives);
}

template <class S, SphereBounds bounds>
void SphereHierarchy<S, bounds>::assign(Topology topology, const Primitives& primitives) {
  tree_.assign(std::move(topology), primitives, cover_);
  const std::size_t nodes = tree_.node_count();
  rows_.assign(32 * nodes, S(0));
  own_.assign(4 * nodes, S(0));
  boxes_.assign(8 * nodes, S(0));
  scratch_.assign(std::size_t(24) * tree_.longest_list(), S(0));
  coordinates_.assign(bounds == SphereBounds::wrapped ? 3 * tree_.points().size() : 0, S(0));
}

template <class S, SphereBounds bounds>
void SphereHierarchy<S, bounds>::refit(const S* positions) {
  placed_ = tree_.place(positions);
  if (empty()) return;
  static_assert(sizeof(typename LaneTree<S>::Range) == 2 * sizeof(std::uint32_t));
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

template <class S, SphereBounds bounds>
Sphere<S> SphereHierarchy<S, bounds>::volume(std::uint32_t node) const {
  Volume volume;
  const bool root = node == 0 && tree_.wide_node(node) != tree_.none;
  const LeafSlot slot = tree_.slot(node);
  const S* const from = root ? own_.data() : rows_.data() + std::size_t(32) * slot.node() + slot.lane();
  const std::size_t stride = root ? 1 : 8;
  for (std::size_t d = 0; d < 3; ++d) volume.centre[d] = from[stride * d];
  volume.radius = from[3 * stride];
  return volume;
}

template <class S, SphereBounds bounds>
void SphereHierarchy<S, bounds>::set_volume(std::uint32_t node, const Volume& volume) {
  const S numbers[4] = {volume.centre[0], volume.centre[1], volume.centre[2], volume.radius};
  const LeafSlot slot = tree_.slot(node);
  const std::uint32_t wide = node == 0 ? 0 : tree_.wide_node(node);
  for (std::size_t row = 0; row < 4; ++row) {
    if (slot.word != tree_.none) rows_[std::size_t(32) * slot.node() + 8 * row + slot.lane()] = numbers[row];
    if (wide != tree_.none) own_[std::size_t(4) * wide + row] = numbers[row];
  }
}

template <class S, SphereBounds bounds>
std::vector<Sphere<S>> SphereHierarchy<S, bounds>::volumes() const {
  std::vector<Volume> all;
  for (std::uint32_t node = 0; node < topology().size(); ++node) all.push_back(volume(node));
  return all;
}

template <class S, SphereBounds bounds>
std::size_t SphereHierarchy<S, bounds>::bytes() const {
  return tree_.bytes() + list_.capacity() * sizeof(std::uint32_t) +
         (rows_.capacity() + own_.capacity() + boxes_.capacity() + coordinates_.capacity() +
          scratch_.capacity()) *
             sizeof(S);
}

template <class S, SphereBounds bounds>
std::size_t SphereHierarchy<S, bounds>::find_pairs(SphereHierarchy& a, std::uint32_t body_a,
                                                   SphereHierarchy& b, std::uint32_t body_b, Scratch& scratch,
                                                   std::uint64_t& tests, const Budget& budget,
                                                   PairBuffer& out) {
  if (a.empty() || b.empty()) return 0;
  const bool overlap = a.kernels_->overlap(a.own_.data(), b.own_.data());
  LaneSearch<S> search({&a.tree_, a.placed_, body_a}, {&b.tree_, b.placed_, body_b}, a.set_, scratch, budget,
                       tests);
  const SpherePair<S> pair{a.tree_.nodes(), b.tree_.nodes(), a.rows_.data(), b.rows_.data(), b.own_.data()};
  const auto step = body_a == body_b ? a.kernels_->within : a.kernels_->traverse;
  const std::size_t pending = search.run(
      overlap, [&](WideTraversal& state) { step(pair, state); }, out);
  tests = search.tests();
  return pending;
}

template class SphereHierarchy<float, SphereBounds::wrapped>;
template class SphereHierarchy<float, SphereBounds::layered>;
template class SphereHierarchy<double, SphereBounds::wrapped>;
template class SphereHierarchy<double, SphereBounds::layered>;

}  // namespace kbvh
