#pragma once
#include <cmath>

#include "core/geometry/filter_bounds.hpp"

namespace kbvh {

/// The largest coordinate magnitude for which the predicates and the triangle test are exact. Every finite S
/// with |x| <= admissible_magnitude<S> is admissible, including zeros and denormals. The limit keeps triple
/// products of differences finite in double (6 * (2e100)^3 < 1e303; float's is far below), so that a filter
/// never sees an infinity or NaN. Beyond the limit answers may be wrong; these functions do not check it.
///
/// All predicates need the default floating-point environment: rounding to nearest, and neither flush-to-zero
/// nor denormals-are-zero (some libraries set these in their worker threads).
template <class S>
inline constexpr S admissible_magnitude = S();
template <>
inline constexpr float admissible_magnitude<float> = 1e30f;
template <>
inline constexpr double admissible_magnitude<double> = 1e100;

/// Returned by a filter whose error bound is larger than the value; decided signs are -1, 0, +1.
inline constexpr int undecided_sign = 2;

/// Returns the sign of `value` if its magnitude exceeds `bound`, else undecided_sign.
inline int sign_beyond(double value, double bound) {
  return value > bound ? 1 : value < -bound ? -1 : undecided_sign;
}

/// Returns the filtered sign of det(b - a, c - a, d - a), see `orient3d`; undecided_sign where rounding could
/// have changed the sign. Each argument points to 3 coordinates.
inline int orient3d_filtered(const double* a, const double* b, const double* c, const double* d) {
  const double bx = b[0] - a[0], by = b[1] - a[1], bz = b[2] - a[2];
  const double cx = c[0] - a[0], cy = c[1] - a[1], cz = c[2] - a[2];
  const double dx = d[0] - a[0], dy = d[1] - a[1], dz = d[2] - a[2];
  const double by_cz = by * cz, bz_cy = bz * cy;
  const double bz_cx = bz * cx, bx_cz = bx * cz;
  const double bx_cy = bx * cy, by_cx = by * cx;
  const double det = (by_cz - bz_cy) * dx + (bz_cx - bx_cz) * dy + (bx_cy - by_cx) * dz;
  const double permanent = (std::fabs(by_cz) + std::fabs(bz_cy)) * std::fabs(dx) +
                           (std::fabs(bz_cx) + std::fabs(bx_cz)) * std::fabs(dy) +
                           (std::fabs(bx_cy) + std::fabs(by_cx)) * std::fabs(dz);
  return sign_beyond(det, filter::relative3d * permanent + filter::absolute3d);
}

/// Returns the exact sign of det(b - a, c - a, d - a) by integer arithmetic (Boost.Multiprecision beyond 192
/// bits); for cases that the filter leaves undecided. About 50 ns if the coordinates share a range of 60
/// bits, microseconds if not.
int orient3d_exact(const double* a, const double* b, const double* c, const double* d);

/// Returns the side of the plane (a, b, c) on which d lies, as the exact sign of det(b - a, c - a, d - a): +1
/// on the side of the normal (b - a) x (c - a), 0 if the four points are coplanar. Each argument points to 3
/// coordinates.
inline int orient3d(const double* a, const double* b, const double* c, const double* d) {
  const int sign = orient3d_filtered(a, b, c, d);
  return sign != undecided_sign ? sign : orient3d_exact(a, b, c, d);
}

/// The two coordinates that remain when an axis is dropped, in cyclic order (drop z: x, y).
struct Projection {
  int u = 0, v = 1;
};
/// Returns the projection along `axis` (0, 1 or 2).
constexpr Projection drop_axis(int axis) {
  return {(axis + 1) % 3, (axis + 2) % 3};
}

/// Returns the filtered sign of `orient2d`; undecided_sign where rounding could have changed the sign.
inline int orient2d_filtered(const double* a, const double* b, const double* c, Projection p) {
  const double left = (b[p.u] - a[p.u]) * (c[p.v] - a[p.v]);
  const double right = (b[p.v] - a[p.v]) * (c[p.u] - a[p.u]);
  return sign_beyond(left - right,
                     filter::relative2d * (std::fabs(left) + std::fabs(right)) + filter::absolute2d);
}

/// Returns the exact sign of `orient2d`, for cases that the filter leaves undecided.
int orient2d_exact(const double* a, const double* b, const double* c, Projection p);

/// Returns the turn of the projections of a, b, c: left (+1), right (-1), or none (0). This is the exact sign
/// of the z component of (b - a) x (c - a), axes named by the projection. Each argument points to 3
/// coordinates.
inline int orient2d(const double* a, const double* b, const double* c, Projection p) {
  const int sign = orient2d_filtered(a, b, c, p);
  return sign != undecided_sign ? sign : orient2d_exact(a, b, c, p);
}

}  // namespace kbvh
