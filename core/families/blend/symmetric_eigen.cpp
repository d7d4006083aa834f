#include "core/families/blend/symmetric_eigen.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace kbvh {

SymmetricEigen decompose(std::vector<double> matrix, std::size_t size) {
  std::vector<double> basis(size * size, 0);
  for (std::size_t i = 0; i < size; ++i) basis[i * size + i] = 1;
  double largest = 0;
  for (const double x : matrix) largest = std::max(largest, std::abs(x));
  if (largest > 0)
    for (double& x : matrix) x /= largest;  // squares of elements stay in range
  const auto at = [&](std::size_t i, std::size_t j) -> double& { return matrix[i * size + j]; };
  constexpr int most_sweeps = 60;
  for (int sweep = 0; sweep < most_sweeps; ++sweep) {
    double off = 0;
    for (std::size_t i = 0; i < size; ++i)
      for (std::size_t j = i + 1; j < size; ++j) off = std::max(off, std::abs(at(i, j)));
    if (off <= std::numeric_limits<double>::epsilon() / 4) break;
    for (std::size_t p = 0; p < size; ++p)
      for (std::size_t q = p + 1; q < size; ++q) {
        if (at(p, q) == 0) continue;
        const double theta = (at(q, q) - at(p, p)) / (2 * at(p, q));
        const double tangent = std::abs(theta) > 1e150 ? 1 / (2 * theta)
                                                       : (theta < 0 ? -1.0 : 1.0) /
                                                             (std::abs(theta) + std::sqrt(theta * theta + 1));
        const double c = 1 / std::sqrt(tangent * tangent + 1), s = tangent * c;
        for (std::size_t k = 0; k < size; ++k) {
          const double x = at(k, p), y = at(k, q);
          at(k, p) = c * x - s * y;
          at(k, q) = s * x + c * y;
        }
        for (std::size_t k = 0; k < size; ++k) {
          const double x = at(p, k), y = at(q, k);
          at(p, k) = c * x - s * y;
          at(q, k) = s * x + c * y;
        }
        at(p, q) = at(q, p) = 0;
        for (std::size_t k = 0; k < size; ++k) {
          const double x = basis[p * size + k], y = basis[q * size + k];
          basis[p * size + k] = c * x - s * y;
          basis[q * size + k] = s * x + c * y;
        }
      }
  }
  std::vector<std::size_t> order(size);
  std::iota(order.begin(), order.end(), std::size_t(0));
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return at(a, a) > at(b, b); });
  SymmetricEigen result;
  result.vectors.reserve(size * size);
  for (const std::size_t i : order) {
    result.values.push_back(at(i, i) * (largest > 0 ? largest : 1));
    result.vectors.insert(result.vectors.end(), basis.begin() + std::ptrdiff_t(i * size),
                          basis.begin() + std::ptrdiff_t((i + 1) * size));
  }
  return result;
}

}  // namespace kbvh
