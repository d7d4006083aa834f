#pragma once
#include <cstdint>
#include <vector>

#include "experiments/io/animated_mesh.hpp"

namespace kbvh::experiments {

/// The placement of a body: scaled, then rotated by each rotation in turn, then translated.
struct Placement {
  struct Rotation {
    double axis[3];  ///< need not be of unit length
    double degrees;
  };
  double scale = 1;
  std::vector<Rotation> rotations;
  double translate[3] = {0, 0, 0};
  bool identity() const;
};

/// Applies a placement to all keyframes, in double. Right angles are exact.
void place(io::AnimatedMesh& mesh, const Placement& placement);

/// Reorders the vertices at random by the seed; the geometry stays the same.
void shuffle_vertices(io::AnimatedMesh& mesh, std::uint64_t seed);

}  // namespace kbvh::experiments
