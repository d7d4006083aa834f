#pragma once
#include <cstdint>

#include "experiments/io/animated_mesh.hpp"

/// Bodies whose vertices move on parabolas and cubics between keyframes (core/motion/curved_piece.hpp).
/// Metres, seconds; z points up. Deterministic to the last bit like the bodies of shapes.hpp.
namespace kbvh::scenes {

/// Lets the vertices of a mesh move on cubics through its keyframes, without a jump of velocity: Hermite
/// keyframes whose velocities come from the parabola through three neighbouring keyframes (at the ends, from
/// the chord). Positions at keyframes stay. Curves that the mesh had are replaced; with fewer than three
/// keyframes, by the chord.
void smooth(io::AnimatedMesh& mesh);

struct ThrownConfig {
  std::uint32_t triangles = 2000;  ///< the nearest number that the pattern allows is made
  std::uint64_t seed = 1;
  std::uint32_t keyframes = 60;  ///< of the same two seconds; with 2, one segment holds the whole flight
};

/// Makes a sheet of 2 m that is thrown up and falls back in two seconds: gravity for all vertices, a gust of
/// wind that differs from place to place, and its growth. Vertices move on cubics.
io::AnimatedMesh thrown_cloth(const ThrownConfig& config);

/// Makes a ball of separate triangles that bursts in the air for two seconds: each triangle flies on a
/// parabola, braked in proportion to its own speed and drag.
io::AnimatedMesh thrown_shards(const ThrownConfig& config);

}  // namespace kbvh::scenes
