#pragma once
#include "experiments/loop/newton_system.hpp"
#include "experiments/loop/simulated_mesh.hpp"

namespace kbvh::experiments::loop {

/// Returns the energy of all springs in J.
double spring_energy(const SimulatedMesh& mesh, const Positions& x);
/// Returns the energy of all hinges in J.
double hinge_energy(const SimulatedMesh& mesh, const Positions& x);

/// Adds gradient and Hessian of the energy of all springs, times `factor`. Negative eigenvalues of the
/// Hessian of a spring, which a compressed spring has in the directions across it, are set to zero.
void add_springs(const SimulatedMesh& mesh, const Positions& x, double factor, NewtonSystem& system);
/// Adds gradient and Hessian of the energy of all hinges, times `factor`.
void add_hinges(const SimulatedMesh& mesh, const Positions& x, double factor, NewtonSystem& system);

}  // namespace kbvh::experiments::loop
