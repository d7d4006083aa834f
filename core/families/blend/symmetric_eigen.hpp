#pragma once
#include <cstddef>
#include <vector>

namespace kbvh {

/// Eigenvalues and eigenvectors of a symmetric matrix, largest eigenvalue first.
struct SymmetricEigen {
  std::vector<double> values;
  std::vector<double> vectors;  ///< [value][size], of length 1
};

/// Decomposes a symmetric matrix [size][size] by Jacobi's method (Golub & Van Loan, s.8.5): rotations make
/// the elements off the diagonal vanish one after the other, until all are below rounding. The elements must
/// be finite. Deterministic. O(size^3) per sweep; about ten sweeps.
SymmetricEigen decompose(std::vector<double> matrix, std::size_t size);

}  // namespace kbvh
