#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <random>
#include <sstream>
#include <string>
#include <type_traits>
#include <vector>

// Families of triangle pairs for the tests of the exact triangle test: most of them touch, nearly touch, are
// coplanar or degenerate, unlike random pairs.

namespace kbvh::triangle_pairs {

template <class S>
using Point = std::array<S, 3>;
template <class S>
using Corners = std::array<Point<S>, 3>;
template <class S>
using Pair = std::array<Corners<S>, 2>;
using Random = std::mt19937_64;

template <class S>
std::string describe(const Pair<S>& pair) {
  std::ostringstream text;
  text << std::hexfloat;
  for (const auto& triangle : pair) {
    for (const auto& p : triangle) text << "(" << p[0] << ", " << p[1] << ", " << p[2] << ") ";
    text << "\n";
  }
  return text.str();
}

inline int uniform(Random& random, int low, int high) {
  return std::uniform_int_distribution<int>(low, high)(random);
}

/// Corners with integer coordinates in 0..n-1: for small n, mostly degenerate, coplanar or touching.
template <class S>
Pair<S> grid_pair(Random& random, int n) {
  Pair<S> pair;
  for (auto& triangle : pair)
    for (auto& p : triangle)
      for (auto& x : p) x = S(uniform(random, 0, n - 1));
  return pair;
}

/// Integer corners in one plane, spanned by two of a few integer directions.
template <class S>
Pair<S> coplanar_pair(Random& random, int n) {
  static constexpr int directions[7][3] = {{1, 0, 0},  {0, 1, 0}, {0, 0, 1}, {1, -1, 0},
                                           {1, 2, -3}, {2, 1, 5}, {0, 3, 1}};
  const int* u = directions[uniform(random, 0, 6)];
  const int* v = directions[uniform(random, 0, 6)];
  Pair<S> pair;
  for (auto& triangle : pair)
    for (auto& p : triangle) {
      const int s = uniform(random, 0, n - 1), t = uniform(random, 0, n - 1);
      for (std::size_t axis = 0; axis < 3; ++axis) p[axis] = S(s * u[axis] + t * v[axis]);
    }
  return pair;
}

/// A pair that touches or nearly does: a corner or an edge of the second triangle passes through a rounded
/// point of the first one's corner, edge or interior.
template <class S>
Pair<S> contact_pair(Random& random) {
  std::uniform_real_distribution<double> real(-1, 1);
  Pair<S> pair;
  for (auto& triangle : pair)
    for (auto& p : triangle)
      for (auto& x : p) x = S(real(random));
  const double s = uniform(random, 0, 4) / 4.0, t = uniform(random, 0, 4) / 4.0 * (1 - s);
  const bool midpoint = uniform(random, 0, 1) == 1;
  const auto& a = pair[0];
  auto& b = pair[1];
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double on_a = (1 - s - t) * double(a[0][axis]) + s * double(a[1][axis]) + t * double(a[2][axis]);
    b[0][axis] = S(midpoint ? 2 * on_a - double(b[1][axis]) : on_a);
  }
  return pair;
}

template <class S>
void scale(Pair<S>& pair, int exponent) {
  for (auto& triangle : pair)
    for (auto& p : triangle)
      for (auto& x : p) x = std::ldexp(x, exponent);
}

/// Moves a coordinate or a few by one unit in the last place.
template <class S>
void perturb(Random& random, Pair<S>& pair) {
  const int count = uniform(random, 1, 3);
  for (int i = 0; i < count; ++i) {
    S& x = pair[std::size_t(uniform(random, 0, 1))][std::size_t(uniform(random, 0, 2))]
               [std::size_t(uniform(random, 0, 2))];
    x = std::nextafter(x, uniform(random, 0, 1) == 0 ? -S(1e4) : S(1e4));
  }
}

/// One coordinate frame for a family: power of two that keeps all of it admissible, and denormal at the low
/// end.
template <class S>
std::vector<int> extreme_exponents() {
  if (std::is_same_v<S, float>) return {-149, -140, -126, -100, 40, 90};
  return {-1074, -1060, -1022, -700, -360, -100, 100, 325};
}

}  // namespace kbvh::triangle_pairs
