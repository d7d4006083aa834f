#pragma once
// A cloth that is flat or folded, for programs that compare or count.
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

namespace kbvh::experiments::micro {

/// A cloth of n x n vertices, drawn over six folds whose direction swings by so many radians; 0: flat. From
/// pi / 2 on it hangs over, from about 2.3 on layers cut each other.
inline std::vector<double> folded_cloth(std::uint32_t n, double swing) {
  std::vector<double> v;
  double x = 0, z = 0;
  std::vector<std::pair<double, double>> curve;
  for (std::uint32_t i = 0; i < n; ++i) {
    const double direction = swing * std::sin(2 * 3.14159265358979 * 6 * i / n);
    curve.emplace_back(x += std::cos(direction), z += std::sin(direction));
  }
  for (std::uint32_t row = 0; row < n; ++row)
    for (std::uint32_t i = 0; i < n; ++i) {
      // Wrinkles across the folds, so that no two normals are equal.
      const double wrinkle = swing == 0 ? 0 : 0.15 * std::sin(0.9 * row + 0.3 * i);
      v.insert(v.end(), {curve[i].first, double(row), curve[i].second + wrinkle});
    }
  return v;
}

inline std::vector<std::uint32_t> cloth_faces(std::uint32_t n) {
  std::vector<std::uint32_t> f;
  for (std::uint32_t y = 0; y + 1 < n; ++y)
    for (std::uint32_t x = 0; x + 1 < n; ++x) {
      const std::uint32_t i = y * n + x;
      f.insert(f.end(), {i, i + 1, i + n, i + 1, i + n + 1, i + n});
    }
  return f;
}

/// Returns the sides of the squares of a cloth, and their diagonals.
inline std::vector<std::uint32_t> cloth_edges(std::uint32_t n) {
  std::vector<std::uint32_t> e;
  for (std::uint32_t i = 0; i < n * n; ++i) {
    if (i % n + 1 < n) e.insert(e.end(), {i, i + 1});
    if (i + n < n * n) e.insert(e.end(), {i, i + n});
    if (i % n + 1 < n && i + n < n * n) e.insert(e.end(), {i + 1, i + n});
  }
  return e;
}

}  // namespace kbvh::experiments::micro
