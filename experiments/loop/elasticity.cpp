#include "experiments/loop/elasticity.hpp"

#include <algorithm>

namespace kbvh::experiments::loop {
namespace {

Eigen::Vector3d bend(const Hinge& hinge, const Positions& x) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int i = 0; i < 4; ++i) sum += hinge.weights[i] * x.row(hinge.vertices[i]).transpose();
  return sum;
}

}  // namespace

double spring_energy(const SimulatedMesh& mesh, const Positions& x) {
  double energy = 0;
  for (const Spring& spring : mesh.springs) {
    const double stretch = (x.row(spring.a) - x.row(spring.b)).norm() - spring.length;
    energy += 0.5 * spring.stiffness * stretch * stretch;
  }
  return energy;
}

double hinge_energy(const SimulatedMesh& mesh, const Positions& x) {
  double energy = 0;
  for (const Hinge& hinge : mesh.hinges) energy += 0.5 * hinge.stiffness * bend(hinge, x).squaredNorm();
  return energy;
}

void add_springs(const SimulatedMesh& mesh, const Positions& x, double factor, NewtonSystem& system) {
  for (const Spring& spring : mesh.springs) {
    const Eigen::Vector3d along = (x.row(spring.a) - x.row(spring.b)).transpose();
    const double length = along.norm();
    if (length == 0) continue;  // No direction: no force.
    const Eigen::Vector3d unit = along / length;
    const double stiffness = factor * spring.stiffness;
    const Eigen::Vector3d gradient = stiffness * (length - spring.length) * unit;
    const double across = std::max(0.0, 1 - spring.length / length);
    const Eigen::Matrix3d block =
        stiffness * (across * Eigen::Matrix3d::Identity() + (1 - across) * unit * unit.transpose());
    system.add_gradient(spring.a, gradient);
    system.add_gradient(spring.b, -gradient);
    system.add_block(spring.a, block);
    system.add_block(spring.b, block);
    system.add_block(spring.a, spring.b, -block);
  }
}

void add_hinges(const SimulatedMesh& mesh, const Positions& x, double factor, NewtonSystem& system) {
  for (const Hinge& hinge : mesh.hinges) {
    const double stiffness = factor * hinge.stiffness;
    const Eigen::Vector3d sum = stiffness * bend(hinge, x);
    for (int i = 0; i < 4; ++i) {
      const std::uint32_t a = hinge.vertices[i];
      system.add_gradient(a, hinge.weights[i] * sum);
      system.add_block(a, stiffness * hinge.weights[i] * hinge.weights[i] * Eigen::Matrix3d::Identity());
      for (int j = 0; j < i; ++j)
        system.add_block(a, hinge.vertices[j],
                         stiffness * hinge.weights[i] * hinge.weights[j] * Eigen::Matrix3d::Identity());
    }
  }
}

}  // namespace kbvh::experiments::loop
