#pragma once
#include <Eigen/OrderingMethods>
#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>
#include <cstdint>
#include <vector>

#include "experiments/loop/simulated_mesh.hpp"

namespace kbvh::experiments::loop {

/// The linear system of an iteration of Newton's method: gradient and Hessian of an energy by the coordinates
/// of the vertices that are not fixed. Sums are in the order of the calls, so equal calls give equal bits.
///
/// The Hessian keeps every block that an earlier sum had since `forget_entries`, as zeros if need be. Only a
/// new block needs a new order of elimination and a new symbolic factorisation, which allocate. Everything
/// else reuses its memory, except Eigen's numeric factorisation, which allocates and frees an array of
/// indices and, if these are too large for its stack, three arrays of one number a row.
class NewtonSystem {
 public:
  explicit NewtonSystem(const SimulatedMesh& mesh);

  /// Starts a new sum at zero.
  void clear();
  /// Starts as if there had been no sum yet: all that follows depends only on the calls from here on.
  void forget_entries() { pattern_.clear(); }
  void add_gradient(std::uint32_t vertex, const Eigen::Vector3d& gradient) {
    if (const std::int32_t block = block_of_[vertex]; block >= 0) gradient_.segment<3>(3 * block) += gradient;
  }
  /// Adds a symmetric block of a vertex.
  void add_block(std::uint32_t vertex, const Eigen::Matrix3d& block);
  /// Adds the block of one vertex's rows and another one's columns, and its transpose in the mirrored place.
  void add_block(std::uint32_t row, std::uint32_t column, const Eigen::Matrix3d& block);

  /// Solves Hessian * direction = -gradient by a sparse Cholesky factorisation, where every vertex that is
  /// not fixed needs a block of its own. Rows of fixed vertices are zero. Throws std::runtime_error if the
  /// Hessian is not positive definite or holds an invalid number.
  void solve(Positions& direction);

  const Eigen::VectorXd& gradient() const { return gradient_; }
  /// Returns the derivative of the energy along a direction.
  double slope(const Positions& direction) const;
  /// Returns how many orders of elimination were computed.
  std::uint64_t orders() const { return orders_; }
  /// Returns the memory in bytes, the factor included.
  std::size_t bytes() const;

 private:
  using Matrix = Eigen::SparseMatrix<double>;
  /// A 3 x 3 block of the lower triangle; sorted by keys, blocks are sorted by columns, then by rows.
  struct Entry {
    std::uint64_t key;
    Eigen::Matrix3d block;
  };
  /// Where the values of a block lie in the Hessian: column j of it begins at
  /// first + j * stride + j (j + 1) / 2.
  struct Slot {
    int first, stride;
    enum class Shape : std::uint8_t { diagonal, straight, transposed } shape;
  };
  static std::uint64_t key_of(std::int32_t row, std::int32_t column) {
    return std::uint64_t(column) << 32 | std::uint32_t(row);
  }
  static std::size_t row_of(std::uint64_t key) { return std::size_t(key & 0xffffffffu); }
  static std::size_t column_of(std::uint64_t key) { return std::size_t(key >> 32); }
  void sort_entries();
  /// Adds the blocks of the entries to the pattern. Returns whether one of them is new.
  bool extend_pattern();
  void order_blocks();
  void place_blocks();
  void sum_entries();

  std::vector<std::int32_t> block_of_;  // [vertex] number among vertices that are not fixed, or -1
  std::int32_t blocks_ = 0;
  Eigen::VectorXd gradient_, solution_;
  std::vector<Entry> entries_;
  std::vector<std::uint32_t> order_, spare_order_, counts_;       // of entries, stable by key
  std::vector<std::uint64_t> present_, pattern_, spare_pattern_;  // ascending keys
  std::vector<int> place_;                                        // [block] in the order of elimination
  std::vector<Slot> slots_;                                       // [key of the pattern]
  struct Placed {
    std::uint64_t key;    // of the upper triangle, by places
    std::uint32_t index;  // of the pattern
  };
  std::vector<Placed> placed_;
  Matrix hessian_;  // upper triangle, in the order of elimination
  Eigen::SimplicialLLT<Matrix, Eigen::Upper, Eigen::NaturalOrdering<int>> solver_;
  std::uint64_t orders_ = 0;
};

}  // namespace kbvh::experiments::loop
