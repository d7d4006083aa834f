#pragma once
#include <cstdint>

#include "experiments/io/animated_mesh.hpp"

/// Bodies whose motion is linear in few modes: their keyframes are sums of few fixed displacements, with
/// coefficients that change over time; and one that is deformed in few places. Made by formula, in any size,
/// deterministic to the last bit on every machine with IEEE doubles (see shapes.hpp). Metres, seconds; z
/// points up. Requests above 2^27 triangles throw io::InputError.
namespace kbvh::scenes {

/// The common parameters of these bodies.
struct ModalConfig {
  std::uint32_t triangles = 2000;  ///< the nearest number that the pattern allows is made
  std::uint64_t seed = 1;
  std::uint32_t keyframes = 60;
};

/// Makes a closed surface that morphs between four targets: a sphere with bumps at seeded places, a star, a
/// dumbbell, and a rounded cube, all about 0.5 m in radius. The weights are convex and change smoothly; the
/// motion has three modes, up to the rounding of positions.
io::AnimatedMesh morphing_ball(const ModalConfig& config);

/// Makes a square plate of 2 m, held at its rim, that vibrates in its eight lowest modes, each with a seeded
/// amplitude and phase; the frequencies are those of a thin plate, and higher modes are damped faster.
io::AnimatedMesh vibrating_plate(const ModalConfig& config);

/// Makes a square sheet of 2 m that gets dents at seeded places, one after the other: at any time only the
/// vertices within 0.25 m of one place move, a twentieth of the sheet. A dent takes six keyframes.
io::AnimatedMesh dented_sheet(const ModalConfig& config);

}  // namespace kbvh::scenes
