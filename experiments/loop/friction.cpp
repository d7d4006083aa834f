#include "experiments/loop/friction.hpp"

#include <Eigen/Geometry>
#include <cmath>

namespace kbvh::experiments::loop {

PairFriction pair_friction(const Barrier& barrier, ContactKind kind, const FourPoints& begin,
                           const Fading& fading, double coefficient, double slip) {
  const ClosestPoints closest = closest_points(kind, begin);
  const double distance = std::sqrt(closest.squared_distance);
  const Eigen::Vector3d normal = closest.difference / distance, tangent = normal.unitOrthogonal();
  PairFriction friction;
  friction.weights = closest.weights;
  friction.tangents << tangent, normal.cross(tangent);
  friction.slip = slip;
  // The barrier's force along the normal, reduced by the fading of parallel edges.
  const double share = pair_energy(barrier, kind, begin, fading) / barrier.energy(closest.squared_distance);
  friction.limit = -2 * coefficient * distance * barrier.slope(closest.squared_distance) * share;
  return friction;
}

double friction_energy(const PairFriction& friction, const FourPoints& displacements) {
  const double moved = (friction.tangents.transpose() * (displacements * friction.weights)).norm();
  const double e = friction.slip;
  return friction.limit * (moved >= e ? moved : moved * moved * (1 / e - moved / (3 * e * e)) + e / 3);
}

void friction_force(const PairFriction& friction, const FourPoints& displacements, PairForce& force) {
  const Eigen::Vector2d moved = friction.tangents.transpose() * (displacements * friction.weights);
  const double length = moved.norm(), e = friction.slip;
  force.energy = friction_energy(friction, displacements);
  // The force over the displacement, and how the force changes with the length of the displacement.
  const double ratio = length >= e ? 1 / length : 2 / e - length / (e * e);
  const double change = length >= e ? 0 : 2 / e - 2 * length / (e * e);
  Eigen::Matrix2d stiffness = ratio * Eigen::Matrix2d::Identity();
  if (length > 0) stiffness += (change - ratio) / (length * length) * moved * moved.transpose();
  const Eigen::Vector3d push = friction.limit * ratio * (friction.tangents * moved);
  const Eigen::Matrix3d block =
      friction.limit * friction.tangents * stiffness * friction.tangents.transpose();
  for (int i = 0; i < 4; ++i) {
    force.gradient.segment<3>(3 * i) = friction.weights[i] * push;
    for (int j = 0; j < 4; ++j)
      force.hessian.block<3, 3>(3 * i, 3 * j) = friction.weights[i] * friction.weights[j] * block;
  }
}

}  // namespace kbvh::experiments::loop
