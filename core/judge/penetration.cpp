#include "core/judge/penetration.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "core/geometry/lane_box.hpp"

namespace kbvh {

namespace {

using Vector = std::array<double, 3>;

Vector between(const double* a, const double* b) {
  return {b[0] - a[0], b[1] - a[1], b[2] - a[2]};
}

/// Returns the vector scaled to length 1; zero for the zero vector.
Vector unit(Vector v) {
  const double largest = std::max({std::abs(v[0]), std::abs(v[1]), std::abs(v[2])});
  if (!(largest > 0)) return {};
  for (double& x : v) x /= largest;  // products stay in range
  const double length = std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
  for (double& x : v) x /= length;
  return v;
}

Vector cross(const Vector& a, const Vector& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

struct Interval {
  double lower = std::numeric_limits<double>::infinity(), upper = -lower;
};
Interval along(const Vector& axis, const double* origin, const double (&triangle)[3][3]) {
  Interval found;
  for (const double* corner : triangle) {
    const Vector v = between(origin, corner);
    const double at = v[0] * axis[0] + v[1] * axis[1] + v[2] * axis[2];
    found.lower = std::min(found.lower, at);
    found.upper = std::max(found.upper, at);
  }
  return found;
}

}  // namespace

double penetration_depth(const double (&a)[3][3], const double (&b)[3][3]) {
  Vector edges[2][3], axes[11];
  for (int i = 0; i < 3; ++i) {
    edges[0][i] = unit(between(a[i], a[(i + 1) % 3]));
    edges[1][i] = unit(between(b[i], b[(i + 1) % 3]));
  }
  std::size_t count = 0;
  for (const auto& own : edges) axes[count++] = unit(cross(own[0], own[1]));
  for (const Vector& first : edges[0])
    for (const Vector& second : edges[1]) axes[count++] = unit(cross(first, second));
  double least = std::numeric_limits<double>::infinity();
  for (const Vector& axis : axes) {
    if (axis == Vector{}) continue;
    const Interval x = along(axis, a[0], a), y = along(axis, a[0], b);
    least = std::min({least, x.upper - y.lower, y.upper - x.lower});
  }
  return std::isfinite(least) ? std::max(0.0, least) : 0;
}

template <class S>
Penetration penetration(const Scene<S>& scene, const Playback<S>& playback, const PrimitivePair& pair) {
  const Primitives* const primitives[] = {&scene.bodies[pair.body_a].primitives,
                                          &scene.bodies[pair.body_b].primitives};
  const std::uint32_t ids[] = {pair.primitive_a, pair.primitive_b};
  const S* const positions[] = {playback.positions(pair.body_a), playback.positions(pair.body_b)};
  const auto corner = [&](int side, std::uint32_t vertex, double* out) {
    for (std::size_t axis = 0; axis < 3; ++axis)
      out[axis] = double(positions[side][std::size_t(3) * vertex + axis]);
  };
  Penetration found;
  if (primitives[0]->kind == PrimitiveKind::polygons && primitives[1]->kind == PrimitiveKind::polygons) {
    const auto triangle = [&](int side, std::uint32_t i, double(&out)[3][3]) {
      const auto vertices = primitives[side]->triangles(ids[side])[i];
      for (std::size_t k = 0; k < 3; ++k) corner(side, vertices[k], out[k]);
    };
    double a[3][3], b[3][3];
    for (std::uint32_t i = 0; i < primitives[0]->triangles(ids[0]).count(); ++i)
      for (std::uint32_t j = 0; j < primitives[1]->triangles(ids[1]).count(); ++j) {
        triangle(0, i, a);
        triangle(1, j, b);
        found.depth = std::max(found.depth, penetration_depth(a, b));
      }
  } else {
    const Box<S> a = primitive_box((*primitives[0])[ids[0]], positions[0]),
                 b = primitive_box((*primitives[1])[ids[1]], positions[1]);
    found.depth = std::numeric_limits<double>::infinity();
    for (int axis = 0; axis < 3; ++axis)
      found.depth = std::min({found.depth, double(a.upper[axis]) - double(b.lower[axis]),
                              double(b.upper[axis]) - double(a.lower[axis])});
    found.depth = std::max(0.0, found.depth);
  }
  double sum = 0;
  std::size_t edges = 0;
  for (int side = 0; side < 2; ++side) {
    const auto vertices = (*primitives[side])[ids[side]];
    for (std::size_t i = 0; vertices.size() > 1 && i < vertices.size(); ++i, ++edges) {
      double from[3], to[3];
      corner(side, vertices[i], from);
      corner(side, vertices[(i + 1) % vertices.size()], to);
      const Vector edge = between(from, to);
      sum += std::hypot(edge[0], edge[1], edge[2]);
    }
  }
  if (sum > 0) found.in_edges = found.depth / (sum / double(edges));
  return found;
}

template Penetration penetration(const Scene<float>&, const Playback<float>&, const PrimitivePair&);
template Penetration penetration(const Scene<double>&, const Playback<double>&, const PrimitivePair&);

}  // namespace kbvh
