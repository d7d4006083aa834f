#include "experiments/loop/script.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

namespace kbvh::experiments::loop {
namespace {

/// A script begins smoothly within this time, in s: at rest, in the pose of the mesh.
constexpr double ramp_seconds = 0.5;

/// Returns the share of a motion that a script shows at a time, from 0 to 1.
double ramp(double time) {
  const double s = std::clamp(time / ramp_seconds, 0.0, 1.0);
  return s * s * (3 - 2 * s);
}

/// Returns the integral of the ramp, in s.
double ramped_time(double time) {
  if (time >= ramp_seconds) return time - ramp_seconds / 2;
  const double s = time / ramp_seconds;
  return ramp_seconds * s * s * s * (1 - s / 2);
}

}  // namespace

void pose_joints(const std::vector<Joint>& joints, double time, std::vector<Pose>& poses) {
  poses.clear();
  for (const Joint& joint : joints) {
    const double cycle = 2 * std::numbers::pi * time / joint.period;
    const double angle = joint.turn * ramped_time(time) +
                         ramp(time) * (joint.bend + joint.swing * std::sin(cycle + joint.phase));
    const Eigen::Matrix3d rotation = Eigen::AngleAxisd(angle, joint.axis).toRotationMatrix();
    const Eigen::Vector3d shift =
        joint.pivot - rotation * joint.pivot + 0.5 * (1 - std::cos(cycle)) * joint.travel;
    if (joint.parent < 0) {
      poses.push_back({rotation, shift});
    } else {
      const Pose& parent = poses[std::size_t(joint.parent)];
      poses.push_back({parent.rotation * rotation, parent.rotation * shift + parent.shift});
    }
  }
}

ScriptPlayer::ScriptPlayer(const SimulatedMesh& mesh) : mesh_(mesh) {
  for (std::uint32_t v = 0; v < mesh.vertex_count(); ++v)
    if (mesh.is_driven(v)) driven_.push_back(v);
  poses_.reserve(mesh.joints.size());
}

void ScriptPlayer::place(double time, Positions& x) {
  pose_joints(mesh_.joints, time, poses_);
  for (const std::uint32_t v : driven_) {
    const Pose& pose = poses_[std::size_t(mesh_.joint[v])];
    const Eigen::Vector3d at = mesh_.positions.row(v).transpose();
    x.row(v) = (pose.rotation * at + pose.shift).transpose();
  }
}

double ScriptPlayer::largest_distance(const Positions& x, const Positions& places) const {
  double most = 0;
  for (const std::uint32_t v : driven_) most = std::max(most, (x.row(v) - places.row(v)).norm());
  return most;
}

}  // namespace kbvh::experiments::loop
