#pragma once
#include <Eigen/Core>

#include "experiments/loop/barrier.hpp"
#include "experiments/loop/closest_points.hpp"

namespace kbvh::experiments::loop {

/// Coulomb friction of a pair during one step, in the smooth form of Li et al. 2020. The normal force and the
/// tangent plane are those at the start of the step, so that friction has an energy of the displacement since
/// then. Below a displacement of `slip` the force grows smoothly from zero instead of being anything up to
/// its largest value: what should stick creeps by less than `slip` in a step.
struct PairFriction {
  Eigen::Vector4d weights;               ///< of the points in the relative displacement
  Eigen::Matrix<double, 3, 2> tangents;  ///< orthonormal, in columns
  double limit = 0;                      ///< N: coefficient of friction times normal force
  double slip = 0;                       ///< m
};

/// Returns the friction of a pair whose points at the start of a step are given.
PairFriction pair_friction(const Barrier& barrier, ContactKind kind, const FourPoints& begin,
                           const Fading& fading, double coefficient, double slip);

/// Returns the energy in J of displacements of the four points since the start of the step.
double friction_energy(const PairFriction& friction, const FourPoints& displacements);

/// Computes energy, gradient and Hessian, which has no negative eigenvalue.
void friction_force(const PairFriction& friction, const FourPoints& displacements, PairForce& force);

}  // namespace kbvh::experiments::loop
