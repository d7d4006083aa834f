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
  /// Builds a tree over the boxes that `order` has taken: the same on any number of threads.
  void build(Workers& workers, BuiltTree<S>& tree, CurveOrder<S>& order, const PrimitiveList& list);
  /// Does the same on one thread.
  void build(BuiltTree<S>& tree, CurveOrder<S>& order, const PrimitiveList& list) {
    Workers alone;
    build(alone, tree, order, list);
  }
  std::size_t bytes() const;
  /// Returns the number of partner searches in all builds.
  std::uint64_t searched() const { return searched_; }

  /// A cluster: an initial one, or the union of two.
  struct Cluster {
    std::uint32_t first, second;  ///< its two parts; for an initial cluster, its grain, and unused
    std::uint32_t primitives;
    float surface;
  };
  /// A leaf of the tree: a cluster, and the place of its primitives among the entries.
  struct Leaf {
    std::uint32_t cluster, to;
  };

 private:
  /// Where the next remaining cluster goes, and the next new one; or numbers of both.
  struct Places {
    std::uint32_t left = 0, made = 0;
  };
  struct alignas(cache_line) PartPlaces {
    Places of;
  };

  void start(Workers& workers, std::uint32_t count);
  void merge_all(Workers& workers, KernelSet kernels);
  void find_nearest(Workers& workers, KernelSet kernels);
  void match_others();
  void merge_round(Workers& workers);
  Places merge(std::uint32_t begin, std::uint32_t end, float* const* to_rows, std::uint32_t* to_ids,
               Places to);
  void write(const CurveOrder<S>& order, const Leaf& leaf, std::uint32_t* entries) const;
  float* row(std::size_t side) { return rows_.data() + side * stride_ + most_radius; }
  /// Cuts the active clusters into items of several threads, each of an even number.
  Parts cut() const { return {active_, 4096}; }
  bool shared_by(const Workers& workers) const { return workers.several() && cut().parts() > 1; }

  std::uint32_t radius_, grain_;
  Grains<S> grains_;
  std::vector<Cluster> clusters_;  ///< grains come first
  std::size_t stride_ = 0;
  std::uint32_t active_ = 0, made_ = 0;
  AlignedArray<float> rows_;  ///< of the active clusters, see NearestJob
  std::vector<std::uint32_t> ids_, nearest_;
  LayOutRoom<std::uint32_t> room_;
  std::vector<Leaf> leaves_;
  // Several threads cannot merge in place.
  AlignedArray<float> next_rows_;
  std::vector<std::uint32_t> next_ids_;
  std::vector<PartPlaces> part_places_;
  std::uint64_t searched_ = 0;
};

/// Binned surface-area heuristic (Wald 2007), top down: each range is split at the best of 15 planes on each
/// axis.
template <class S>
class BinnedBuilder {
 public:
  explicit BinnedBuilder(std::uint32_t grain) : grain_(grain) {}
  /// Builds a tree over the boxes that `order` has taken: the same on any number of threads.
  void build(Workers& workers, BuiltTree<S>& tree, CurveOrder<S>& order, const PrimitiveList& list);
  /// Does the same on one thread.
  void build(BuiltTree<S>& tree, CurveOrder<S>& order, const PrimitiveList& list) {
    Workers alone;
    build(alone, tree, order, list);
  }
  std::size_t bytes() const;

  /// A range of items, and their box.
  struct Part {
    std::uint32_t begin, end;
    std::array<float, 8> box;
  };
  /// A leaf of the tree: its items, and the place of their primitives among the entries.
  struct Leaf {
    std::uint32_t begin, end, to;
  };
  /// Items sorted into bins by one thread, as in BinsJob.
  struct alignas(cache_line) Bins {
    float boxes[3][sah_bins][8];
    std::uint32_t counts[3][sah_bins];
  };

 private:
  Part take_items(Workers& workers);

  std::uint32_t grain_;
  Grains<S> grains_;
  std::vector<std::uint32_t> items_;
  LayOutRoom<Part> room_;
  std::vector<Leaf> leaves_;
  std::vector<Bins> part_bins_;  ///< [part of a range]
};

extern template class LocalClusterBuilder<float>;
extern template class LocalClusterBuilder<double>;
extern template class BinnedBuilder<float>;
extern template class BinnedBuilder<double>;

}  // namespace kbvh
