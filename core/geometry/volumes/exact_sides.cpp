#include "core/geometry/volumes/exact_sides.hpp"

#include <boost/multiprecision/cpp_int.hpp>
#include <cmath>

#include "core/geometry/predicates.hpp"
#include "core/geometry/volumes/outward.hpp"

namespace kbvh {
namespace {

using Rational = boost::multiprecision::cpp_rational;

int sign(const Rational& value) {
  return value.sign();
}

}  // namespace

int side_of_sphere(const double* centre, double radius, const double* p) {
  double way[3];
  outward::difference(p, centre, way);
  const double distance = way[0] * way[0] + way[1] * way[1] + way[2] * way[2], reach = radius * radius;
  const int filtered =
      sign_beyond(distance - reach, 16 * outward::unit_roundoff * (distance + reach) + 16 * outward::least);
  if (filtered != undecided_sign) return filtered;
  Rational exact = -Rational(radius) * Rational(radius);
  for (int d = 0; d < 3; ++d) {
    const Rational along = Rational(p[d]) - Rational(centre[d]);
    exact += along * along;
  }
  return sign(exact);
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
