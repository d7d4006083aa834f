#pragma once
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "core/families/build/kernels/build_wide.hpp"
#include "core/families/build/radix_sort.hpp"
#include "core/families/wide/wide_tree.hpp"
#include "core/parallel/workers.hpp"
#include "core/scene/scene.hpp"

namespace kbvh {

/// The living primitives of a body, and whether all have the same number of corners. Changes only with the
/// geometry.
struct PrimitiveList {
  explicit PrimitiveList(const Primitives& primitives);
  const std::uint32_t* ids() const { return living.empty() ? nullptr : living.data(); }
  std::uint32_t count;
  std::uint32_t corners_each;         ///< 0: it varies
  std::vector<std::uint32_t> living;  ///< empty if all primitives live
  std::size_t bytes() const { return living.capacity() * sizeof(std::uint32_t); }
};

/// The primitives of one body at one time, in the form that builders read: boxes, and the order along a
/// space-filling curve. One object serves all bodies in turn and keeps its memory.
template <class S>
class CurveOrder {
 public:
  /// Computes boxes and centres of all living primitives. O(corners).
  void take(const Primitives& primitives, const PrimitiveList& list, const S* positions, KernelSet kernels);
  /// Does the same on the threads of `workers`.
  void take(Workers& workers, const Primitives& primitives, const PrimitiveList& list, const S* positions,
            KernelSet kernels);
  /// Boxes and centres of all living primitives, to be written by a caller that makes boxes of its own in
  /// place of `take`: as PrimitiveBoxesJob describes them. `primitives` is the number of ids.
  struct Room {
    S *boxes, *centres;
    std::size_t stride;
    S* extent;
  };
  Room room(std::uint32_t primitives, std::uint32_t living, KernelSet kernels);
  /// Sorts the primitives along a curve through the grid over their centres. O(primitives).
  void sort(const PrimitiveList& list, Curve curve);
  /// Sorts to the same order on the threads of `workers`; few primitives on one.
  void sort(Workers& workers, const PrimitiveList& list, Curve curve);

  std::uint32_t count() const { return count_; }
  /// Returns the boxes, [primitive][8]: lower x, y, z, unused, upper x, y, z, unused.
  const S* boxes() const { return boxes_.data(); }
  /// Returns the keys in ascending order of their codes.
  std::span<const std::uint64_t> keys() const { return {keys_.data(), count_}; }
  static std::uint32_t primitive(std::uint64_t key) { return std::uint32_t(key); }
  static std::uint32_t code(std::uint64_t key) { return std::uint32_t(key >> 32); }

  /// Sorts the keys [begin, end), which share one code, along the curve through a grid over their own
  /// centres. Afterwards their codes are comparable only with each other. Returns false, and does nothing, if
  /// all centres are equal. O(n log n).
  bool refine(std::uint32_t begin, std::uint32_t end);
  /// Refines all runs of more than `most` keys with one code, until the only such runs have equal centres.
  void refine_runs(std::uint32_t most);
  /// Does the same, and looks for such runs on the threads of `workers`; refines them on one.
  void refine_runs(Workers& workers, std::uint32_t most);

  std::size_t bytes() const;

 private:
  CurveKeysJob<S> keys_job(const S* extent);
  CurveKeysJob<S> keys_job(const PrimitiveList& list);
  /// Cuts the primitives into items of several threads: full rows of centres for the kernels.
  Parts parts() const { return {count_, 4096}; }

  KernelSet kernels_ = KernelSet::portable;
  std::uint32_t count_ = 0;
  Curve curve_ = Curve::morton;
  AlignedArray<S> boxes_, centres_;
  std::size_t stride_ = 0;
  S extent_[8] = {};
  struct alignas(cache_line) PartExtent {
    S of[8];
  };
  std::vector<PartExtent> part_extents_;
  std::vector<OwnCount> part_runs_;
  std::vector<std::uint64_t> keys_;
  RadixSort radix_;
  // For temporary use by `refine`.
  std::vector<std::uint32_t> ids_;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> runs_;
  AlignedArray<S> few_centres_;
};

extern template class CurveOrder<float>;
extern template class CurveOrder<double>;

}  // namespace kbvh
