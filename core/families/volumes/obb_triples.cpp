#include "core/families/volumes/obb_triples.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

namespace kbvh {
namespace {

struct Vec {
  double x, y, z;
  Vec operator-(const Vec& o) const { return {x - o.x, y - o.y, z - o.z}; }
  Vec operator*(double by) const { return {x * by, y * by, z * by}; }
  double dot(const Vec& o) const { return x * o.x + y * o.y + z * o.z; }
  Vec cross(const Vec& o) const { return {y * o.z - z * o.y, z * o.x - x * o.z, x * o.y - y * o.x}; }
};

constexpr std::size_t directions = 7;
constexpr Vec direction[directions] = {{1, 0, 0},  {0, 1, 0},  {0, 0, 1},  {1, 1, 1},
                                       {1, 1, -1}, {1, -1, 1}, {1, -1, -1}};

/// The extreme points, scaled to at most 1 around the first.
struct Extremes {
  std::uint32_t id[2 * directions];
  Vec at[2 * directions];
};

/// Half of a box's surface in a frame; infinite where the three points do not span one.
double surface(const Extremes& extremes, std::size_t a, std::size_t b, std::size_t c) {
  Vec axis[3];
  const Vec edge = extremes.at[b] - extremes.at[a], side = extremes.at[c] - extremes.at[a];
  const double length = std::sqrt(edge.dot(edge));
  if (!(length > 1e-6)) return std::numeric_limits<double>::infinity();
  axis[0] = edge * (1 / length);
  const Vec across = side - axis[0] * side.dot(axis[0]);
  const double height = std::sqrt(across.dot(across));
  if (!(height > 0.02 * std::sqrt(side.dot(side)))) return std::numeric_limits<double>::infinity();
  axis[1] = across * (1 / height);
  axis[2] = axis[0].cross(axis[1]);
  double extent[3];
  for (std::size_t i = 0; i < 3; ++i) {
    double low = 0, high = 0;
    for (std::size_t k = 0; k < 2 * directions; ++k) {
      const double along = axis[i].dot(extremes.at[k] - extremes.at[a]);
      low = std::min(low, along);
      high = std::max(high, along);
    }
    extent[i] = high - low;
  }
  return extent[0] * extent[1] + extent[1] * extent[2] + extent[2] * extent[0];
}

}  // namespace

template <class S>
std::array<std::uint32_t, 3> choose_triple(std::span<const std::uint32_t> points, const S* positions) {
  const auto position = [&](std::uint32_t point) {
    const S *const p = positions + point, *const from = positions + points[0];
    return Vec{double(p[0]) - double(from[0]), double(p[1]) - double(from[1]),
               double(p[2]) - double(from[2])};
  };
  Extremes extremes;
  double least[directions], most[directions], reach = 0;
  for (std::size_t k = 0; k < points.size(); ++k) {
    const Vec p = position(points[k]);
    reach = std::max({reach, std::abs(p.x), std::abs(p.y), std::abs(p.z)});
    for (std::size_t i = 0; i < directions; ++i) {
      const double along = direction[i].dot(p);
      if (k == 0 || along < least[i]) {
        least[i] = along;
        extremes.id[2 * i] = points[k];
      }
      if (k == 0 || along > most[i]) {
        most[i] = along;
        extremes.id[2 * i + 1] = points[k];
      }
    }
  }
  if (!(reach > 0)) return {points[0], points[0], points[0]};
  for (std::size_t k = 0; k < 2 * directions; ++k) {
    const Vec p = position(extremes.id[k]);
    extremes.at[k] = {p.x / reach, p.y / reach, p.z / reach};
  }
  // A long edge, the point furthest from its line, and the points furthest from the plane.
  const auto best_of = [&](const auto& value) {
    std::size_t best = 0;
    for (std::size_t k = 1; k < 2 * directions; ++k)
      if (value(k) > value(best)) best = k;
    return best;
  };
  std::size_t a = 0, b = 1;
  double longest = -1;
  for (std::size_t i = 0; i < directions; ++i) {
    const Vec way = extremes.at[2 * i + 1] - extremes.at[2 * i];
    if (way.dot(way) <= longest) continue;
    longest = way.dot(way);
    a = 2 * i;
    b = 2 * i + 1;
  }
  const Vec edge = extremes.at[b] - extremes.at[a];
  const std::size_t c = best_of([&](std::size_t k) {
    const Vec normal = edge.cross(extremes.at[k] - extremes.at[a]);
    return normal.dot(normal);
  });
  const Vec normal = edge.cross(extremes.at[c] - extremes.at[a]);
  const auto height = [&](std::size_t k) { return normal.dot(extremes.at[k] - extremes.at[a]); };
  const std::size_t above = best_of(height), below = best_of([&](std::size_t k) { return -height(k); });
  std::array<std::size_t, 3> chosen{a, b, c};
  double best = std::numeric_limits<double>::infinity();
  const auto consider = [&](std::size_t i, std::size_t j, std::size_t k) {
    for (const std::array<std::size_t, 3>& triple :
         {std::array{i, j, k}, std::array{j, k, i}, std::array{k, i, j}}) {
      const double area = surface(extremes, triple[0], triple[1], triple[2]);
      if (!(area < best)) continue;
      best = area;
      chosen = triple;
    }
  };
  consider(a, b, c);
  for (const std::size_t top : {above, below}) {
    consider(a, b, top);
    consider(b, c, top);
    consider(c, a, top);
  }
  return {extremes.id[chosen[0]], extremes.id[chosen[1]], extremes.id[chosen[2]]};
}

template std::array<std::uint32_t, 3> choose_triple(std::span<const std::uint32_t>, const float*);
template std::array<std::uint32_t, 3> choose_triple(std::span<const std::uint32_t>, const double*);

}  // namespace kbvh
