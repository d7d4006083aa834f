#include "core/geometry/volumes/obb_frames.hpp"

#include <cmath>

namespace kbvh {
namespace {

constexpr double way_of[7][3] = {{1, 0, 0},  {0, 1, 0},  {0, 0, 1},  {1, 1, 1},
                                 {1, 1, -1}, {1, -1, 1}, {1, -1, -1}};

double dot(const double* a, const double* b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
void cross(const double* a, const double* b, double* result) {
  for (int d = 0; d < 3; ++d) result[d] = a[(d + 1) % 3] * b[(d + 2) % 3] - a[(d + 2) % 3] * b[(d + 1) % 3];
}
void subtract(const double* a, const double* b, double* result) {
  for (int d = 0; d < 3; ++d) result[d] = a[d] - b[d];
}
double largest(const double* v) {
  return std::fmax(std::fabs(v[0]), std::fmax(std::fabs(v[1]), std::fabs(v[2])));
}
/// Normalises a vector; returns false for the zero vector. Scales first, so that squares do not underflow.
bool normalise(double* v) {
  const double scale = largest(v);
  if (!(scale > 0)) return false;
  for (int d = 0; d < 3; ++d) v[d] /= scale;
  const double length = std::sqrt(dot(v, v));
  for (int d = 0; d < 3; ++d) v[d] /= length;
  return true;
}
/// Computes any unit vector at a right angle to a unit vector.
void any_normal(const double* unit, double* result) {
  int least = 0;
  for (int d = 1; d < 3; ++d)
    if (std::fabs(unit[d]) < std::fabs(unit[least])) least = d;
  double other[3] = {0, 0, 0};
  other[least] = 1;
  cross(unit, other, result);
  normalise(result);
}

}  // namespace

void ObbFrames::add_extreme(const double* point) {
  for (std::size_t i = 0; i < directions; ++i) {
    const double at = dot(way_of[i], point);
    for (Extreme* const extreme : {&least_[i], &most_[i]}) {
      if (count_ != 0 && !(extreme == &least_[i] ? at < extreme->at : at > extreme->at)) continue;
      extreme->at = at;
      std::copy_n(point, 3, extreme->point);
    }
  }
  ++count_;
}

const double* ObbFrames::furthest(const double* from, const double* normal, int sign) const {
  const double* result = nullptr;
  double most = 0, way[3];
  for (std::size_t i = 0; i < directions; ++i)
    for (const Extreme* const extreme : {&least_[i], &most_[i]}) {
      subtract(extreme->point, from, way);
      const double distance = sign * dot(normal, way);
      if (!(distance > most)) continue;
      most = distance;
      result = extreme->point;
    }
  return result;
}

void ObbFrames::consider(const double* edge, const double* normal, double& least_area) {
  double axis[3][3];
  std::copy_n(edge, 3, axis[0]);
  if (!normalise(axis[0])) return;
  // The normal of a thin triangle is not exactly at a right angle to its edges; two orthogonalisations
  // suffice.
  std::copy_n(normal, 3, axis[1]);
  for (int round = 0; round < 2; ++round) {
    const double along = dot(axis[0], axis[1]);
    for (int d = 0; d < 3; ++d) axis[1][d] -= along * axis[0][d];
    if (!normalise(axis[1])) any_normal(axis[0], axis[1]);
  }
  cross(axis[0], axis[1], axis[2]);
  Interval sides[3];
  double way[3];
  for (std::size_t i = 0; i < directions; ++i)
    for (const Extreme* const extreme : {&least_[i], &most_[i]}) {
      subtract(extreme->point, least_[0].point, way);
      for (std::size_t k = 0; k < 3; ++k) sides[k].add(dot(axis[k], way));
    }
  const double x = sides[0].upper - sides[0].lower, y = sides[1].upper - sides[1].lower,
               z = sides[2].upper - sides[2].lower;
  const double area = x * y + y * z + z * x;
  if (!(area < least_area)) return;
  least_area = area;
  std::copy_n(&axis[0][0], 9, &chosen_[0][0]);
}

void ObbFrames::consider_triangle(const double* a, const double* b, const double* c, double& least_area) {
  double edges[3][3], normal[3];
  subtract(b, a, edges[0]);
  subtract(c, b, edges[1]);
  subtract(a, c, edges[2]);
  double unit[2][3];
  std::copy_n(edges[0], 3, unit[0]);
  std::copy_n(edges[1], 3, unit[1]);
  if (!normalise(unit[0]) || !normalise(unit[1])) return;
  cross(unit[0], unit[1], normal);
  for (const auto& edge : edges) consider(edge, normal, least_area);
}

void ObbFrames::choose() {
  // The longest of the seven spans, and the point furthest from its line.
  const double *a = nullptr, *b = nullptr;
  double longest = 0, way[3], edge[3];
  for (std::size_t i = 0; i < directions; ++i) {
    subtract(most_[i].point, least_[i].point, way);
    const double scale = largest(way),
                 length = scale > 0 ? scale * std::sqrt(dot(way, way) / scale / scale) : 0;
    if (!(length > longest)) continue;
    longest = length;
    a = least_[i].point;
    b = most_[i].point;
  }
  if (a == nullptr) return;  // one point: any axes suffice
  subtract(b, a, edge);
  normalise(edge);
  const double* c = nullptr;
  double furthest_out = 0, normal[3];
  for (std::size_t i = 0; i < directions; ++i)
    for (const Extreme* const extreme : {&least_[i], &most_[i]}) {
      subtract(extreme->point, a, way);
      cross(edge, way, normal);
      const double distance = largest(normal);
      if (!(distance > furthest_out)) continue;
      furthest_out = distance;
      c = extreme->point;
    }
  double least_area = std::numeric_limits<double>::infinity();
  if (c == nullptr) {  // a line
    any_normal(edge, normal);
    consider(edge, normal, least_area);
    return;
  }
  consider_triangle(a, b, c, least_area);
  subtract(c, a, way);
  normalise(way);
  cross(edge, way, normal);
  if (!normalise(normal)) return;
  for (const int sign : {1, -1}) {
    const double* const apex = furthest(a, normal, sign);
    if (apex == nullptr) continue;
    consider_triangle(a, b, apex, least_area);
    consider_triangle(b, c, apex, least_area);
    consider_triangle(c, a, apex, least_area);
  }
}

}  // namespace kbvh
