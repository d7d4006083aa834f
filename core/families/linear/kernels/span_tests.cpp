#include "core/families/linear/kernels/span_tests.hpp"

#include "core/kernels/point_lanes.hpp"

namespace kbvh {
namespace {

// ---- One direction ----------------------------------------------------------------------------------------

/// The smallest normal number: bounds the loss by underflow of products.
template <class S>
constexpr S tiny = sizeof(S) == sizeof(float) ? S(0x1p-126) : S(0x1p-1022);

template <class S>
KBVH_INLINE Point<S> cross_product(const Point<S>& p, const Point<S>& q) {
  return {p.y * q.z - p.z * q.y, p.z * q.x - p.x * q.z, p.x * q.y - p.y * q.x};
}

/// The corners of a register of pairs at one end of their spans, relative to the first corner of the first
/// triangle, which is the origin.
template <class S>
struct Corners {
  Point<S> a1, a2, b0, b1, b2;
};

/// The gap from one triangle to the other along a direction, in both orders.
template <class S>
struct Gap {
  Values<S> a_first, b_first;
};
template <class S>
KBVH_INLINE Gap<S> gap(const Corners<S>& at, const Point<S>& direction) {
  const Values<S> zero{};
  const Values<S> a1 = dot(direction, at.a1), a2 = dot(direction, at.a2);
  const Values<S> b0 = dot(direction, at.b0), b1 = dot(direction, at.b1), b2 = dot(direction, at.b2);
  const Values<S> least_a = smaller(zero, smaller(a1, a2)), most_a = larger(zero, larger(a1, a2));
  const Values<S> least_b = smaller(b0, smaller(b1, b2)), most_b = larger(b0, larger(b1, b2));
  return {least_b - most_a, least_a - most_b};
}

/// Returns all bits set where the direction separates the triangles at both ends, in the same order.
template <class S>
KBVH_INLINE Words<S> apart(const Corners<S>& first, const Corners<S>& last, const Point<S>& direction,
                           Values<S> margin) {
  const Gap<S> g0 = gap(first, direction), g1 = gap(last, direction);
  const Values<S> least = larger(smaller(g0.a_first, g1.a_first), smaller(g0.b_first, g1.b_first));
  const Point<S> size = absolute(direction);
  return greater<S>(least, (size.x + size.y + size.z) * margin + tiny<S>);
}

template <class S>
KBVH_INLINE Point<S> between(const Point<S>& first, const Point<S>& last, Values<S> fraction) {
  return {first.x + fraction * (last.x - first.x), first.y + fraction * (last.y - first.y),
          first.z + fraction * (last.z - first.z)};
}
template <class S>
KBVH_INLINE Point<S> sum(const Point<S>& p, const Point<S>& q) {
  return {p.x + q.x, p.y + q.y, p.z + q.z};
}

// ---- Signs throughout a span -----------------------------------------------------------------------------

/// A vector that is linear over the span, and the larger of the sums of its absolute components at the two
/// ends.
template <class S>
struct Linear {
  Point<S> first, last;
  Values<S> size;
};
template <class S>
KBVH_INLINE Values<S> component_sum(const Point<S>& p) {
  const Point<S> q = absolute(p);
  return q.x + q.y + q.z;
}
template <class S>
KBVH_INLINE Linear<S> difference(const Point<S>& p0, const Point<S>& p1, const Point<S>& q0,
                                 const Point<S>& q1) {
  Linear<S> d{p0 - q0, p1 - q1, {}};
  d.size = larger(component_sum(d.first), component_sum(d.last));
  return d;
}

/// u x v: its Bernstein coefficients, the middle one doubled.
template <class S>
struct Normal {
  Point<S> first, twice_middle, last;
};
template <class S>
KBVH_INLINE Normal<S> normal_of(const Linear<S>& u, const Linear<S>& v) {
  return {cross_product(u.first, v.first),
          sum(cross_product(u.first, v.last), cross_product(u.last, v.first)), cross_product(u.last, v.last)};
}

/// Has all bits set where a determinant is certainly positive, or negative, throughout.
template <class S>
struct Sign {
  Words<S> positive, negative;
};
/// Returns the sign of (u x v) w. If components are off by at most o, a determinant of vectors whose absolute
/// components add up to U, V, W changes by no more than o (UV + UW + VW) + 3 o^2 (U + V + W) + 6 o^3; its own
/// rounding is far below 64 roundings of UVW.
template <class S>
KBVH_INLINE Sign<S> sign_of(const Linear<S>& u, const Linear<S>& v, const Normal<S>& n, const Linear<S>& w,
                            Values<S> o) {
  constexpr S rounding = sizeof(S) == sizeof(float) ? S(0x1p-18) : S(0x1p-47);
  const Values<S> c0 = dot(n.first, w.first), c3 = dot(n.last, w.last);
  const Values<S> c1 = (dot(n.twice_middle, w.first) + dot(n.first, w.last)) * S(1.0 / 3);
  const Values<S> c2 = (dot(n.last, w.first) + dot(n.twice_middle, w.last)) * S(1.0 / 3);
  const Values<S> uv = u.size * v.size, both = u.size + v.size;
  const Values<S> bound =
      o * (uv + both * w.size) + 3 * o * o * (both + w.size + 2 * o) + rounding * (uv * w.size) + tiny<S>;
  return {greater<S>(smaller(smaller(c0, c1), smaller(c2, c3)), bound),
          greater<S>(-bound, larger(larger(c0, c1), larger(c2, c3)))};
}
template <class S>
KBVH_INLINE Words<S> opposite(const Sign<S>& a, const Sign<S>& b) {
  return (a.positive & b.negative) | (a.negative & b.positive);
}
template <class S>
KBVH_INLINE Words<S> alike(const Sign<S>& a, const Sign<S>& b, const Sign<S>& c) {
  return (a.positive & b.positive & c.positive) | (a.negative & b.negative & c.negative);
}

/// Returns all bits set where some edge of one triangle certainly passes through the other triangle
/// throughout.
template <class S>
[[gnu::noinline]] Words<S> intersecting(const Corners<S>& first, const Corners<S>& last, Values<S> o) {
  const Point<S> zero{};
  const Point<S>* const a0[3] = {&zero, &first.a1, &first.a2};
  const Point<S>* const a1[3] = {&zero, &last.a1, &last.a2};
  const Point<S>* const b0[3] = {&first.b0, &first.b1, &first.b2};
  const Point<S>* const b1[3] = {&last.b0, &last.b1, &last.b2};
  // The side of the plane of b on which each corner of a lies, and vice versa.
  Sign<S> side_a[3], side_b[3];
  {
    const Linear<S> u = difference(*b0[1], *b1[1], *b0[0], *b1[0]),
                    v = difference(*b0[2], *b1[2], *b0[0], *b1[0]);
    const Normal<S> n = normal_of(u, v);
    for (std::size_t i = 0; i < 3; ++i)
      side_a[i] = sign_of(u, v, n, difference(*a0[i], *a1[i], *b0[0], *b1[0]), o);
  }
  {
    const Linear<S> u = difference(*a0[1], *a1[1], zero, zero), v = difference(*a0[2], *a1[2], zero, zero);
    const Normal<S> n = normal_of(u, v);
    for (std::size_t k = 0; k < 3; ++k)
      side_b[k] = sign_of(u, v, n, difference(*b0[k], *b1[k], zero, zero), o);
  }
  // The turn of edge i of a around edge k of b; the same sign in both orders.
  Sign<S> turn[3][3];
  for (std::size_t i = 0; i < 3; ++i) {
    const std::size_t j = (i + 1) % 3;
    const Linear<S> u = difference(*a0[j], *a1[j], *a0[i], *a1[i]);
    Linear<S> to_b[3];
    for (std::size_t k = 0; k < 3; ++k) to_b[k] = difference(*b0[k], *b1[k], *a0[i], *a1[i]);
    for (std::size_t k = 0; k < 3; ++k)
      turn[i][k] = sign_of(u, to_b[k], normal_of(u, to_b[k]), to_b[(k + 1) % 3], o);
  }
  Words<S> found{};
  for (std::size_t i = 0; i < 3; ++i) {
    const std::size_t j = (i + 1) % 3;
    found |= opposite(side_a[i], side_a[j]) & alike(turn[i][0], turn[i][1], turn[i][2]);
    found |= opposite(side_b[i], side_b[j]) & alike(turn[0][i], turn[1][i], turn[2][i]);
  }
  return found;
}

// ---- Both -------------------------------------------------------------------------------------------------

/// The decided pairs of one register, as bits.
struct Certain {
  unsigned apart, intersect;
};

template <class S>
[[gnu::noinline]] Certain decide_register(const SpanPair<S>* const* pairs, S rounding) {
  constexpr std::size_t width = lanes<S>;
  constexpr unsigned all = unsigned((std::uint64_t(1) << width) - 1);
  alignas(64) S fractions[2][width];
  for (std::size_t k = 0; k < width; ++k) {
    fractions[0][k] = S(pairs[k]->begin);
    fractions[1][k] = S(pairs[k]->end);
  }
  const auto begin = load_lanes<Values<S>>(fractions[0]), end = load_lanes<Values<S>>(fractions[1]);
  Corners<S> first, last;
  Point<S>* const points[2][5] = {{&first.a1, &first.a2, &first.b0, &first.b1, &first.b2},
                                  {&last.a1, &last.a2, &last.b0, &last.b1, &last.b2}};
  Point<S> origin[2];
  Values<S> largest{};
  for (std::size_t c = 0; c < 6; ++c) {
    const S* rows[2][width];
    for (std::size_t k = 0; k < width; ++k) {
      rows[0][k] = pairs[k]->corner[0][c];
      rows[1][k] = pairs[k]->corner[1][c];
    }
    const Point<S> p = load_points(rows[0]), q = load_points(rows[1]);
    const Point<S> size_p = absolute(p), size_q = absolute(q);
    largest = larger(larger(size_p.x, size_p.y), larger(size_p.z, largest));
    largest = larger(larger(size_q.x, size_q.y), larger(size_q.z, largest));
    const Point<S> at_begin = between(p, q, begin), at_end = between(p, q, end);
    if (c == 0) {
      origin[0] = at_begin;
      origin[1] = at_end;
    } else {
      *points[0][c - 1] = at_begin - origin[0];
      *points[1][c - 1] = at_end - origin[1];
    }
  }
  const Values<S> component = rounding * largest + tiny<S>, along = 2 * component;
  // Twice the corners at the middle; only directions are derived from them.
  const Point<S> a1 = sum(first.a1, last.a1), a2 = sum(first.a2, last.a2);
  const Point<S> b0 = sum(first.b0, last.b0), b1 = sum(first.b1, last.b1), b2 = sum(first.b2, last.b2);
  const Point<S> edges_a[3] = {a1, a2 - a1, a2}, edges_b[3] = {b1 - b0, b2 - b1, b2 - b0};
  Words<S> found = apart(first, last, cross_product(edges_a[0], edges_a[2]), along);
  found |= apart(first, last, cross_product(edges_b[0], edges_b[2]), along);
  for (std::size_t i = 0; i < 3; ++i) {
    if (high_bits<S>(found) == all) return {all, 0};
    for (std::size_t j = 0; j < 3; ++j)
      found |= apart(first, last, cross_product(edges_a[i], edges_b[j]), along);
  }
  const unsigned separate = high_bits<S>(found);
  if (separate == all) return {all, 0};
  return {separate, high_bits<S>(intersecting(first, last, component))};
}

template <class S>
void decide(const SpanPair<S>* pairs, std::size_t count, S rounding, SpanVerdict* verdicts) {
  constexpr std::size_t width = lanes<S>;
  for (std::size_t at = 0; at < count; at += width) {
    const SpanPair<S>* chosen[width];
    const std::size_t valid = count - at < width ? count - at : width;
    for (std::size_t k = 0; k < width; ++k) chosen[k] = pairs + at + (k < valid ? k : valid - 1);
    const Certain certain = decide_register<S>(chosen, rounding);
    for (std::size_t k = 0; k < valid; ++k)
      verdicts[at + k] = static_cast<SpanVerdict>((certain.apart >> k & 1) != 0       ? 1
                                                  : (certain.intersect >> k & 1) != 0 ? 2
                                                                                      : 0);
  }
}

}  // namespace

namespace kernels::KBVH_KERNELS {
const SpanTestKernels<float> span_tests_float{&decide<float>};
const SpanTestKernels<double> span_tests_double{&decide<double>};
}  // namespace kernels::KBVH_KERNELS

}  // namespace kbvh
