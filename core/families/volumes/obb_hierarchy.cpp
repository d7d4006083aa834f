#include "core/families/volumes/obb_hierarchy.hpp"

#include "core/families/volumes/obb_triples.hpp"

namespace kbvh {

template <class S>
ObbHierarchy<S>::ObbHierarchy(Topology topology, const Primitives& primitives, Cover cover, KernelSet kernels)
    : kernels_(&obb_kernels<S>(kernels)), set_(kernels), cover_(cover) {
  assign(std::move(topology), primitives);
}

template <class S>
void ObbHierarchy<S>::assign(Topology topology, const Primitives& primitives) {
  tree_.assign(std::move(topology), primitives, cover_);
  const std::size_t nodes = tree_.node_count(), groups = (nodes + 7) / 8;
  rows_.assign(8 * obb_rows * nodes, S(0));
  own_.assign(obb_own * nodes, S(0));
  node_axes_.assign(72 * groups, S(0));
  leaf_frames_.assign(24 * nodes, 0);
  node_frames_.assign(24 * groups, 0);
  scratch_.assign(std::size_t(24) * tree_.longest_list(), S(0));
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
  if (empty()) return;
  bool chosen = false;
  if (due_ == 0) {
    choose_frames();
    chosen = true;
    due_ = rule_.every;
  }
  due_ = rule_.every == 0 ? 1 : due_ - 1;
  static_assert(sizeof(typename LaneTree<S>::Range) == 2 * sizeof(std::uint32_t));
  kernels_->refit({tree_.nodes(), tree_.node_count(), tree_.lists(), placed_, scratch_.data(), rows_.data(),
                   own_.data(), leaf_frames_.data(), node_frames_.data(), node_axes_.data(),
                   tree_.points().data(), tree_.points().size(), &tree_.ranges()[0].begin,
                   coordinates_.data(), rule_.follow || chosen});
}

template <class S>
Obb<S> ObbHierarchy<S>::volume(std::uint32_t node) const {
  const bool root = node == 0 && tree_.wide_node(node) != tree_.none;
  const LeafSlot slot = tree_.slot(node);
  const S* const from =
      root ? own_.data() : rows_.data() + std::size_t(8 * obb_rows) * slot.node() + slot.lane();
  const std::size_t stride = root ? 1 : 8;
  Volume volume;
  for (std::size_t i = 0; i < 3; ++i) {
    volume.centre[i] = from[stride * i];
    volume.half[i] = from[stride * (12 + i)];
    for (std::size_t d = 0; d < 3; ++d) volume.axis[i][d] = from[stride * (3 + 3 * i + d)];
  }
  return volume;
}

template <class S>
void ObbHierarchy<S>::set_volume(std::uint32_t node, const Volume& volume) {
  const LeafSlot slot = tree_.slot(node);
  const std::uint32_t wide = node == 0 ? 0 : tree_.wide_node(node);
  const auto put = [&](std::size_t row, S number) {
    if (slot.word != tree_.none)
      rows_[std::size_t(8 * obb_rows) * slot.node() + 8 * row + slot.lane()] = number;
    if (wide != tree_.none) own_[obb_own * wide + row] = number;
  };
  for (std::size_t i = 0; i < 3; ++i) {
    put(i, volume.centre[i]);
    put(12 + i, volume.half[i]);
    for (std::size_t d = 0; d < 3; ++d) put(3 + 3 * i + d, volume.axis[i][d]);
  }
}

template <class S>
std::vector<Obb<S>> ObbHierarchy<S>::volumes() const {
  std::vector<Volume> all;
  for (std::uint32_t node = 0; node < topology().size(); ++node) all.push_back(volume(node));
  return all;
}

template <class S>
std::size_t ObbHierarchy<S>::bytes() const {
  return tree_.bytes() +
         (leaf_frames_.capacity() + node_frames_.capacity() + list_.capacity()) * sizeof(std::uint32_t) +
         (rows_.capacity() + own_.capacity() + node_axes_.capacity() + coordinates_.capacity() +
          scratch_.capacity()) *
             sizeof(S);
}

template <class S>
std::size_t ObbHierarchy<S>::find_pairs(ObbHierarchy& a, std::uint32_t body_a, ObbHierarchy& b,
                                        std::uint32_t body_b, Scratch& scratch, std::uint64_t& tests,
                                        const Budget& budget, PairBuffer& out) {
  if (a.empty() || b.empty()) return 0;
  const bool overlap = a.kernels_->overlap(a.own_.data(), b.own_.data());
  LaneSearch<S> search({&a.tree_, a.placed_, body_a}, {&b.tree_, b.placed_, body_b}, a.set_, scratch, budget,
                       tests);
  const ObbPair<S> pair{a.tree_.nodes(), b.tree_.nodes(), a.rows_.data(), b.rows_.data(), b.own_.data()};
  const auto step = body_a == body_b ? a.kernels_->within : a.kernels_->traverse;
  const std::size_t pending = search.run(
      overlap, [&](WideTraversal& state) { step(pair, state); }, out);
  tests = search.tests();
  return pending;
}

template class ObbHierarchy<float>;
template class ObbHierarchy<double>;

}  // namespace kbvh
