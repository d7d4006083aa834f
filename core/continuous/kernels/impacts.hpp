#pragma once
// Internal: the filter of many queries of continuous collision detection, for
// core/continuous/impact_batch.hpp.
#include <cstddef>
#include <cstdint>

#include "core/kernels/kernel_tables.hpp"

namespace kbvh {

/// Queries of one kind, coordinate by coordinate: points [0] to [3] as in MovingPoints. 12 KiB.
struct ImpactBlock {
  static constexpr std::size_t room = 64;    ///< queries; one bit each in masks
  alignas(64) double points[2][4][3][room];  ///< [t = 0, t = 1][point][axis][query]
};

/// Bounds on the filter's rounding errors, whose derivation is in kernels/impacts.cpp. Tests try smaller
/// ones, to see wrong verdicts.
struct ImpactErrors {
  double cubic, least_cubic;          ///< of the cubic: cubic * volume + least_cubic
  double quadratic, least_quadratic;  ///< of normals and shares: quadratic * area + least_quadratic
  double gap;                         ///< of the width of a gap between planes, likewise
};
inline constexpr ImpactErrors impact_errors{56 * 0x1p-53, 1e-190, 16 * 0x1p-53, 1e-300, 16 * 0x1p-53};

/// What the filter proves: no contact, or a first contact strictly inside (begin, begin + 2^-20), where begin
/// is a multiple of 2^-20. Bit i stands for query i.
struct ImpactVerdicts {
  std::uint64_t free = 0, touching = 0;
  double begin[ImpactBlock::room];  ///< only where touching
};

/// Filters the queries whose bits are set. Other places of the block may be read; they must be initialised.
struct ImpactKernels {
  using Decide = void(const ImpactBlock& block, std::uint64_t which, const ImpactErrors& errors,
                      ImpactVerdicts& verdicts);
  Decide* decide_vertex_face;
  Decide* decide_edge_edge;
  /// Returns the queries among `which` whose two elements are proved to be farther apart than `separation`
  /// from t = 0 to `until`. For a separation of 0 the proof is by boxes alone.
  using Apart = std::uint64_t(const ImpactBlock& block, std::uint64_t which, double until, double separation,
                              const ImpactErrors& errors);
  Apart* apart_vertex_face;
  Apart* apart_edge_edge;
};
KBVH_DECLARE_KERNELS(ImpactKernels, impact_kernels)

}  // namespace kbvh
