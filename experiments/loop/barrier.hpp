#pragma once
#include <Eigen/Core>
#include <cstdint>

#include "experiments/loop/closest_points.hpp"

namespace kbvh::experiments::loop {

using Vector12 = Eigen::Matrix<double, 12, 1>;
using Matrix12 = Eigen::Matrix<double, 12, 12>;

/// The barrier of incremental potential contact (Li et al. 2020), with a thickness (Li, Kaufman, Jiang 2021).
/// With s = (distance^2 - thickness^2) / ((thickness + reach)^2 - thickness^2), the energy of a pair is
/// -scale (s - 1)^2 ln s for 0 < s < 1: zero from thickness + reach on, twice continuously differentiable,
/// and infinite at the thickness.
struct Barrier {
  double thickness, reach;  ///< m
  double scale;             ///< J

  double radius() const { return thickness + reach; }
  /// Returns s. `squared_distance` in m^2.
  double closeness(double squared_distance) const {
    return (squared_distance - thickness * thickness) / range();
  }
  double range() const { return (2 * thickness + reach) * reach; }  ///< m^2
  /// Return the energy and its first two derivatives by the squared distance. The energy is infinite below
  /// s = `least_closeness`, so that no rounding carries a pair across the thickness.
  double energy(double squared_distance) const;
  double slope(double squared_distance) const;
  double curvature(double squared_distance) const;

  static constexpr double least_closeness = 1e-9;
};

/// The part of a pair's rest shape that the barrier uses: for two edges, the squared area of the
/// parallelogram that they span, below which the energy fades out. Without it, forces would jump where two
/// edges are parallel. 0: never.
struct Fading {
  double below = 0;  ///< m^4
};
/// Returns the fading of two edges with these lengths at rest, in m.
inline Fading fading_of_edges(double first, double second) {
  return {1e-3 * first * first * second * second};
}

/// Returns the energy of a pair in J.
double pair_energy(const Barrier& barrier, ContactKind kind, const FourPoints& points, const Fading& fading);

/// Whether a Hessian is that of the energy, or the nearest one (in the Frobenius norm) without negative
/// eigenvalues, so that sums of Hessians have none either.
enum class Curvature : std::uint8_t { exact, positive };

struct PairForce {
  double energy;      ///< J
  Vector12 gradient;  ///< J/m, by the coordinates of the points in their order
  Matrix12 hessian;   ///< J/m^2
};

/// Computes energy, gradient and Hessian of a pair that is nearer than thickness + reach and farther apart
/// than the thickness.
void pair_force(const Barrier& barrier, ContactKind kind, const FourPoints& points, const Fading& fading,
                Curvature curvature, PairForce& force);

}  // namespace kbvh::experiments::loop
