// The barrier of the simulator: closest points against exact distances, derivatives against differences of
// energies, and projected Hessians against their definition.
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <array>
#include <cmath>
#include <map>

#include "core/broad_phase/element_distance.hpp"
#include "experiments/loop/barrier.hpp"
#include "experiments/loop/elasticity.hpp"
#include "experiments/loop/friction.hpp"
#include "tests/support/random.hpp"

namespace kbvh::experiments::loop {
namespace barrier_test {

using kbvh::test::Random;

constexpr ContactKind both_kinds[] = {ContactKind::face_vertex, ContactKind::edge_edge};

double number(Random& random) {
  return random.unit();
}
double between(Random& random, double low, double high) {
  return low + (high - low) * 0.5 * (random.unit() + 1);
}

FourPoints some_points(Random& random) {
  FourPoints points;
  for (int i = 0; i < 4; ++i)
    for (int axis = 0; axis < 3; ++axis) points(axis, i) = number(random);
  return points;
}

bool is_near(ContactKind kind, const FourPoints& x, double distance) {
  const double* p[4];
  for (int i = 0; i < 4; ++i) p[i] = x.data() + 3 * i;
  if (kind == ContactKind::edge_edge) {
    const double *a[3] = {p[0], p[1], nullptr}, *b[3] = {p[2], p[3], nullptr};
    return is_within(CandidateKind::edge_edge, a, b, distance);
  }
  const double *a[3] = {p[1], p[2], p[3]}, *b[3] = {p[0], nullptr, nullptr};
  return is_within(CandidateKind::face_vertex, a, b, distance);
}

TEST(ClosestPoints, HaveTheExactDistance) {
  Random random(1);
  for (const ContactKind kind : both_kinds) {
    std::map<int, int> seen;
    for (int i = 0; i < 20000; ++i) {
      FourPoints x = some_points(random);
      if (i % 4 == 1) x.col(3) = x.col(2) + 0.5 * (x.col(1) - x.col(0));  // parallel edges
      if (i % 4 == 2) x.row(2) *= 1e-3;                                   // nearly in a plane
      if (i % 8 == 3) x.col(1) = x.col(2);                                // a degenerate face
      const ClosestPoints closest = closest_points(kind, x);
      const double distance = std::sqrt(closest.squared_distance);
      ++seen[closest.parameters];
      EXPECT_NEAR(closest.weights.sum(), 0, 1e-14);
      EXPECT_TRUE(closest.difference == Eigen::Vector3d(x * closest.weights));
      EXPECT_TRUE(is_near(kind, x, distance * (1 + 1e-6) + 1e-14)) << i;
      EXPECT_FALSE(distance > 1e-8 && is_near(kind, x, distance * (1 - 1e-6) - 1e-14)) << i;
    }
    for (int parameters = 0; parameters <= 2; ++parameters) EXPECT_GT(seen[parameters], 300) << parameters;
  }
}

TEST(Barrier, IsSmoothAtItsReachAndInfiniteAtItsThickness) {
  const Barrier barrier{0.1, 0.4, 3};
  const auto squared = [](double distance) { return distance * distance; };
  EXPECT_EQ(barrier.energy(squared(0.5)), 0);
  EXPECT_EQ(barrier.energy(squared(7)), 0);
  EXPECT_GT(barrier.energy(squared(0.4999)), 0);
  EXPECT_NEAR(barrier.slope(squared(0.49999)), 0, 1e-6);
  EXPECT_NEAR(barrier.curvature(squared(0.49999)), 0, 1e-1);
  EXPECT_TRUE(std::isinf(barrier.energy(squared(0.1))));
  EXPECT_TRUE(std::isinf(barrier.energy(squared(0.05))));
  double former = 0;
  for (double distance = 0.499; distance > 0.1001; distance -= 0.001) {
    const double energy = barrier.energy(squared(distance)), step = 1e-6;
    EXPECT_GT(energy, former);
    former = energy;
    const auto at = [&](double by) { return squared(distance) + by; };
    EXPECT_NEAR(barrier.slope(at(0)), (barrier.energy(at(step)) - barrier.energy(at(-step))) / (2 * step),
                1e-4 * std::fabs(barrier.slope(at(0))) + 1e-6);
    EXPECT_NEAR(barrier.curvature(at(0)), (barrier.slope(at(step)) - barrier.slope(at(-step))) / (2 * step),
                1e-4 * std::fabs(barrier.curvature(at(0))) + 1e-4);
  }
}

/// A pair that repels, whose closest points are of one kind in a neighbourhood.
struct Sample {
  ContactKind kind;
  FourPoints points;
  Fading fading;
};

bool same_feature(const Sample& sample, const FourPoints& other) {
  const ClosestPoints a = closest_points(sample.kind, sample.points), b = closest_points(sample.kind, other);
  return a.parameters == b.parameters &&
         (a.weights.array() == 0).matrix() == (b.weights.array() == 0).matrix();
}

const Barrier tested_barrier{0.05, 0.6, 2};

/// Calls test(sample) for many samples of each feature, with and without fading.
template <class Test>
void for_samples(int wanted, const Test& test) {
  Random random(2);
  std::map<std::array<int, 3>, int> seen;  // kind, parameters, fades
  for (int i = 0; i < 200000; ++i) {
    Sample sample{both_kinds[i % 2], some_points(random), {}};
    const bool fades = i % 4 == 1;
    if (fades) {
      // Edges at a small angle, whose area is below the bound.
      FourPoints& x = sample.points;
      for (int axis = 0; axis < 3; ++axis)
        x(axis, 3) = x(axis, 2) + 0.8 * (x(axis, 1) - x(axis, 0)) + 0.1 * number(random);
      const Eigen::Vector3d u = x.col(1) - x.col(0), v = x.col(3) - x.col(2);
      const double area = u.squaredNorm() * v.squaredNorm() - u.dot(v) * u.dot(v);
      sample.fading.below = area / between(random, 0.2, 0.9);
    }
    const double squared = closest_points(sample.kind, sample.points).squared_distance;
    const double s = tested_barrier.closeness(squared);
    if (s < 0.02 || s > 0.95) continue;
    bool steady = true;
    for (int k = 0; k < 12; ++k)
      for (const double step : {-1e-3, 1e-3}) {
        FourPoints other = sample.points;
        other.data()[k] += step;
        steady = steady && same_feature(sample, other);
      }
    if (!steady) continue;
    int& count = seen[{int(sample.kind), closest_points(sample.kind, sample.points).parameters, fades}];
    if (count++ < wanted) test(sample);
  }
  for (const int kind : {0, 1})
    for (const int parameters : {0, 1, 2})
      for (const int fades : {0, 1}) {
        if (kind == 0 && fades == 1) continue;
        const int count = seen[std::array{kind, parameters, fades}];
        EXPECT_GE(count, 20) << kind << parameters << fades;
      }
}

TEST(Barrier, GradientIsThatOfDifferences) {
  for_samples(100, [](const Sample& sample) {
    PairForce force;
    pair_force(tested_barrier, sample.kind, sample.points, sample.fading, Curvature::exact, force);
    EXPECT_DOUBLE_EQ(force.energy, pair_energy(tested_barrier, sample.kind, sample.points, sample.fading));
    constexpr double step = 1e-5;
    for (int k = 0; k < 12; ++k) {
      FourPoints less = sample.points, more = sample.points;
      less.data()[k] -= step;
      more.data()[k] += step;
      const double difference = (pair_energy(tested_barrier, sample.kind, more, sample.fading) -
                                 pair_energy(tested_barrier, sample.kind, less, sample.fading)) /
                                (2 * step);
      EXPECT_NEAR(force.gradient[k], difference, 1e-5 * force.gradient.norm() + 1e-7);
    }
  });
}

TEST(Barrier, HessianIsThatOfDifferences) {
  for_samples(100, [](const Sample& sample) {
    PairForce force, less, more;
    pair_force(tested_barrier, sample.kind, sample.points, sample.fading, Curvature::exact, force);
    EXPECT_LE((force.hessian - force.hessian.transpose()).norm(), 1e-12 * force.hessian.norm());
    constexpr double step = 1e-5;
    for (int k = 0; k < 12; ++k) {
      FourPoints points = sample.points;
      points.data()[k] += step;
      pair_force(tested_barrier, sample.kind, points, sample.fading, Curvature::exact, more);
      points.data()[k] -= 2 * step;
      pair_force(tested_barrier, sample.kind, points, sample.fading, Curvature::exact, less);
      const Vector12 difference = (more.gradient - less.gradient) / (2 * step);
      EXPECT_LE((force.hessian.col(k) - difference).norm(), 1e-4 * force.hessian.norm() + 1e-6);
    }
  });
}

TEST(Barrier, ProjectionLeavesNoNegativeEigenvalue) {
  int changed = 0;
  for_samples(100, [&](const Sample& sample) {
    PairForce exact, projected;
    pair_force(tested_barrier, sample.kind, sample.points, sample.fading, Curvature::exact, exact);
    pair_force(tested_barrier, sample.kind, sample.points, sample.fading, Curvature::positive, projected);
    const Eigen::SelfAdjointEigenSolver<Matrix12> solver(exact.hessian);
    const Matrix12 expected = solver.eigenvectors() * solver.eigenvalues().cwiseMax(0).asDiagonal() *
                              solver.eigenvectors().transpose();
    EXPECT_TRUE(projected.gradient == exact.gradient);
    EXPECT_LE((projected.hessian - expected).norm(), 1e-10 * exact.hessian.norm());
    changed += (exact.hessian - expected).norm() > 1e-3 * exact.hessian.norm() ? 1 : 0;
    // A pair neither pushes nor resists when it is moved as a whole.
    for (int axis = 0; axis < 3; ++axis) {
      Vector12 moved = Vector12::Zero();
      for (int i = 0; i < 4; ++i) moved[3 * i + axis] = 1;
      EXPECT_LE(std::fabs(moved.dot(exact.gradient)), 1e-12 * exact.gradient.norm());
      EXPECT_LE((projected.hessian * moved).norm(), 1e-12 * projected.hessian.norm());
    }
  });
  EXPECT_GT(changed, 50);
}

TEST(Friction, ForceIsThatOfDifferencesAndAtMostItsLimit) {
  Random random(6);
  int sticking = 0, sliding = 0;
  for_samples(30, [&](const Sample& sample) {
    const PairFriction friction =
        pair_friction(tested_barrier, sample.kind, sample.points, sample.fading, 0.4, 0.3);
    PairForce normal;
    pair_force(tested_barrier, sample.kind, sample.points, sample.fading, Curvature::exact, normal);
    // The limit is the coefficient times the force along the normal, which faded edges exert in part.
    if (sample.fading.below == 0) {
      const ClosestPoints closest = closest_points(sample.kind, sample.points);
      EXPECT_NEAR(friction.limit, 0.4 * normal.gradient.norm() / closest.weights.norm(),
                  1e-10 * friction.limit);
    }
    EXPECT_GT(friction.limit, 0);
    const FourPoints moved = 0.5 * some_points(random);
    PairForce force, less, more;
    friction_force(friction, moved, force);
    const Eigen::Vector3d relative = moved * friction.weights;
    const double length = (friction.tangents.transpose() * relative).norm();
    ++(length < friction.slip ? sticking : sliding);
    EXPECT_LE(force.gradient.norm(), friction.limit * friction.weights.norm() * (1 + 1e-12));
    EXPECT_GE(force.gradient.dot(Eigen::Map<const Vector12>(moved.data())), 0);  // takes energy away
    EXPECT_EQ(force.energy, friction_energy(friction, moved));
    constexpr double step = 1e-6;
    if (std::fabs(length - friction.slip) < 1e-4) return;
    for (int k = 0; k < 12; ++k) {
      FourPoints points = moved;
      points.data()[k] += step;
      friction_force(friction, points, more);
      points.data()[k] -= 2 * step;
      friction_force(friction, points, less);
      EXPECT_NEAR(force.gradient[k], (more.energy - less.energy) / (2 * step), 1e-6 * friction.limit);
      const Vector12 difference = (more.gradient - less.gradient) / (2 * step);
      EXPECT_LE((force.hessian.col(k) - difference).norm(), 1e-5 * friction.limit / friction.slip);
    }
    const Eigen::SelfAdjointEigenSolver<Matrix12> solver(force.hessian);
    EXPECT_GE(solver.eigenvalues()[0], -1e-12 * force.hessian.norm());
  });
  EXPECT_GT(sticking, 30);
  EXPECT_GT(sliding, 30);
}

TEST(Elasticity, ForcesAreThoseOfDifferences) {
  MeshBuilder builder;
  builder.add_cloth({5, {0, 0, 0}, {1, 0, 0}, {0, 1.3, 0}}, {0.2, 50, 0.7});
  const SimulatedMesh mesh = builder.finish();
  EXPECT_NEAR(hinge_energy(mesh, mesh.positions), 0, 1e-20);
  EXPECT_NEAR(spring_energy(mesh, mesh.positions), 0, 1e-20);
  Random random(3);
  Positions x = mesh.positions;
  for (Eigen::Index i = 0; i < x.size(); ++i) x.data()[i] += 0.1 * number(random);
  NewtonSystem system(mesh);
  add_springs(mesh, x, 1, system);
  add_hinges(mesh, x, 1, system);
  constexpr double step = 1e-6;
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    Positions less = x, more = x;
    less.data()[i] -= step;
    more.data()[i] += step;
    const double difference = (spring_energy(mesh, more) + hinge_energy(mesh, more) -
                               spring_energy(mesh, less) - hinge_energy(mesh, less)) /
                              (2 * step);
    EXPECT_NEAR(system.gradient()[i], difference, 1e-5 * system.gradient().norm());
  }
  // Bending energy does not change where a bent cloth is turned around.
  Positions turned(x.rows(), 3);
  for (Eigen::Index v = 0; v < x.rows(); ++v) turned.row(v) << x(v, 1), x(v, 2) + 5, x(v, 0) - 3;
  EXPECT_NEAR(hinge_energy(mesh, turned), hinge_energy(mesh, x), 1e-9 * hinge_energy(mesh, x));
}

TEST(Elasticity, ACylinderHasItsBendingEnergy) {
  // A sheet of 1 m x 1 m, rolled to a radius of 2 m. Squares stay plane, so that only edges along the axis
  // bend. Each of them stands for a third of the area of its triangles: the energy is three times
  // bending / 2 * curvature^2 * area, of all columns but the two at the border.
  MeshBuilder builder;
  constexpr double bending = 0.3, radius = 2;
  builder.add_cloth({41, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {0.2, 50, bending});
  const SimulatedMesh mesh = builder.finish();
  Positions x = mesh.positions;
  for (Eigen::Index v = 0; v < x.rows(); ++v) {
    const double angle = x(v, 0) / radius;
    x(v, 0) = radius * std::sin(angle);
    x(v, 2) = radius * (1 - std::cos(angle));
  }
  const double expected = 3 * bending / 2 / (radius * radius) * 39 / 40;
  EXPECT_NEAR(hinge_energy(mesh, x), expected, 0.001 * expected);
}

}  // namespace barrier_test
}  // namespace kbvh::experiments::loop
