#pragma once
#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>
#include <cstdint>
#include <vector>

#include "experiments/loop/simulated_mesh.hpp"

namespace kbvh::experiments::loop {

/// The linear system of an iteration of Newton's method: gradient and Hessian of an energy by the coordinates
/// of the vertices that are not fixed. Sums are in the order of the calls, so equal calls give equal bits.
class NewtonSystem {
 public:
  explicit NewtonSystem(const SimulatedMesh& mesh);

  /// Starts a new sum at zero.
  void clear();
  void add_gradient(std::uint32_t vertex, const Eigen::Vector3d& gradient) {
    if (const std::int32_t at = first_[vertex]; at >= 0) gradient_.segment<3>(at) += gradient;
  }
  /// Adds a symmetric block of a vertex.
  void add_block(std::uint32_t vertex, const Eigen::Matrix3d& block);
  /// Adds the block of rows of one vertex and columns of another one, and its transpose at the other place.
  void add_block(std::uint32_t row, std::uint32_t column, const Eigen::Matrix3d& block);

  /// Solves Hessian * direction = -gradient by a sparse Cholesky factorisation. Rows of fixed vertices are
  /// zero. The fill-reducing order is kept while the Hessian has the same entries. Throws std::runtime_error
  /// if the Hessian is not positive definite or holds an invalid number.
  void solve(Positions& direction);

  const Eigen::VectorXd& gradient() const { return gradient_; }
  /// Returns the derivative of the energy along a direction.
  double slope(const Positions& direction) const;
  /// Returns how often the order of elimination was computed.
  std::uint64_t orders() const { return orders_; }
  std::size_t bytes() const;

 private:
  using Matrix = Eigen::SparseMatrix<double>;

  std::vector<std::int32_t> first_;  // [vertex] first row, or -1
  Eigen::VectorXd gradient_, solution_;
  std::vector<Eigen::Triplet<double>> entries_;  // lower triangle
  Matrix hessian_;
  std::vector<int> columns_, rows_;  // of the Hessian that was ordered last
  Eigen::SimplicialLLT<Matrix, Eigen::Lower> solver_;
  std::uint64_t orders_ = 0;
};

}  // namespace kbvh::experiments::loop
