#include "core/geometry/predicates.hpp"

#include <boost/multiprecision/cpp_int.hpp>
#include <cstdint>

#include "core/geometry/scaled_integers.hpp"

namespace kbvh {
namespace {

using IntAny = boost::multiprecision::cpp_int;

template <class Integer>
int orient3d_integer(const scaled::Scaled<12>& s) {
  Integer v[12], e[9];
  for (int i = 0; i < 12; ++i) v[i] = scaled::integer<Integer>(s, i);
  for (int i = 0; i < 9; ++i) e[i] = v[i + 3] - v[i % 3];
  return scaled::determinant_sign(e + 6, e, e + 3);
}

template <class Integer>
int orient2d_integer(const scaled::Scaled<6>& s) {
  Integer v[6];
  for (int i = 0; i < 6; ++i) v[i] = scaled::integer<Integer>(s, i);
  const Integer bx = v[2] - v[0], by = v[3] - v[1], cx = v[4] - v[0], cy = v[5] - v[1];
  const Integer left = bx * cy, right = by * cx;
  return left > right ? 1 : left < right ? -1 : 0;
}

}  // namespace

int orient3d_exact(const double* a, const double* b, const double* c, const double* d) {
  // Points on an axis-aligned plane (floors, tables) are the most common coplanar input.
  for (int axis = 0; axis < 3; ++axis)
    if (a[axis] == b[axis] && a[axis] == c[axis] && a[axis] == d[axis]) return 0;
  scaled::Scaled<12> s;
  const double* points[4] = {a, b, c, d};
  for (int i = 0; i < 12; ++i) s.values[i] = scaled::odd_multiple(points[i / 3][i % 3]);
  s.measure();
  if (s.width <= 60) return orient3d_integer<std::int64_t>(s);
  // |det| < 6 * 2^(3 (width + 1)), which for 168 bits is below 2^510.
  return s.width <= 168 ? orient3d_integer<scaled::Int512>(s) : orient3d_integer<IntAny>(s);
}

int orient2d_exact(const double* a, const double* b, const double* c, Projection p) {
  for (int axis : {p.u, p.v})
    if (a[axis] == b[axis] && a[axis] == c[axis]) return 0;
  scaled::Scaled<6> s;
  const double* points[3] = {a, b, c};
  for (int i = 0; i < 3; ++i) {
    s.values[2 * i] = scaled::odd_multiple(points[i][p.u]);
    s.values[2 * i + 1] = scaled::odd_multiple(points[i][p.v]);
  }
  s.measure();
  // A product of two differences is below 2^(2 (width + 1)).
  if (s.width <= 60) return orient2d_integer<scaled::Int128>(s);
  return s.width <= 250 ? orient2d_integer<scaled::Int512>(s) : orient2d_integer<IntAny>(s);
}

}  // namespace kbvh
