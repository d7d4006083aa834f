#pragma once
#include <cstddef>
#include <cstdint>

#include "core/kernels/kernel_tables.hpp"

namespace kbvh {

enum class KernelSet : std::uint8_t;

/// Clusters in a row, and the search for the best partner of each. Boxes are in float, for decisions only.
struct NearestJob {
  /// [6][stride]: lower x, y, z, -upper x, y, z of each cluster, with `radius` values of -infinity before
  /// the first and after the last one.
  const float* rows;
  std::size_t stride;
  std::uint32_t count;
  std::uint32_t* nearest;  ///< [cluster]
};
inline constexpr std::uint32_t most_radius = 16;  ///< clusters searched on each side: 8 or 16

/// Boxes that are sorted into bins along all three axes.
struct BinsJob {
  const float* boxes;  ///< [item][8]: lower x, y, z, 0, upper x, y, z, 0
  const std::uint32_t* items;
  std::uint32_t count;
  float lower[4], scale[4];   ///< bin of an item: (lower + upper - this lower) * scale, clamped
  float* bin_boxes;           ///< [axis][bin][8]
  std::uint32_t* bin_counts;  ///< [axis][bin]
};
inline constexpr std::uint32_t sah_bins = 16;

struct ClusterKernels {
  /// Finds for each cluster the partner among the nearest `radius` on each side for which the common box has
  /// the smallest surface, compared without the last few bits. Among equals, cluster 2k takes 2k + 1, then
  /// the next ones on that side; 2k + 1 takes 2k, then the ones before: equal clusters choose each other.
  void (*nearest8)(const NearestJob& job);
  void (*nearest16)(const NearestJob& job);
  void (*bins)(const BinsJob& job);
  /// Moves the items of the bins up to `last_bin` of an axis before the others; returns their number.
  std::uint32_t (*partition)(const BinsJob& job, std::uint32_t* items, std::uint32_t axis,
                             std::uint32_t last_bin);
};
KBVH_DECLARE_KERNELS(ClusterKernels, clusters)

/// Returns the kernels of one instruction set.
const ClusterKernels& cluster_kernels(KernelSet set);

}  // namespace kbvh
