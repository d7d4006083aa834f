// The linear system of a simulation's step, against a dense one, and when it orders again; the estimate of
// the time that is left.
#include "experiments/loop/newton_system.hpp"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <limits>
#include <memory>
#include <stdexcept>
#include <vector>

#include "experiments/common/steps_left.hpp"
#include "tests/support/random.hpp"

namespace kbvh::experiments::loop {
namespace newton_system_test {

using kbvh::test::Random;

/// A system and the same one as a dense matrix.
class Both {
 public:
  explicit Both(std::uint32_t side) {
    MeshBuilder builder;
    builder.add_cloth({side, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {});
    for (const std::uint32_t v : {0u, 2u, 7u, side * side - 1}) builder.fix(v);
    mesh_ = builder.finish();
    system = std::make_unique<NewtonSystem>(mesh_);
    clear();
  }
  void clear() {
    system->clear();
    const Eigen::Index rows = 3 * mesh_.positions.rows();
    hessian_ = Eigen::MatrixXd::Zero(rows, rows);
    gradient_ = Eigen::VectorXd::Zero(rows);
  }
  std::uint32_t vertices() const { return mesh_.vertex_count(); }

  /// Adds a positive definite block of a vertex, and a gradient.
  void add_mass(std::uint32_t v, Random& random) {
    Eigen::Matrix3d block = Eigen::Matrix3d::Zero();
    for (int i = 0; i < 9; ++i) block.data()[i] = random.unit();
    block = (block * block.transpose() + 0.1 * Eigen::Matrix3d::Identity()).eval();
    system->add_block(v, block);
    hessian_.block<3, 3>(3 * v, 3 * v) += block;
    const Eigen::Vector3d gradient(random.unit(), random.unit(), random.unit());
    system->add_gradient(v, gradient);
    gradient_.segment<3>(3 * v) += gradient;
  }
  /// Adds the energy of a pair: |weights (A x_a - B x_b)|^2 / 2.
  void add_pair(std::uint32_t a, std::uint32_t b, Random& random) {
    Eigen::Matrix3d left, right;
    for (int i = 0; i < 9; ++i) {
      left.data()[i] = random.unit();
      right.data()[i] = random.unit();
    }
    const Eigen::Matrix3d aa = left.transpose() * left, bb = right.transpose() * right,
                          ab = -left.transpose() * right;
    system->add_block(a, aa);
    system->add_block(b, bb);
    system->add_block(a, b, ab);
    hessian_.block<3, 3>(3 * a, 3 * a) += aa;
    hessian_.block<3, 3>(3 * b, 3 * b) += bb;
    hessian_.block<3, 3>(3 * a, 3 * b) += ab;
    hessian_.block<3, 3>(3 * b, 3 * a) += ab.transpose();
  }
  /// Compares the two solutions.
  void expect_equal_solutions() {
    Positions direction;
    system->solve(direction);
    std::vector<Eigen::Index> rows;
    for (std::uint32_t v = 0; v < vertices(); ++v)
      for (Eigen::Index i = 0; i < 3; ++i)
        if (mesh_.fixed[v] == 0) rows.push_back(3 * Eigen::Index(v) + i);
    const auto n = Eigen::Index(rows.size());
    Eigen::MatrixXd hessian(n, n);
    Eigen::VectorXd gradient(n);
    for (Eigen::Index i = 0; i < n; ++i) {
      gradient[i] = gradient_[rows[std::size_t(i)]];
      for (Eigen::Index j = 0; j < n; ++j)
        hessian(i, j) = hessian_(rows[std::size_t(i)], rows[std::size_t(j)]);
    }
    const Eigen::VectorXd expected = hessian.llt().solve(-gradient);
    double slope = 0;
    for (Eigen::Index i = 0; i < n; ++i) {
      EXPECT_NEAR(direction.data()[rows[std::size_t(i)]], expected[i], 1e-9 * (1 + expected.norm())) << i;
      slope += expected[i] * gradient[i];
    }
    for (std::uint32_t v = 0; v < vertices(); ++v)
      if (mesh_.fixed[v] != 0) {
        EXPECT_TRUE(direction.row(v).isZero(0));
      }
    EXPECT_NEAR(system->slope(direction), slope, 1e-9 * (1 + std::fabs(slope)));
  }

  std::unique_ptr<NewtonSystem> system;

 private:
  SimulatedMesh mesh_;
  Eigen::MatrixXd hessian_;
  Eigen::VectorXd gradient_;
};

struct Edge {
  std::uint32_t a, b;
};

TEST(NewtonSystem, SolvesWhatADenseOneSolves) {
  Random random(3);
  Both both(5);
  std::vector<Edge> edges;
  for (int round = 0; round < 40; ++round) {
    both.clear();
    if (round % 10 == 0) both.system->forget_entries();
    // Blocks come and go, several times in one sum, in any order of their vertices.
    if (round % 4 == 3) edges.resize(edges.size() / 2);
    for (int i = 0; i < 20; ++i) {
      const std::uint32_t a = random.below(both.vertices()), b = random.below(both.vertices());
      if (a != b) edges.push_back({a, b});
    }
    for (const Edge& edge : edges) both.add_pair(edge.a, edge.b, random);
    for (std::uint32_t v = 0; v < both.vertices(); ++v) both.add_mass(both.vertices() - 1 - v, random);
    both.expect_equal_solutions();
  }
}

TEST(NewtonSystem, OrdersAnewForNewBlocksOnly) {
  Random random(4);
  Both both(4);
  const auto solve = [&](const std::vector<Edge>& edges) {
    both.clear();
    for (std::uint32_t v = 0; v < both.vertices(); ++v) both.add_mass(v, random);
    for (const Edge& edge : edges) both.add_pair(edge.a, edge.b, random);
    both.expect_equal_solutions();
    return both.system->orders();
  };
  EXPECT_EQ(solve({{1, 3}, {4, 9}}), 1u);
  EXPECT_EQ(solve({{3, 1}, {9, 4}, {1, 3}}), 1u);
  EXPECT_EQ(solve({{4, 9}}), 1u);
  EXPECT_EQ(solve({}), 1u);
  EXPECT_EQ(solve({{4, 9}, {0, 5}}), 1u) << "of a fixed vertex";
  EXPECT_EQ(solve({{8, 9}}), 2u);
  EXPECT_EQ(solve({{1, 3}, {4, 9}, {8, 9}}), 2u) << "blocks of earlier sums are kept";
  both.system->forget_entries();
  EXPECT_EQ(solve({{4, 9}}), 3u);
  EXPECT_EQ(solve({{1, 3}}), 4u);
}

TEST(NewtonSystem, EqualCallsGiveEqualBitsWhateverCameBefore) {
  Positions first, second;
  for (Positions* const out : {&first, &second}) {
    Random random(5);
    Both both(5);
    if (out == &second) {
      for (std::uint32_t v = 0; v < both.vertices(); ++v) both.add_mass(v, random);
      both.add_pair(3, 20, random);
      both.add_pair(4, 21, random);
      both.system->solve(*out);
      random = Random(5);
    }
    both.clear();
    both.system->forget_entries();
    for (std::uint32_t v = 0; v < both.vertices(); ++v) both.add_mass(v, random);
    for (std::uint32_t v = 1; v < both.vertices(); ++v) both.add_pair(v - 1, v, random);
    both.system->solve(*out);
  }
  EXPECT_TRUE(first == second);
}

TEST(NewtonSystem, RefusesWhatIsNotPositive) {
  Random random(6);
  Both both(4);
  for (std::uint32_t v = 0; v < both.vertices(); ++v) both.add_mass(v, random);
  both.system->add_block(5, -1e3 * Eigen::Matrix3d::Identity());
  Positions direction;
  EXPECT_THROW(both.system->solve(direction), std::runtime_error);
  both.clear();
  for (std::uint32_t v = 0; v < both.vertices(); ++v) both.add_mass(v, random);
  both.system->add_gradient(5, Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN()));
  EXPECT_THROW(both.system->solve(direction), std::runtime_error);
  both.clear();
  for (std::uint32_t v = 0; v < both.vertices(); ++v) both.add_mass(v, random);
  both.expect_equal_solutions();
}

TEST(StepsLeft, FollowsTheStepsOfLate) {
  StepsLeft left;
  EXPECT_LT(left.seconds(), 0);
  double now = 50;
  left.made(1000, now);
  EXPECT_LT(left.seconds(), 0);
  for (std::uint64_t step = 1; step <= 400; ++step) left.made(1000 - step, now += 0.01);
  EXPECT_NEAR(left.seconds(), 600 * 0.01, 1e-9);
  // Steps become ten times as slow.
  for (std::uint64_t step = 401; step <= 500; ++step) left.made(1000 - step, now += 0.1);
  EXPECT_GT(left.seconds(), 500 * 0.08);
  EXPECT_LT(left.seconds(), 500 * 0.1);
  EXPECT_EQ(time_left_in_words(-1), "");
  EXPECT_EQ(time_left_in_words(0), "about 10 s left: ");
  EXPECT_EQ(time_left_in_words(44), "about 40 s left: ");
  EXPECT_EQ(time_left_in_words(200), "about 3 min left: ");
  EXPECT_EQ(time_left_in_words(4 * 3600), "about 4 h left: ");
}

}  // namespace newton_system_test
}  // namespace kbvh::experiments::loop
