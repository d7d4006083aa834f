#pragma once
#include <cstdint>
#include <utility>
#include <vector>

#include "core/families/volumes/kernels/lane_pair.hpp"
#include "core/families/volumes/lane_query.hpp"
#include "core/kernels/kernel_set.hpp"

namespace kbvh {

/// What the hierarchies of spheres and of oriented boxes share: a tree of eight lanes, whose volumes are
/// numbers in rows, one row of lanes for each number of a node's children. `Layout` names the volume and its
/// kernels, says how many numbers volumes have in rows and nodes have for their own volumes, and in which
/// order: Layout::visit(volume, visitor) calls visitor(row, number) for each number.
template <class S, class Layout>
class LaneVolumes {
 public:
  using Scalar = S;
  using Volume = typename Layout::Volume;
  using Scratch = LaneScratch;

  const Topology& topology() const { return tree_.topology(); }
  bool empty() const { return tree_.empty(); }
  Volume volume(std::uint32_t node) const {
    const bool root = node == 0 && tree_.wide_node(node) != tree_.none;
    const LeafSlot slot = tree_.slot(node);
    const S* const from = root ? own_.data() : rows_.data() + row_scalars * slot.node() + slot.lane();
    const std::size_t stride = root ? 1 : 8;
    Volume volume;
    Layout::visit(volume, [&](std::size_t row, S& number) { number = from[stride * row]; });
    return volume;
  }
  std::vector<Volume> volumes() const {
    std::vector<Volume> all;
    for (std::uint32_t node = 0; node < topology().size(); ++node) all.push_back(volume(node));
    return all;
  }
  void set_volume(std::uint32_t node, const Volume& volume) {
    const LeafSlot slot = tree_.slot(node);
    const std::uint32_t wide = node == 0 ? 0 : tree_.wide_node(node);
    Layout::visit(volume, [&](std::size_t row, S number) {
      if (slot.word != tree_.none) rows_[row_scalars * slot.node() + 8 * row + slot.lane()] = number;
      if (wide != tree_.none) own_[Layout::own * wide + row] = number;
    });
  }
  std::size_t leaf_vertex_count() const { return tree_.leaf_point_count(); }

  /// Appends the pairs of primitives of two bodies, or of one, whose boxes and all volumes above them
  /// overlap. Counts the tests. Returns the number of pairs of nodes that the budget left undone.
  static std::size_t find_pairs(LaneVolumes& a, std::uint32_t body_a, LaneVolumes& b, std::uint32_t body_b,
                                Scratch& scratch, std::uint64_t& tests, const Budget& budget,
                                PairBuffer& out) {
    if (a.empty() || b.empty()) return 0;
    const bool overlap = a.kernels_->overlap(a.own_.data(), b.own_.data());
    LaneSearch<S> search({&a.tree_, a.placed_, body_a}, {&b.tree_, b.placed_, body_b}, a.set_, scratch,
                         budget, tests);
    const LanePair<S> pair{a.tree_.nodes(), b.tree_.nodes(), a.rows_.data(), b.rows_.data(), b.own_.data()};
    const auto step = body_a == body_b ? a.kernels_->within : a.kernels_->traverse;
    const std::size_t pending = search.run(
        overlap, [&](WideTraversal& state) { step(pair, state); }, out);
    tests = search.tests();
    return pending;
  }

 protected:
  static constexpr std::size_t row_scalars = 8 * Layout::rows;

  LaneVolumes(const typename Layout::Kernels& kernels, KernelSet set, Cover cover)
      : kernels_(&kernels), set_(set), cover_(cover) {}
  void assign_tree(Topology topology, const Primitives& primitives) {
    tree_.assign(std::move(topology), primitives, cover_);
    rows_.assign(row_scalars * tree_.node_count(), S(0));
    own_.assign(Layout::own * tree_.node_count(), S(0));
    scratch_.assign(std::size_t(24) * tree_.longest_list(), S(0));
  }
  std::size_t bytes() const {
    return tree_.bytes() + list_.capacity() * sizeof(std::uint32_t) +
           (rows_.capacity() + own_.capacity() + coordinates_.capacity() + scratch_.capacity()) * sizeof(S);
  }

  static_assert(sizeof(typename LaneTree<S>::Range) == 2 * sizeof(std::uint32_t));
  const typename Layout::Kernels* kernels_;
  KernelSet set_;
  LaneTree<S> tree_;
  Cover cover_;
  const S* placed_ = nullptr;
  std::vector<std::uint32_t> list_;  ///< the points of one leaf
  AlignedArray<S> rows_, own_, coordinates_, scratch_;
};

}  // namespace kbvh
