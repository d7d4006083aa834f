#pragma once
#include <cstdint>
#include <limits>

/// The admissible ranges of numbers in plans, bodies and the command line.
namespace kbvh::experiments {

/// Whole numbers from `least` to `most`.
struct WholeRange {
  std::uint64_t least = 0, most = std::numeric_limits<std::uint64_t>::max();
};

namespace ranges {
inline constexpr WholeRange any{}, positive{1};
inline constexpr WholeRange triangles{1, 1u << 27};           ///< of a body
inline constexpr WholeRange keyframes{2, 1000000};            ///< of a built-in scene
inline constexpr WholeRange frames_per_keyframe{1, 1000000};  ///< l
inline constexpr WholeRange repetitions{1, 10000};            ///< timed clips
inline constexpr WholeRange shuffle{0, 0xffffffffu};          ///< seed of the order of contestants
inline constexpr WholeRange width{2, 8};                      ///< children of a node: 2, 4 or 8
inline constexpr WholeRange leaf_size{1, 16};                 ///< maximum number of primitives of a leaf
}  // namespace ranges

}  // namespace kbvh::experiments
