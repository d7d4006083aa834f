#pragma once
#include <cstdint>
#include <vector>

#include "experiments/loop/simulated_mesh.hpp"

namespace kbvh::experiments::loop {

/// Where a joint has carried its body: x becomes rotation * x + shift.
struct Pose {
  Eigen::Matrix3d rotation;
  Eigen::Vector3d shift;  ///< m
};

/// Computes the poses of all joints at a time in s; at 0 each is the identity. `poses` is replaced.
void pose_joints(const std::vector<Joint>& joints, double time, std::vector<Pose>& poses);

/// Places the vertices of a mesh that follow its joints. Their places depend on the time alone, so a
/// continued run needs no more than the number of its step.
class ScriptPlayer {
 public:
  /// Keeps a reference to the mesh.
  explicit ScriptPlayer(const SimulatedMesh& mesh);
  /// Writes the rows of driven vertices at a time in s, and leaves all others.
  void place(double time, Positions& x);
  /// Returns the largest distance of a driven vertex to its row of `places`, in m.
  double largest_distance(const Positions& x, const Positions& places) const;
  const std::vector<std::uint32_t>& driven() const { return driven_; }  ///< ascending

 private:
  const SimulatedMesh& mesh_;
  std::vector<std::uint32_t> driven_;
  std::vector<Pose> poses_;
};

}  // namespace kbvh::experiments::loop
