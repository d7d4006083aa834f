#pragma once
#include <algorithm>
#include <array>
#include <boost/multiprecision/gmp.hpp>
#include <vector>

#include "core/motion/piece.hpp"

// Flight plans and triangles in rational arithmetic, from their definitions, as a reference for tests.

namespace kbvh::test {

using Rational =
    boost::multiprecision::number<boost::multiprecision::gmp_rational, boost::multiprecision::et_off>;
using RationalPoint = std::array<Rational, 3>;

/// A finite number, exactly.
inline Rational exact(double x) {
  return Rational(x);
}

inline RationalPoint minus(const RationalPoint& a, const RationalPoint& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
inline Rational dot(const RationalPoint& a, const RationalPoint& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
inline RationalPoint cross(const RationalPoint& a, const RationalPoint& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

/// Returns the position of a piece at one of its times.
template <class S>
Rational value_at(const Piece<S>& piece, double t) {
  const Rational x0 = exact(double(piece.x0)), x1 = exact(double(piece.x1));
  if (piece.x1 == (piece.kind == PieceKind::ray ? S(0) : piece.x0) || t == piece.t0) return x0;
  if (piece.kind == PieceKind::ray) return x0 + x1 * (exact(t) - exact(piece.t0));
  if (t == piece.t1) return x1;
  return x0 + (x1 - x0) * (exact(t) - exact(piece.t0)) / (exact(piece.t1) - exact(piece.t0));
}

/// Returns a number between two others.
inline Rational between(const Rational& first, const Rational& last, const Rational& fraction) {
  return first + (last - first) * fraction;
}

/// Returns whether two closed triangles share a point. Any direction that separates them suffices; if there
/// is one, one of those tried here separates them, also for segments and points.
class RationalTriangles {
 public:
  static bool intersect(const RationalPoint* a, const RationalPoint* b) {
    const auto edges_a = edges(a), edges_b = edges(b);
    const RationalPoint normal_a = cross(edges_a[0], edges_a[1]), normal_b = cross(edges_b[0], edges_b[1]);
    std::vector<RationalPoint> directions{normal_a, normal_b};
    for (const RationalPoint& ea : edges_a)
      for (const RationalPoint& eb : edges_b) directions.push_back(cross(ea, eb));
    for (const RationalPoint& direction : directions)
      if (apart(direction, a, b)) return false;
    if (!is_zero(cross(normal_a, normal_b)))
      return true;  // their difference has a volume: these are its faces
    const std::size_t faces = directions.size();
    for (const auto* edges : {&edges_a, &edges_b})
      for (const RationalPoint& edge : *edges) {
        directions.push_back(edge);
        for (std::size_t i = 0; i < faces; ++i) directions.push_back(cross(directions[i], edge));
      }
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) {
        const RationalPoint way = minus(b[j], a[i]);
        directions.push_back(way);
        for (const auto* edges : {&edges_a, &edges_b})
          for (const RationalPoint& edge : *edges) directions.push_back(cross(cross(way, edge), edge));
      }
    for (std::size_t i = faces; i < directions.size(); ++i)
      if (apart(directions[i], a, b)) return false;
    return true;
  }

 private:
  static bool is_zero(const RationalPoint& a) { return a[0] == 0 && a[1] == 0 && a[2] == 0; }
  static std::array<RationalPoint, 3> edges(const RationalPoint* p) {
    return {minus(p[1], p[0]), minus(p[2], p[1]), minus(p[0], p[2])};
  }
  static bool apart(const RationalPoint& direction, const RationalPoint* a, const RationalPoint* b) {
    if (is_zero(direction)) return false;
    std::array<Rational, 3> along[2];
    for (std::size_t i = 0; i < 3; ++i) {
      along[0][i] = dot(direction, a[i]);
      along[1][i] = dot(direction, b[i]);
    }
    const auto [low_a, high_a] = std::minmax_element(along[0].begin(), along[0].end());
    const auto [low_b, high_b] = std::minmax_element(along[1].begin(), along[1].end());
    return *high_a < *low_b || *high_b < *low_a;
  }
};

}  // namespace kbvh::test
