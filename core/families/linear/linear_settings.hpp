#pragma once
#include <cstdint>
#include <vector>

#include "core/base/params.hpp"

namespace kbvh {

/// The cuts of segments between knots: into pieces of equal length, or into more pieces where boxes exceed a
/// bound on looseness.
struct SegmentCuts {
  static constexpr std::uint32_t most = 64;
  std::uint32_t pieces = 1;  ///< 1 to `most`
  /// The bound on the summed surface of boxes over that of tight boxes, minus one, in the middle of a piece,
  /// for all moving bodies. Pieces are halved until it holds. 0: not measured.
  double max_looseness = 0;
};

/// The settings of a strategy with linear bounds.
struct LinearSettings {
  SegmentCuts cuts;
  /// The number of frames of a segment within which plans change; 0: chosen.
  double horizon = 0;
};

/// Returns the parameters of strategies with linear bounds, or converts their values to settings. Throws
/// ConfigError.
std::vector<Parameter> linear_parameters();
LinearSettings linear_settings(const Params& params);

}  // namespace kbvh
