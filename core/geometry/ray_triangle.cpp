#include "core/geometry/ray_triangle.hpp"

#include <algorithm>
#include <array>
#include <boost/multiprecision/cpp_int.hpp>
#include <cmath>
#include <cstdint>
#include <optional>
#include <type_traits>
#include <utility>

#include "core/geometry/scaled_integers.hpp"

// With A, B, C the corners relative to the origin and d the direction, the ray's line meets the triangle if
// the volumes d (B x C), d (C x A) and d (A x B) do not have both signs. They are the barycentric coordinates
// of the meeting point, times d n with n = (B - A) x (C - A). The parameter is A n / d n. If all three are
// zero, the ray lies in the triangle's plane or is parallel to it, or the triangle is degenerate.

namespace kbvh {
namespace {

// ---- Filter -----------------------------------------------------------------------------------------------

struct Filtered {
  double value, bound;
  int sign() const { return sign_beyond(value, bound); }
};

/// Computes d (p x q) with its error bound; p and q are differences of coordinates, d is a difference or
/// exact.
Filtered volume(const double* d, const double* p, const double* q) {
  const double yz = p[1] * q[2], zy = p[2] * q[1];
  const double zx = p[2] * q[0], xz = p[0] * q[2];
  const double xy = p[0] * q[1], yx = p[1] * q[0];
  const double value = (yz - zy) * d[0] + (zx - xz) * d[1] + (xy - yx) * d[2];
  const double permanent = (std::fabs(yz) + std::fabs(zy)) * std::fabs(d[0]) +
                           (std::fabs(zx) + std::fabs(xz)) * std::fabs(d[1]) +
                           (std::fabs(xy) + std::fabs(yx)) * std::fabs(d[2]);
  return {value, filter::relative3d * permanent + filter::absolute3d};
}

enum class Verdict : std::uint8_t { miss, meets, open };

Verdict filtered(const RayLine& ray, const double* corners, RayMeeting& meeting) {
  double to[3][3], edge[3][3];  // corners relative to the origin; edges to the next corner
  for (int c = 0; c < 3; ++c)
    for (int axis = 0; axis < 3; ++axis) {
      to[c][axis] = corners[3 * c + axis] - ray.origin[axis];
      edge[c][axis] = corners[3 * ((c + 1) % 3) + axis] - corners[3 * c + axis];
    }
  int positive = 0, negative = 0;
  for (int c = 0; c < 3; ++c) {
    const int sign = volume(ray.direction, to[c], edge[c]).sign();
    positive += sign == 1 ? 1 : 0;
    negative += sign == -1 ? 1 : 0;
  }
  if (positive != 0 && negative != 0) return Verdict::miss;
  const Filtered height = volume(to[0], edge[2], edge[0]), slope = volume(ray.direction, edge[2], edge[0]);
  if (const int side = slope.sign(); side != undecided_sign && height.sign() == -side) return Verdict::miss;
  if (positive + negative != 3) return Verdict::open;
  // `slope` has the same sign, whether or not its own filter decides that.
  const double least = std::fabs(slope.value) - slope.bound;
  if (!(least > 4 * slope.bound) || height.sign() == undecided_sign) return Verdict::open;
  const double parameter = height.value / slope.value;
  const double error = (height.bound + parameter * slope.bound) / least * (1 + 0x1p-40) + parameter * 0x1p-52;
  if (!(error <= 0x1p-42 * parameter)) return Verdict::open;
  if (parameter - error > ray.length) return Verdict::miss;
  if (!(parameter + error < ray.length) && ray.length < HUGE_VAL) return Verdict::open;
  meeting = {parameter, error, 7, false};
  return Verdict::meets;
}

// ---- Exact ------------------------------------------------------------------------------------------------

using Integer = boost::multiprecision::number<
    boost::multiprecision::cpp_int_backend<1024, 0, boost::multiprecision::signed_magnitude,
                                           boost::multiprecision::unchecked, std::allocator<std::uint64_t>>,
    boost::multiprecision::et_off>;
using Vector = std::array<Integer, 3>;

Vector operator-(const Vector& a, const Vector& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
Vector cross(const Vector& a, const Vector& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
Integer dot(const Vector& a, const Vector& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
/// Returns the first axis on which a vector is not zero; 3 for the zero vector.
std::size_t axis_of(const Vector& a) {
  std::size_t axis = 0;
  while (axis < 3 && a[axis].is_zero()) ++axis;
  return axis;
}

/// numerator / denominator * 2^exponent, with a positive denominator.
struct Fraction {
  Integer numerator, denominator{1};
  int exponent = 0;
};
Fraction fraction(Integer numerator, Integer denominator, int exponent) {
  if (denominator.sign() < 0) {
    numerator = -numerator;
    denominator = -denominator;
  }
  return {std::move(numerator), std::move(denominator), exponent};
}
int compare(const Fraction& a, const Fraction& b) {
  Integer left = a.numerator * b.denominator, right = b.numerator * a.denominator;
  if (left.sign() != right.sign() || left.is_zero()) return left.compare(right);
  if (a.exponent > b.exponent) left <<= unsigned(a.exponent - b.exponent);
  if (b.exponent > a.exponent) right <<= unsigned(b.exponent - a.exponent);
  return left.compare(right);
}
/// Rounds a fraction that is not negative to nearest. The result does not depend on common factors of its
/// parts: equal fractions are rounded alike.
double rounded(const Fraction& x) {
  if (x.numerator.is_zero()) return 0;
  const int shift = 64 - (int(msb(x.numerator)) - int(msb(x.denominator)));
  Integer quotient, remainder;
  if (shift >= 0)
    divide_qr(Integer(x.numerator << unsigned(shift)), x.denominator, quotient, remainder);
  else
    divide_qr(x.numerator, Integer(x.denominator << unsigned(-shift)), quotient, remainder);
  // 64 or 65 bits: the last one is below the rounding, and represents all that follow.
  auto bits = static_cast<std::uint64_t>(quotient >> 1);
  if (!remainder.is_zero() || (quotient & 1) != 0) bits |= 1;
  return std::ldexp(double(bits), x.exponent - shift + 1);
}

/// A ray and a triangle: points in units of 2^points.lowest, and the direction in units of its own.
struct ScaledPair {
  scaled::Scaled<12> points;  ///< the corners, then the origin
  scaled::Scaled<3> along;

  ScaledPair(const RayLine& ray, const double* corners) {
    for (int i = 0; i < 9; ++i) points.values[i] = scaled::odd_multiple(corners[i]);
    for (int axis = 0; axis < 3; ++axis) {
      points.values[9 + axis] = scaled::odd_multiple(ray.origin[axis]);
      along.values[axis] = scaled::odd_multiple(ray.direction[axis]);
    }
    points.measure();
    along.measure();
  }

  /// Returns whether the ray misses the triangle, by signs alone. Most pairs that the filter leaves open do,
  /// such as those of rays in the plane of a grid. `false` if the numbers are too long for it.
  bool misses_by_signs() const {
    // Differences have one bit more: `determinant_sign` takes those of 60 bits, and a determinant of three
    // numbers of 168 bits is below 6 * 2^507.
    const int width = std::max(points.width, along.width);
    if (width <= 60) return misses<std::int64_t>();
    return width <= 168 && misses<scaled::Int512>();
  }

 private:
  template <class Integer>
  bool misses() const {
    Integer corner[3][3], direction[3];
    for (int axis = 0; axis < 3; ++axis) {
      const auto origin = scaled::integer<Integer>(points, 9 + axis);
      for (int c = 0; c < 3; ++c) corner[c][axis] = scaled::integer<Integer>(points, 3 * c + axis) - origin;
      direction[axis] = scaled::integer<Integer>(along, axis);
    }
    bool positive = false, negative = false;
    for (int c = 0; c < 3; ++c) {
      const int side = scaled::determinant_sign(direction, corner[(c + 1) % 3], corner[(c + 2) % 3]);
      positive = positive || side > 0;
      negative = negative || side < 0;
      if (positive && negative) return true;
    }
    // Behind the origin; or, if all three are zero, parallel to the plane and not in it.
    const int height = scaled::determinant_sign(corner[0], corner[1], corner[2]);
    if (height != 0) return height != (positive ? 1 : negative ? -1 : 0);
    return !positive && !negative && misses_in_plane(corner, direction);
  }
  /// Returns whether, seen along an axis, all corners lie strictly on one side of the ray's line; or whether,
  /// on one axis, all lie strictly behind the origin.
  template <class Integer>
  static bool misses_in_plane(const Integer (&corner)[3][3], const Integer (&direction)[3]) {
    using Product = std::conditional_t<std::is_same_v<Integer, std::int64_t>, scaled::Int128, Integer>;
    for (int u = 0; u < 3; ++u) {
      const int v = (u + 1) % 3, ahead = scaled::sign_of(direction[u]);
      int left = 0, right = 0, below = 0, above = 0;
      for (const Integer* const point : corner) {
        const Product turn = Product(direction[u]) * point[v] - Product(direction[v]) * point[u];
        const int side = scaled::sign_of(turn), place = scaled::sign_of(point[u]);
        left += side > 0 ? 1 : 0;
        right += side < 0 ? 1 : 0;
        below += place < 0 ? 1 : 0;
        above += place > 0 ? 1 : 0;
      }
      if (left == 3 || right == 3 || (below == 3 && ahead >= 0) || (above == 3 && ahead <= 0)) return true;
    }
    return false;
  }
};

/// A ray and a triangle in integers: points relative to the origin, in units of 2^unit, and the direction in
/// units of its own.
struct ExactPair {
  Vector corner[3], direction;
  int exponent;  ///< of a parameter in these units

  explicit ExactPair(const ScaledPair& pair) {
    Vector origin;
    for (int axis = 0; axis < 3; ++axis) {
      const auto a = std::size_t(axis);
      for (int c = 0; c < 3; ++c) corner[c][a] = scaled::integer<Integer>(pair.points, 3 * c + axis);
      origin[a] = scaled::integer<Integer>(pair.points, 9 + axis);
      direction[a] = scaled::integer<Integer>(pair.along, axis);
    }
    for (Vector& point : corner) point = point - origin;
    exponent = pair.points.width == 0 || pair.along.width == 0 ? 0 : pair.points.lowest - pair.along.lowest;
  }

  /// Returns the first parameter at which they meet, for a ray of any length; sets RayMeeting::corners.
  std::optional<Fraction> meeting(std::uint8_t& corners) const {
    const Vector &a = corner[0], &b = corner[1], &c = corner[2];
    const Integer volumes[3] = {dot(direction, cross(b, c)), dot(direction, cross(c, a)),
                                dot(direction, cross(a, b))};
    bool positive = false, negative = false;
    corners = 0;
    for (int i = 0; i < 3; ++i) {
      positive = positive || volumes[i].sign() > 0;
      negative = negative || volumes[i].sign() < 0;
      if (!volumes[i].is_zero()) corners = std::uint8_t(corners | 1U << i);
    }
    if (positive && negative) return {};
    if (!positive && !negative) return in_plane();
    Fraction found = fraction(dot(a, cross(b, c)), volumes[0] + volumes[1] + volumes[2], exponent);
    if (found.numerator.sign() < 0) return {};
    return found;
  }

 private:
  std::optional<Fraction> in_plane() const {
    const Vector &a = corner[0], &b = corner[1], &c = corner[2];
    const Vector normal = cross(b - a, c - a);
    if (const std::size_t k = axis_of(normal); k < 3) {
      if (!dot(normal, a).is_zero()) return {};  // parallel to the plane
      bool inside = true;
      for (const auto& [p, q] : {std::pair(&a, &b), {&b, &c}, {&c, &a}}) {
        const int side = cross(*p, *q)[k].sign();
        inside = inside && (side == 0 || side == normal[k].sign());
      }
      if (inside) return Fraction{};
    }
    std::optional<Fraction> first;
    for (const auto& [p, q] : {std::pair(&a, &b), {&b, &c}, {&c, &a}}) {
      auto found = edge(*p, *q);
      if (found && (!first || compare(*found, *first) < 0)) first = std::move(found);
    }
    return first;
  }

  /// Does the same for the segment from p to q, which lies in one plane with the ray.
  std::optional<Fraction> edge(const Vector& p, const Vector& q) const {
    const Vector along = q - p, turn = cross(direction, along);
    if (const std::size_t k = axis_of(turn); k < 3) {
      const Fraction place = fraction(cross(p, direction)[k], turn[k], 0);  // 0 at p, 1 at q
      if (place.numerator.sign() < 0 || place.numerator > place.denominator) return {};
      Fraction found = fraction(cross(p, along)[k], turn[k], exponent);
      if (found.numerator.sign() < 0) return {};
      return found;
    }
    const std::size_t k = axis_of(direction);
    if (k == 3) {  // the ray is a point
      if (axis_of(cross(p, q)) < 3 || dot(p, q).sign() > 0) return {};
      return Fraction{};
    }
    if (axis_of(cross(p, direction)) < 3) return {};
    Fraction at_p = fraction(p[k], direction[k], exponent), at_q = fraction(q[k], direction[k], exponent);
    if (compare(at_q, at_p) < 0) std::swap(at_p, at_q);
    if (at_q.numerator.sign() < 0) return {};
    return at_p.numerator.sign() < 0 ? Fraction{} : at_p;
  }
};

}  // namespace

bool ray_meets_triangle(const RayLine& ray, const double* corners, RayMeeting& meeting,
                        TriangleTestStats& stats, const RayMeeting* known) {
  ++stats.tests;
  if (const Verdict verdict = filtered(ray, corners, meeting); verdict != Verdict::open) {
    ++stats.filtered;
    return verdict == Verdict::meets;
  }
  if (known != nullptr && known->rounded) {
    ++stats.filtered;
    meeting = *known;
    return true;
  }
  ++stats.exact;
  ++stats.ray_decisions;
  const ScaledPair pair(ray, corners);
  if (pair.misses_by_signs()) return false;
  std::uint8_t bits = 0;
  const std::optional<Fraction> found = ExactPair(pair).meeting(bits);
  if (!found) return false;
  if (ray.length < HUGE_VAL) {
    const scaled::OddMultiple length = scaled::odd_multiple(ray.length);
    if (compare(*found, {Integer(length.mantissa), Integer(1), length.exponent}) > 0) return false;
  }
  const double parameter = rounded(*found);
  meeting = {parameter, parameter == 0 ? 0 : parameter * 0x1p-51 + 0x1p-1073, bits, true};
  return true;
}

bool meets_at_same_corners(const RayLine& ray, const double* met, const RayMeeting& meeting,
                           const double* other, RayMeeting& known) {
  unsigned shared = 0, also = 0;  // corners of each triangle that the other one has, too
  known = meeting;
  known.corners = 0;
  for (int c = 0; c < 3; ++c)
    for (int d = 0; d < 3; ++d) {
      if (!std::equal(met + 3 * c, met + 3 * c + 3, other + 3 * d)) continue;
      shared |= 1U << c;
      also |= 1U << d;
      if ((meeting.corners >> c & 1) != 0) known.corners = std::uint8_t(known.corners | 1U << d);
    }
  if (shared == 7 && also == 7) return true;
  if (meeting.corners == 0 || (meeting.corners & ~shared) != 0) return false;
  double edge[2][3];
  for (int axis = 0; axis < 3; ++axis) {
    edge[0][axis] = other[axis] - other[6 + axis];
    edge[1][axis] = other[3 + axis] - other[axis];
  }
  return volume(ray.direction, edge[0], edge[1]).sign() != undecided_sign;
}

int compare_meetings(const RayLine& ray, const double* first, const double* second) {
  const auto meeting = [&](const double* corners) {
    std::uint8_t ignored = 0;
    return *ExactPair(ScaledPair(ray, corners)).meeting(ignored);
  };
  return compare(meeting(first), meeting(second));
}

}  // namespace kbvh
