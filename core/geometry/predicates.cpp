#include "core/geometry/predicates.hpp"

#include <boost/multiprecision/cpp_int.hpp>
#include <cstdint>

#include "core/geometry/scaled_integers.hpp"

namespace kbvh {
namespace {

__extension__ typedef __int128 Int128;

using Int512 = boost::multiprecision::number<boost::multiprecision::cpp_int_backend<
    512, 512, boost::multiprecision::signed_magnitude, boost::multiprecision::unchecked, void>>;
using IntAny = boost::multiprecision::cpp_int;

template <class Integer>
inline void shift_left(Integer& x, int bits) {
  x <<= bits;
}
/// Kept out of line: when it is inlined into the determinants at -O3, GCC 12 warns of overflows that do not
/// exist.
[[gnu::noinline]] void shift_left(IntAny& x, int bits) {
  x <<= bits;
}

/// Returns value i as an integer.
template <class Integer, int N>
Integer get(const scaled::Scaled<N>& s, int i) {
  if (s.values[i].mantissa == 0) return Integer(0);
  // A left shift of a negative number multiplies it, by C++20 and for signed_magnitude integers.
  Integer result(s.values[i].mantissa);
  shift_left(result, s.values[i].exponent - s.lowest);
  return result;
}

template <class Integer>
int sign_of(const Integer& x) {
  return x > 0 ? 1 : x < 0 ? -1 : 0;
}

template <class Integer>
int orient3d_integer(const scaled::Scaled<12>& s) {
  Integer v[12];
  for (int i = 0; i < 12; ++i) v[i] = get<Integer>(s, i);
  Integer e[9];
  for (int i = 0; i < 9; ++i) e[i] = v[i + 3] - v[i % 3];
  const Integer x = e[1] * e[5] - e[2] * e[4];
  const Integer y = e[2] * e[3] - e[0] * e[5];
  const Integer z = e[0] * e[4] - e[1] * e[3];
  const Integer det = x * e[6] + y * e[7] + z * e[8];
  return sign_of(det);
}

/// The same for coordinates of at most 60 bits: differences are below 2^61, minors below 2^123 and the sums
/// of the half products below 3 * 2^125. Everything fits into 128 bits except the determinant, which is kept
/// as high * 2^64 + low.
int orient3d_narrow(const scaled::Scaled<12>& s) {
  std::int64_t v[12];
  for (int i = 0; i < 12; ++i) v[i] = get<std::int64_t>(s, i);
  std::int64_t e[9];
  for (int i = 0; i < 9; ++i) e[i] = v[i + 3] - v[i % 3];
  const Int128 minors[3] = {Int128(e[1]) * e[5] - Int128(e[2]) * e[4],
                            Int128(e[2]) * e[3] - Int128(e[0]) * e[5],
                            Int128(e[0]) * e[4] - Int128(e[1]) * e[3]};
  Int128 high = 0, low = 0;
  for (int i = 0; i < 3; ++i) {
    high += Int128(static_cast<std::int64_t>(minors[i] >> 64)) * e[6 + i];
    low += Int128(static_cast<std::uint64_t>(minors[i])) * e[6 + i];
  }
  high += low >> 64;  // floor: the remaining low is in [0, 2^64)
  if (high != 0) return sign_of(high);
  return static_cast<std::uint64_t>(low) != 0 ? 1 : 0;
}

template <class Integer>
int orient2d_integer(const scaled::Scaled<6>& s) {
  Integer v[6];
  for (int i = 0; i < 6; ++i) v[i] = get<Integer>(s, i);
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
  if (s.width <= 60) return orient3d_narrow(s);
  // |det| < 6 * 2^(3 (width + 1)), which for 168 bits is below 2^510.
  return s.width <= 168 ? orient3d_integer<Int512>(s) : orient3d_integer<IntAny>(s);
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
  if (s.width <= 60) return orient2d_integer<Int128>(s);
  return s.width <= 250 ? orient2d_integer<Int512>(s) : orient2d_integer<IntAny>(s);
}

}  // namespace kbvh
