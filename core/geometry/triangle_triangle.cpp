#include "core/geometry/triangle_triangle.hpp"

#if defined(__SSE2__)
#include <emmintrin.h>
#endif

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

// Three stages; core/geometry/kernels/triangles.cpp has the first two for many pairs at once:
//   1. signs:    on which sides of each triangle's plane the other's corners lie (filtered), rejecting most
//                pairs;
//   2. decision: from the 6 signs alone, which 2 edge-edge orientations decide whether the two intervals that
//                the triangles cut out of the planes' common line overlap;
//   3. the rest: coplanar and degenerate input, by dimension, on exact signs.

namespace kbvh {
namespace {

/// Three corners, always in double: float input converts exactly and leaves 29 bits to spare.
struct Triangle {
  double corner[3][3];
};

template <class S>
Triangle load(const S* p0, const S* p1, const S* p2) {
  return {{{p0[0], p0[1], p0[2]}, {p1[0], p1[1], p1[2]}, {p2[0], p2[1], p2[2]}}};
}

// ---- Signs ----------------------------------------------------------------------------------------------

/// Two doubles that are computed together: SSE2 where available (every x86-64), plain code elsewhere, with
/// the same results.
#if defined(__SSE2__)
struct Lanes {
  __m128d v;
};
inline Lanes lanes(double x, double y) {
  return {_mm_set_pd(y, x)};
}
inline Lanes lanes(float x, float y) {
  return {_mm_cvtps_pd(_mm_set_ps(0, 0, y, x))};
}
inline Lanes swapped(Lanes x) {
  return {_mm_shuffle_pd(x.v, x.v, 1)};
}
inline Lanes operator+(Lanes x, Lanes y) {
  return {_mm_add_pd(x.v, y.v)};
}
inline Lanes operator-(Lanes x, Lanes y) {
  return {_mm_sub_pd(x.v, y.v)};
}
inline Lanes operator*(Lanes x, Lanes y) {
  return {_mm_mul_pd(x.v, y.v)};
}
inline Lanes abs(Lanes x) {
  return {_mm_andnot_pd(_mm_set1_pd(-0.0), x.v)};
}
inline Lanes max(Lanes x, Lanes y) {
  return {_mm_max_pd(x.v, y.v)};
}
inline Lanes min(Lanes x, Lanes y) {
  return {_mm_min_pd(x.v, y.v)};
}
/// Returns a mask: bit i is set where lane i of x is greater.
inline int greater(Lanes x, Lanes y) {
  return _mm_movemask_pd(_mm_cmpgt_pd(x.v, y.v));
}
#else
struct Lanes {
  double x, y;
};
inline Lanes lanes(double x, double y) {
  return {x, y};
}
inline Lanes swapped(Lanes a) {
  return {a.y, a.x};
}
inline Lanes operator+(Lanes a, Lanes b) {
  return {a.x + b.x, a.y + b.y};
}
inline Lanes operator-(Lanes a, Lanes b) {
  return {a.x - b.x, a.y - b.y};
}
inline Lanes operator*(Lanes a, Lanes b) {
  return {a.x * b.x, a.y * b.y};
}
inline Lanes abs(Lanes a) {
  return {std::fabs(a.x), std::fabs(a.y)};
}
inline Lanes max(Lanes a, Lanes b) {
  return {std::max(a.x, b.x), std::max(a.y, b.y)};
}
inline Lanes min(Lanes a, Lanes b) {
  return {std::min(a.x, b.x), std::min(a.y, b.y)};
}
inline int greater(Lanes a, Lanes b) {
  return (a.x > b.x ? 1 : 0) + (a.y > b.y ? 2 : 0);
}
#endif

inline Lanes error_bound(Lanes permanent) {
  return lanes(filter::relative3d, filter::relative3d) * permanent +
         lanes(filter::absolute3d, filter::absolute3d);
}

struct LanePoint {
  Lanes x, y, z;
};
inline LanePoint operator-(const LanePoint& p, const LanePoint& q) {
  return {p.x - q.x, p.y - q.y, p.z - q.z};
}

/// A cross product and, for each of its components, the sum of the absolute products.
struct Cross {
  LanePoint value, magnitude;
};
inline Cross cross(const LanePoint& b, const LanePoint& c) {
  const Lanes by_cz = b.y * c.z, bz_cy = b.z * c.y;
  const Lanes bz_cx = b.z * c.x, bx_cz = b.x * c.z;
  const Lanes bx_cy = b.x * c.y, by_cx = b.y * c.x;
  return {{by_cz - bz_cy, bz_cx - bx_cz, bx_cy - by_cx},
          {abs(by_cz) + abs(bz_cy), abs(bz_cx) + abs(bx_cz), abs(bx_cy) + abs(by_cx)}};
}
inline Lanes dot(const LanePoint& p, const LanePoint& q) {
  return p.x * q.x + p.y * q.y + p.z * q.z;
}

/// orient3d(plane of one triangle, corner i of the other), not yet rounded to a sign: a's plane and b's
/// corners in lane 0, b's plane and a's corners in lane 1. One bound holds for the errors of a lane's three
/// values (the operations are those of orient3d_filtered; the permanent is the largest of the three).
struct SideValues {
  Lanes value[3];
  Lanes bound;
  Lanes minus_bound;

  /// Returns whether all six signs are known.
  bool decided() const {
    const Lanes smallest = min(min(abs(value[0]), abs(value[1])), abs(value[2]));
    return greater(smallest, bound) == 3;
  }

  /// Returns whether a triangle lies strictly on one side of the other's plane.
  bool separate() const {
    const Lanes low = min(min(value[0], value[1]), value[2]);
    const Lanes high = max(max(value[0], value[1]), value[2]);
    return (greater(low, bound) | greater(minus_bound, high)) != 0;
  }
};

template <class S>
inline SideValues side_values(const S* const (&a)[3], const S* const (&b)[3]) {
  LanePoint corner[3], other[3];
  for (int i = 0; i < 3; ++i) {
    corner[i] = {lanes(a[i][0], b[i][0]), lanes(a[i][1], b[i][1]), lanes(a[i][2], b[i][2])};
    other[i] = {swapped(corner[i].x), swapped(corner[i].y), swapped(corner[i].z)};
  }
  const Cross normal = cross(corner[1] - corner[0], corner[2] - corner[0]);
  const LanePoint d0 = other[0] - corner[0], d1 = other[1] - corner[0], d2 = other[2] - corner[0];
  const LanePoint reach = {max(max(abs(d0.x), abs(d1.x)), abs(d2.x)),
                           max(max(abs(d0.y), abs(d1.y)), abs(d2.y)),
                           max(max(abs(d0.z), abs(d1.z)), abs(d2.z))};
  const Lanes bound = error_bound(dot(normal.magnitude, reach));
  return {
      {dot(normal.value, d0), dot(normal.value, d1), dot(normal.value, d2)}, bound, lanes(0.0, 0.0) - bound};
}

/// Signs of the three corners of one triangle against the plane of the other.
using Sides = std::array<int, 3>;

/// Returns the signs in one lane (0: of b's corners, 1: of a's).
inline Sides to_sides(const SideValues& values, int lane) {
  Sides sides{};
  for (int i = 0; i < 3; ++i) {
    const int positive = greater(values.value[i], values.bound) >> lane & 1;
    const int negative = greater(values.minus_bound, values.value[i]) >> lane & 1;
    sides[static_cast<std::size_t>(i)] = (positive | negative) != 0 ? positive - negative : undecided_sign;
  }
  return sides;
}

inline bool all_equal(const Sides& s, int sign) {
  return s[0] == sign && s[1] == sign && s[2] == sign;
}
inline bool strictly_one_side(const Sides& s) {
  return s[0] != 0 && s[0] == s[1] && s[1] == s[2];
}

void complete_exactly(Sides& sides, const Triangle& plane, const Triangle& other) {
  for (std::size_t i = 0; i < 3; ++i)
    if (sides[i] == undecided_sign)
      sides[i] = orient3d_exact(plane.corner[0], plane.corner[1], plane.corner[2], other.corner[i]);
}

// ---- Decision -------------------------------------------------------------------------------------------

/// The corner that the other triangle's plane cuts off from the other two, and its side of that plane.
struct Apex {
  signed char corner = 0;
  signed char side = 0;
};

/// Finds the apex. Both edges at the apex cross the plane (in at least one point, and not along the edge).
/// With a corner on each side and one in the plane, the positive corner is taken.
constexpr Apex find_apex(const Sides& s) {
  for (int side : {1, -1})
    for (std::size_t i = 0; i < 3; ++i) {
      const int p = side * s[i], q = side * s[(i + 1) % 3], r = side * s[(i + 2) % 3];
      const bool apart = (p > 0 && q <= 0 && r <= 0) || (p == 0 && q < 0 && r < 0);
      if (apart) return {static_cast<signed char>(i), static_cast<signed char>(side)};
    }
  return {};
}

/// The apex for each set of corners on the positive side (bit i: corner i); the other corners lie on the
/// negative side.
constexpr std::array<Apex, 8> strict_apices = [] {
  std::array<Apex, 8> table{};
  for (int i = 0; i < 8; ++i)
    table[static_cast<std::size_t>(i)] = find_apex({(i & 1) * 2 - 1, (i >> 1 & 1) * 2 - 1, (i >> 2) * 2 - 1});
  return table;
}();

/// The remaining question once the sides are known.
///
/// If each triangle meets the plane of the other and neither lies in it, both are proper, and each cuts an
/// interval out of the line common to both planes. The ends of an interval lie on the edges at the apices p
/// and q. With X on the edge p-p' and Y on q-q', and the line directed along normal(a) x normal(b),
///   orient3d(p, p', q, q') = det(p' - p, Y - X, q' - q), and its sign is sign(Y - X) side(p) side(q).
/// On side +1 the edge to the next corner ends the interval of a above and the interval of b below; on side
/// -1 conversely. So with direction = side(p) side(q) the intervals overlap iff
///   direction orient3d(p, p_low, q, q_high) >= 0 and direction orient3d(p, p_high, q, q_low) <= 0.
template <class S>
struct IntervalEnds {
  const S *p, *p_low, *p_high;
  const S *q, *q_low, *q_high;
  int direction;
};

template <class S>
inline IntervalEnds<S> interval_ends(const S* const (&a)[3], Apex p, const S* const (&b)[3], Apex q) {
  static constexpr int next[4] = {1, 2, 0, 1};
  const int swap_a = p.side < 0 ? 1 : 0, swap_b = q.side < 0 ? 1 : 0;
  return {a[p.corner],    a[next[p.corner + 1 - swap_a]], a[next[p.corner + swap_a]],
          b[q.corner],    b[next[q.corner + swap_b]],     b[next[q.corner + 1 - swap_b]],
          p.side * q.side};
}

// ---- Coplanar and degenerate input ----------------------------------------------------------------------

inline bool same_point(const double* p, const double* q) {
  return p[0] == q[0] && p[1] == q[1] && p[2] == q[2];
}

inline bool lexicographically_less(const double* p, const double* q) {
  if (p[0] != q[0]) return p[0] < q[0];
  if (p[1] != q[1]) return p[1] < q[1];
  return p[2] < q[2];
}

/// Returns an axis along which a, b, c project to a proper triangle, or -1 if they are collinear.
int proper_axis(const double* a, const double* b, const double* c) {
  for (int axis = 0; axis < 3; ++axis)
    if (orient2d_filtered(a, b, c, drop_axis(axis)) != undecided_sign) return axis;
  for (int axis = 0; axis < 3; ++axis)
    if (orient2d_exact(a, b, c, drop_axis(axis)) != 0) return axis;
  return -1;
}

/// The simplex that a triangle's corners span: 3 corners of a proper triangle, the 2 ends of a segment in
/// lexicographical order, or 1 point.
struct Simplex {
  const double* corner[3];
  int size;
  int axis;  // for size 3: the axis of projection
};

Simplex reduce(const Triangle& t) {
  const double *p = t.corner[0], *q = t.corner[1], *r = t.corner[2];
  const int axis = proper_axis(p, q, r);
  if (axis >= 0) return {{p, q, r}, 3, axis};
  // Along a line the lexicographical order is the order on the line or its reverse.
  const double* first = p;
  const double* last = p;
  for (const double* x : {q, r}) {
    if (lexicographically_less(x, first)) first = x;
    if (lexicographically_less(last, x)) last = x;
  }
  return {{first, last, last}, same_point(first, last) ? 1 : 2, -1};
}

/// Tests whether a line through an edge of x strictly separates the projections. Edges of a segment have two
/// outer sides.
bool edge_separates(const Simplex& x, const Simplex& y, Projection projection) {
  const int edges = x.size == 3 ? 3 : x.size - 1;
  for (int i = 0; i < edges; ++i) {
    const double* p = x.corner[i];
    const double* q = x.corner[(i + 1) % x.size];
    const int side = orient2d(p, q, y.corner[0], projection);
    if (side == 0) continue;
    bool outside = x.size == 2 || side != orient2d(p, q, x.corner[(i + 2) % 3], projection);
    for (int j = 1; outside && j < y.size; ++j) outside = orient2d(p, q, y.corner[j], projection) == side;
    if (outside) return true;
  }
  return false;
}

/// Tests two simplices in one plane that projects injectively and that do not all lie on one line. They are
/// disjoint iff the normal of an edge of either one separates them (the edges of the Minkowski difference
/// have no other directions).
bool coplanar_intersect(const Simplex& x, const Simplex& y, int axis) {
  const Projection projection = drop_axis(axis);
  return !edge_separates(x, y, projection) && !edge_separates(y, x, projection);
}

/// Tests a proper triangle and a segment or point.
bool triangle_meets_smaller(const Simplex& t, const Simplex& x) {
  const double *a = t.corner[0], *b = t.corner[1], *c = t.corner[2], *p = x.corner[0], *q = x.corner[1];
  const int side_p = orient3d(a, b, c, p);
  const int side_q = x.size == 1 ? side_p : orient3d(a, b, c, q);
  if (side_p == 0 && side_q == 0) return coplanar_intersect(t, x, t.axis);
  if (side_p == side_q) return false;
  // The line p-q crosses the plane in one point, which is inside iff the line passes all edges on the same
  // side.
  const int ab = orient3d(p, q, a, b), bc = orient3d(p, q, b, c), ca = orient3d(p, q, c, a);
  return (ab >= 0 && bc >= 0 && ca >= 0) || (ab <= 0 && bc <= 0 && ca <= 0);
}

/// Tests segments or points on one line.
bool collinear_intersect(const Simplex& x, const Simplex& y) {
  return !lexicographically_less(x.corner[x.size - 1], y.corner[0]) &&
         !lexicographically_less(y.corner[y.size - 1], x.corner[0]);
}

/// Tests two simplices that are segments or points.
bool smaller_intersect(const Simplex& x, const Simplex& y) {
  if (x.size < y.size) return smaller_intersect(y, x);
  const double *p = x.corner[0], *q = x.corner[1], *r = y.corner[0], *s = y.corner[1];
  if (x.size == 1) return same_point(p, r);
  if (y.size == 1) return proper_axis(p, q, r) < 0 && collinear_intersect(x, y);
  if (orient3d(p, q, r, s) != 0) return false;
  int axis = proper_axis(p, q, r);
  if (axis < 0) axis = proper_axis(p, q, s);
  return axis < 0 ? collinear_intersect(x, y) : coplanar_intersect(x, y, axis);
}

/// Tests triangles that are coplanar, or at least one of which is degenerate.
bool flat_intersect(const Triangle& a, const Triangle& b) {
  const Simplex x = reduce(a), y = reduce(b);
  if (x.size == 3 && y.size == 3) return coplanar_intersect(x, y, x.axis);
  if (x.size == 3) return triangle_meets_smaller(x, y);
  if (y.size == 3) return triangle_meets_smaller(y, x);
  return smaller_intersect(x, y);
}

// ---- All together ---------------------------------------------------------------------------------------

bool boxes_apart(const Triangle& a, const Triangle& b) {
  for (int axis = 0; axis < 3; ++axis) {
    const auto [a_low, a_high] = std::minmax({a.corner[0][axis], a.corner[1][axis], a.corner[2][axis]});
    const auto [b_low, b_high] = std::minmax({b.corner[0][axis], b.corner[1][axis], b.corner[2][axis]});
    if (a_high < b_low || b_high < a_low) return true;
  }
  return false;
}

bool share_corner(const Triangle& a, const Triangle& b) {
  for (const auto& p : a.corner)
    for (const auto& q : b.corner)
      if (same_point(p, q)) return true;
  return false;
}

enum class Outcome { separate, intersect, separate_exactly, intersect_exactly };

inline Outcome outcome(bool intersects, bool exact) {
  if (exact) return intersects ? Outcome::intersect_exactly : Outcome::separate_exactly;
  return intersects ? Outcome::intersect : Outcome::separate;
}

template <class S>
[[gnu::noinline]] bool intervals_overlap_exactly(const IntervalEnds<S>& e) {
  const auto sign = [](const S* k, const S* l, const S* m, const S* n) {
    const double points[4][3] = {
        {k[0], k[1], k[2]}, {l[0], l[1], l[2]}, {m[0], m[1], m[2]}, {n[0], n[1], n[2]}};
    return orient3d(points[0], points[1], points[2], points[3]);
  };
  return e.direction * sign(e.p, e.p_low, e.q, e.q_high) >= 0 &&
         e.direction * sign(e.p, e.p_high, e.q, e.q_low) <= 0;
}

/// Decides from complete sides; `exact` says whether the sides needed integers. Both orientations are
/// computed together, with the sign of the second reversed so that both must be positive.
template <class S>
inline Outcome finish(const IntervalEnds<S>& e, bool exact) {
  const auto pair = [](const S* x, const S* y) {
    return LanePoint{lanes(x[0], y[0]), lanes(x[1], y[1]), lanes(x[2], y[2])};
  };
  const LanePoint p = pair(e.p, e.p), q = pair(e.q, e.q);
  const Cross normal = cross(pair(e.p_low, e.p_high) - p, q - p);
  const LanePoint d = pair(e.q_high, e.q_low) - p;
  const Lanes value = lanes(double(e.direction), double(-e.direction)) * dot(normal.value, d);
  const Lanes bound = error_bound(dot(normal.magnitude, {abs(d.x), abs(d.y), abs(d.z)}));
  if (greater(value, bound) == 3) return outcome(true, exact);
  if (greater(lanes(0.0, 0.0) - bound, value) != 0) return outcome(false, exact);
  return outcome(intervals_overlap_exactly(e), true);
}

/// Decides a pair with a side that the filter left open: a corner lies in or near the plane of the other
/// triangle.
[[gnu::noinline]] Outcome decide_open(const Triangle& a, Sides sides_a, const Triangle& b, Sides sides_b) {
  // Meshes that touch or share corners often reach this point; comparisons decide most of them.
  if (boxes_apart(a, b)) return Outcome::separate;
  if (share_corner(a, b)) return Outcome::intersect;
  complete_exactly(sides_b, a, b);
  if (strictly_one_side(sides_b)) return Outcome::separate_exactly;
  // All corners lie in the plane: the triangles are coplanar, or a is degenerate and has no plane.
  if (all_equal(sides_b, 0)) return outcome(flat_intersect(a, b), true);
  complete_exactly(sides_a, b, a);
  if (strictly_one_side(sides_a)) return Outcome::separate_exactly;
  // Here a is proper and b does not lie in its plane, so b is degenerate.
  if (all_equal(sides_a, 0)) return outcome(flat_intersect(a, b), true);
  const double* const corners_a[3] = {a.corner[0], a.corner[1], a.corner[2]};
  const double* const corners_b[3] = {b.corner[0], b.corner[1], b.corner[2]};
  return finish(interval_ends(corners_a, find_apex(sides_a), corners_b, find_apex(sides_b)), true);
}

template <class S>
inline Outcome decide(const S* const (&a)[3], const S* const (&b)[3]) {
  const SideValues values = side_values(a, b);
  if (values.separate()) return Outcome::separate;
  if (!values.decided())
    return decide_open(load(a[0], a[1], a[2]), to_sides(values, 1), load(b[0], b[1], b[2]),
                       to_sides(values, 0));
  const Lanes zero = lanes(0.0, 0.0);
  const int p0 = greater(values.value[0], zero), p1 = greater(values.value[1], zero),
            p2 = greater(values.value[2], zero);
  const int positive_b = (p0 & 1) | (p1 & 1) << 1 | (p2 & 1) << 2;
  const int positive_a = p0 >> 1 | (p1 & 2) | (p2 & 2) << 1;
  return finish(interval_ends(a, strict_apices[static_cast<std::size_t>(positive_a)], b,
                              strict_apices[static_cast<std::size_t>(positive_b)]),
                false);
}

}  // namespace

template <class S>
bool triangles_intersect(const S* a0, const S* a1, const S* a2, const S* b0, const S* b1, const S* b2,
                         TriangleTestStats* stats) {
  const Outcome result = decide<S>({a0, a1, a2}, {b0, b1, b2});
  if (stats != nullptr) {
    const bool exact = result == Outcome::separate_exactly || result == Outcome::intersect_exactly;
    stats->tests += 1;
    stats->exact += exact ? 1 : 0;
    stats->filtered += exact ? 0 : 1;
  }
  return result == Outcome::intersect || result == Outcome::intersect_exactly;
}

template bool triangles_intersect<float>(const float*, const float*, const float*, const float*, const float*,
                                         const float*, TriangleTestStats*);
template bool triangles_intersect<double>(const double*, const double*, const double*, const double*,
                                          const double*, const double*, TriangleTestStats*);

}  // namespace kbvh
