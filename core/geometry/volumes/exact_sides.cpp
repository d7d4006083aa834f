#include "core/geometry/volumes/exact_sides.hpp"

#include <boost/multiprecision/cpp_int.hpp>
#include <cmath>

#include "core/geometry/predicates.hpp"
#include "core/geometry/scaled_integers.hpp"
#include "core/geometry/volumes/outward.hpp"

namespace kbvh {
namespace {

using Rational = boost::multiprecision::cpp_rational;

int sign(const Rational& value) {
  return value.sign();
}

/// Returns the side of the sphere. The values are the centre, the radius and the point. As integers they are
/// below 2^w, and their squares and the sum of these below 2^(2 w + 4).
template <class Integer>
int side_of_sphere(const scaled::Scaled<7>& all) {
  const auto radius = scaled::integer<Integer>(all, 3);
  Integer beyond = -(radius * radius);
  for (int d = 0; d < 3; ++d) {
    const Integer along = scaled::integer<Integer>(all, 4 + d) - scaled::integer<Integer>(all, d);
    beyond += along * along;
  }
  return scaled::sign_of(beyond);
}

}  // namespace

int side_of_sphere(const double* centre, double radius, const double* p) {
  double way[3];
  outward::difference(p, centre, way);
  const double distance = way[0] * way[0] + way[1] * way[1] + way[2] * way[2], reach = radius * radius;
  const int filtered =
      sign_beyond(distance - reach, 16 * outward::unit_roundoff * (distance + reach) + 16 * outward::least);
  if (filtered != undecided_sign) return filtered;
  scaled::Scaled<7> all;
  for (int d = 0; d < 3; ++d) {
    all.values[d] = scaled::odd_multiple(centre[d]);
    all.values[4 + d] = scaled::odd_multiple(p[d]);
  }
  all.values[3] = scaled::odd_multiple(radius);
  all.measure();
  if (all.width <= 61) return side_of_sphere<scaled::Int128>(all);
  if (all.width <= 253) return side_of_sphere<scaled::Int512>(all);
  return side_of_sphere<boost::multiprecision::cpp_int>(all);
}

int side_of_slab(const double* axis, const double* centre, double half, const double* p) {
  double way[3];
  outward::difference(p, centre, way);
  const outward::Bounded along = outward::dot(axis, way);
  const int filtered =
      sign_beyond(std::fabs(along.value) - half,
                  along.error + 4 * outward::unit_roundoff * (std::fabs(along.value) + half));
  if (filtered != undecided_sign) return filtered;
  Rational exact = 0;
  for (int d = 0; d < 3; ++d) exact += Rational(axis[d]) * (Rational(p[d]) - Rational(centre[d]));
  return sign(Rational(abs(exact) - Rational(half)));
}

}  // namespace kbvh
