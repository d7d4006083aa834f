#pragma once
#include <cstdint>

#include "experiments/loop/simulated_mesh.hpp"

namespace kbvh::experiments::loop {

/// Numbers that are equal on every machine (SplitMix64).
class SceneChance {
 public:
  explicit SceneChance(std::uint64_t seed) : state_(seed) {}
  /// Returns a number in [-1, 1).
  double about_zero() {
    std::uint64_t z = state_ += 0x9e3779b97f4a7c15ull;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ull;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebull;
    return double((z ^ (z >> 31)) >> 11) * 0x1p-52 - 1;
  }
  Eigen::Vector3d vector() {
    const double x = about_zero(), y = about_zero(), z = about_zero();
    return {x, y, z};
  }

 private:
  std::uint64_t state_;
};

/// Makes the scene `walker`, of the requested size.
Simulated walker_scene(std::uint64_t triangles, SceneChance& chance);
/// Makes the scene `knot`, of the requested size.
Simulated knot_scene(std::uint64_t triangles, SceneChance& chance);

}  // namespace kbvh::experiments::loop
