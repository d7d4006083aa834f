#pragma once
#include "core/families/wide/kernels/wide_layout.hpp"
#include "core/kernels/kernel_tables.hpp"

namespace kbvh {

enum class KernelSet : std::uint8_t;

/// Kernels on the vertices that realise the boxes of a wide hierarchy. `realisers` is [node][6][width] like
/// `WideArrays::child_bounds`: the index of the coordinate in an array of positions, 3 * vertex + axis; any
/// readable index for empty lanes.
template <class S>
struct WideRealiserKernels {
  /// Computes the boxes of the nodes [begin, end) at `positions`, the last first, into
  /// `hierarchy.node_bounds`; neither reads nor writes its `child_bounds`. `lost[node]`: bit row * width +
  /// lane is set if the realiser does not realise the side there. Children that are nodes must be current or
  /// lie in the range, too.
  using Check = void (*)(WideArrays<S> hierarchy, const std::uint32_t* realisers, const S* positions,
                         std::uint64_t* lost, std::uint32_t begin, std::uint32_t end);
  /// Computes values[i] = positions[places[i]].
  using Collect = void (*)(const std::uint32_t* places, const S* positions, std::size_t count, S* values);
  /// Writes a node's rows and own box from the coordinates of its realisers, [6][width].
  using Place = void (*)(WideArrays<S> hierarchy, const S* values, std::uint32_t node);
  Check check_width[3];  ///< [log2(width) - 1]
  Collect collect;
  Place place_width[3];  ///< [log2(width) - 1]

  static constexpr std::size_t index(std::uint32_t width) { return width == 2 ? 0 : width == 4 ? 1 : 2; }
  Check check(std::uint32_t width) const { return check_width[index(width)]; }
  Place place(std::uint32_t width) const { return place_width[index(width)]; }
};
KBVH_DECLARE_KERNELS(WideRealiserKernels<float>, wide_realisers_float)
KBVH_DECLARE_KERNELS(WideRealiserKernels<double>, wide_realisers_double)

/// Returns the kernels of one instruction set.
template <class S>
const WideRealiserKernels<S>& wide_realiser_kernels(KernelSet set);
template <>
const WideRealiserKernels<float>& wide_realiser_kernels(KernelSet set);
template <>
const WideRealiserKernels<double>& wide_realiser_kernels(KernelSet set);

}  // namespace kbvh
