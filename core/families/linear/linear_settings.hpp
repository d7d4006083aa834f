#pragma once
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/base/params.hpp"

namespace kbvh {

/// How segments between knots are cut: into pieces of one length, or, where boxes are looser than a bound,
/// into more.
struct SegmentCuts {
  static constexpr std::uint32_t most = 64;
  std::uint32_t pieces = 1;  ///< 1 to `most`
  /// Summed surface of boxes over that of tight ones, minus one, in the middle of a piece, for all bodies
  /// that move; twice as many pieces until it is kept. 0: nobody looks.
  double max_looseness = 0;
};

/// What a strategy with linear bounds can be told.
struct LinearSettings {
  SegmentCuts cuts;
  std::size_t remembered_bytes = 0;  ///< for boxes that are used again when the clip plays again
};

/// The parameters of strategies with linear bounds, and what they say. Throws ConfigError.
std::vector<Parameter> linear_parameters();
LinearSettings linear_settings(const Params& params);

}  // namespace kbvh
