#pragma once
#include <cstdint>
#include <vector>

#include "experiments/loop/simulated_mesh.hpp"

namespace kbvh::experiments::loop {

/// Counts the pairs of triangles without a common vertex that intersect or touch, exactly: the answer is that
/// of real arithmetic on the given numbers. Pairs of triangles of obstacles are left out. It sweeps boxes
/// sorted along an axis and knows nothing of the broad phase that the simulator asks.
class PenetrationCheck {
 public:
  explicit PenetrationCheck(const SimulatedMesh& mesh);
  std::uint64_t intersecting_pairs(const Positions& x);

 private:
  struct Bounds {
    double low[3], high[3];
    std::uint32_t face;
  };
  const SimulatedMesh& mesh_;
  std::vector<std::uint8_t> obstacle_;  // [face]
  std::vector<Bounds> bounds_;
};

}  // namespace kbvh::experiments::loop
