#pragma once
#include <cstdint>

#include "experiments/io/animated_mesh.hpp"

/// A curtain and the box that sweeps it. Made by formula, in any size, deterministic to the last bit on every
/// machine with IEEE doubles (see shapes.hpp). Metres, seconds; z points up.
namespace kbvh::scenes {

/// Makes a pleated curtain of 2 m that hangs from z = 2 and swings aside where the box passes. The seed moves
/// its pleats.
io::AnimatedMesh swept_curtain(std::uint32_t triangles, std::uint64_t seed, std::uint32_t keyframes);

/// Makes the box, which crosses the width of the curtain at a constant speed and bites into it.
io::AnimatedMesh sweeping_box(std::uint32_t triangles, std::uint32_t keyframes);

}  // namespace kbvh::scenes
