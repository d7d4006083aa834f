#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "core/families/build/built_tree.hpp"
#include "core/families/build/grains.hpp"
#include "core/families/build/kernels/clusters.hpp"

namespace kbvh {

/// Parallel locally-ordered clustering (Meister & Bittner 2018): clusters in the order of a curve search
/// their best partner among their next neighbours on each side; those that choose each other become one
/// cluster, until one is left. If hardly any choose each other, others merge, too, so that the time after the
/// sort is O(n) for any boxes.
template <class S>
class LocalClusterBuilder {
 public:
  /// `radius`, the number of neighbours searched on each side, is 8 or 16; `grain` is the number of
  /// primitives in an initial cluster.
  LocalClusterBuilder(std::uint32_t radius, std::uint32_t grain) : radius_(radius), grain_(grain) {}
  void build(BuiltTree<S>& tree, CurveOrder<S>& order, const PrimitiveList& list);
  std::size_t bytes() const;
  /// Returns the number of partner searches in all builds.
  std::uint64_t searched() const { return searched_; }

  /// A cluster: an initial one, or the union of two.
  struct Cluster {
    std::uint32_t first, second;  ///< its two parts; for an initial cluster, its grain, and unused
    std::uint32_t primitives;
    float surface;
  };

 private:
  void start(std::uint32_t count);
  void merge_all(KernelSet kernels);
  void match();
  std::uint32_t merge_round();
  float* row(std::size_t row) { return rows_.data() + row * stride_ + most_radius; }

  std::uint32_t radius_, grain_;
  Grains<S> grains_;
  std::vector<Cluster> clusters_;  ///< grains come first
  std::size_t stride_ = 0;
  std::uint32_t active_ = 0, made_ = 0;
  AlignedArray<float> rows_;  ///< of the active clusters, see NearestJob
  std::vector<std::uint32_t> ids_, nearest_, partner_, parts_, open_;
  std::uint64_t searched_ = 0;
};

/// Binned surface-area heuristic (Wald 2007), top down: each range is split at the best of 15 planes on each
/// axis.
template <class S>
class BinnedBuilder {
 public:
  explicit BinnedBuilder(std::uint32_t grain) : grain_(grain) {}
  void build(BuiltTree<S>& tree, CurveOrder<S>& order, const PrimitiveList& list);
  std::size_t bytes() const;

  /// A range of items, and their box.
  struct Part {
    std::uint32_t begin, end;
    std::array<float, 8> box;
  };

 private:
  std::uint32_t grain_;
  Grains<S> grains_;
  std::vector<std::uint32_t> items_;
  std::vector<Part> parts_;
};

extern template class LocalClusterBuilder<float>;
extern template class LocalClusterBuilder<double>;
extern template class BinnedBuilder<float>;
extern template class BinnedBuilder<double>;

}  // namespace kbvh
