#include "core/families/volumes/obb_hierarchy.hpp"

#include <algorithm>

#include "core/families/volumes/obb_triples.hpp"

namespace kbvh {

template <class S>
ObbHierarchy<S>::ObbHierarchy(Topology topology, const Primitives& primitives, Cover cover, KernelSet kernels)
    : Base(obb_kernels<S>(kernels), kernels, cover) {
  assign(std::move(topology), primitives);
}

template <class S>
void ObbHierarchy<S>::assign(Topology topology, const Primitives& primitives) {
  this->assign_tree(std::move(topology), primitives);
  const std::size_t nodes = tree_.node_count(), groups = (nodes + 7) / 8;
  node_axes_.assign(72 * groups, S(0));
  leaf_frames_.assign(24 * nodes, 0);
  node_frames_.assign(24 * groups, 0);
  coordinates_.assign(3 * tree_.points().size(), S(0));
  due_ = 0;
}

template <class S>
void ObbHierarchy<S>::choose_frames() {
  // Lanes without a frame repeat the first point, which every body has.
  std::fill(node_frames_.begin(), node_frames_.end(), tree_.points()[0]);
  for (std::uint32_t n = 0; n < tree_.node_count(); ++n) {
    const auto range = tree_.ranges()[n];
    const auto triple =
        choose_triple<S>(std::span(tree_.points()).subspan(range.begin, range.end - range.begin), placed_);
    for (std::size_t i = 0; i < 3; ++i) node_frames_[24 * (n / 8) + 8 * i + list_place(n % 8, 8)] = triple[i];
    const WideNode& node = tree_.nodes()[n];
    for (std::uint32_t lane = 0; lane < 8 && node.leaf_count != 0; ++lane) {
      list_.clear();
      for (std::uint32_t i = 0; i < node.length; ++i)
        list_.push_back(tree_.lists()[node.list + 8 * i + list_place(lane, 8)]);
      const auto of_leaf = choose_triple<S>(list_, placed_);
      for (std::size_t i = 0; i < 3; ++i)
        leaf_frames_[std::size_t(24) * n + 8 * i + list_place(lane, 8)] = of_leaf[i];
    }
  }
}

template <class S>
void ObbHierarchy<S>::refit(const S* positions) {
  placed_ = tree_.place(positions);
  if (this->empty()) return;
  bool chosen = false;
  if (due_ == 0) {
    choose_frames();
    chosen = true;
    due_ = rule_.every;
  }
  due_ = rule_.every == 0 ? 1 : due_ - 1;
  kernels_->refit({tree_.nodes(), tree_.node_count(), tree_.lists(), placed_, scratch_.data(), rows_.data(),
                   own_.data(), leaf_frames_.data(), node_frames_.data(), node_axes_.data(),
                   tree_.points().data(), tree_.points().size(), &tree_.ranges()[0].begin,
                   coordinates_.data(), rule_.follow || chosen});
}

template <class S>
std::size_t ObbHierarchy<S>::bytes() const {
  return Base::bytes() + (leaf_frames_.capacity() + node_frames_.capacity()) * sizeof(std::uint32_t) +
         node_axes_.capacity() * sizeof(S);
}

template class LaneVolumes<float, ObbLayout<float>>;
template class LaneVolumes<double, ObbLayout<double>>;
template class ObbHierarchy<float>;
template class ObbHierarchy<double>;

}  // namespace kbvh
