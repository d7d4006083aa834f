#include "core/geometry/triangle_triangle.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

// Three stages, kept apart so that a batched filter can stand in for the first:
//   1. signs:    on which sides of each triangle's plane the other's corners lie (filtered), rejecting most
//   pairs;
//   2. decision: from the 6 signs alone, which 2 edge-edge orientations tell whether the two intervals that
//   the
//                triangles cut out of the planes' common line overlap;
//   3. the rest: coplanar and degenerate input, by dimension, on exact signs.

namespace kbvh {
namespace {

/// Three corners, always in double: float input converts exactly, and then has 29 bits to spare.
struct Triangle {
  double corner[3][3];
};

template <class S>
Triangle load(const S* p0, const S* p1, const S* p2) {
  return {{{p0[0], p0[1], p0[2]}, {p1[0], p1[1], p1[2]}, {p2[0], p2[1], p2[2]}}};
}

// ---- Signs ----------------------------------------------------------------------------------------------

/// Values of orient3d(plane, corner i of the other triangle) and one bound on the error of all three.
struct SideValues {
  double value[3];
  double bound;

  bool one_side() const {
    const double low = std::min(std::min(value[0], value[1]), value[2]);
    const double high = std::max(std::max(value[0], value[1]), value[2]);
    return (low > bound) | (high < -bound);
  }
};

/// The same operations as in orient3d_filtered, so the same error bounds hold.
inline SideValues side_values(const Triangle& plane, const Triangle& other) {
  const double* a = plane.corner[0];
  const double* b = plane.corner[1];
  const double* c = plane.corner[2];
  const double bx = b[0] - a[0], by = b[1] - a[1], bz = b[2] - a[2];
  const double cx = c[0] - a[0], cy = c[1] - a[1], cz = c[2] - a[2];
  const double by_cz = by * cz, bz_cy = bz * cy;
  const double bz_cx = bz * cx, bx_cz = bx * cz;
  const double bx_cy = bx * cy, by_cx = by * cx;
  const double nx = by_cz - bz_cy, ny = bz_cx - bx_cz, nz = bx_cy - by_cx;
  SideValues result;
  double wx = 0, wy = 0, wz = 0;
  for (int i = 0; i < 3; ++i) {
    const double dx = other.corner[i][0] - a[0];
    const double dy = other.corner[i][1] - a[1];
    const double dz = other.corner[i][2] - a[2];
    result.value[i] = nx * dx + ny * dy + nz * dz;
    wx = std::max(wx, std::fabs(dx));
    wy = std::max(wy, std::fabs(dy));
    wz = std::max(wz, std::fabs(dz));
  }
  const double permanent = (std::fabs(by_cz) + std::fabs(bz_cy)) * wx +
                           (std::fabs(bz_cx) + std::fabs(bx_cz)) * wy +
                           (std::fabs(bx_cy) + std::fabs(by_cx)) * wz;
  result.bound = filter::relative3d * permanent + filter::absolute3d;
  return result;
}

/// Signs of the three corners of one triangle against the plane of the other.
using Sides = std::array<int, 3>;

inline Sides to_sides(const SideValues& values) {
  return {sign_beyond(values.value[0], values.bound), sign_beyond(values.value[1], values.bound),
          sign_beyond(values.value[2], values.bound)};
}

inline bool complete(const Sides& s) {
  return (s[0] != undecided_sign) & (s[1] != undecided_sign) & (s[2] != undecided_sign);
}
inline bool all_equal(const Sides& s, int sign) {
  return s[0] == sign && s[1] == sign && s[2] == sign;
}
inline bool strictly_one_side(const Sides& s) {
  return s[0] != 0 && s[0] == s[1] && s[1] == s[2];
}

void complete_exactly(Sides& sides, const Triangle& plane, const Triangle& other) {
  for (int i = 0; i < 3; ++i)
    if (sides[i] == undecided_sign)
      sides[i] = orient3d_exact(plane.corner[0], plane.corner[1], plane.corner[2], other.corner[i]);
}

// ---- Decision -------------------------------------------------------------------------------------------

/// The corner that the other triangle's plane cuts off, and the side on which it lies of the other two.
struct Apex {
  signed char corner = 0;
  signed char side = 0;
};

/// Both edges at the apex cross the plane (in at least one point, and not along the edge). With a corner on
/// each side and one in the plane, the positive one is taken.
constexpr Apex find_apex(int s0, int s1, int s2) {
  const int s[3] = {s0, s1, s2};
  for (int side : {1, -1})
    for (int i = 0; i < 3; ++i) {
      const int p = side * s[i], q = side * s[(i + 1) % 3], r = side * s[(i + 2) % 3];
      const bool apart = (p > 0 && q <= 0 && r <= 0) || (p == 0 && q < 0 && r < 0);
      if (apart) return {static_cast<signed char>(i), static_cast<signed char>(side)};
    }
  return {};
}

constexpr std::array<Apex, 27> make_apices() {
  std::array<Apex, 27> table{};
  for (int i = 0; i < 27; ++i)
    table[static_cast<std::size_t>(i)] = find_apex(i / 9 - 1, i / 3 % 3 - 1, i % 3 - 1);
  return table;
}
constexpr std::array<Apex, 27> apices = make_apices();

inline Apex apex_of(const Sides& s) {
  return apices[static_cast<std::size_t>(9 * s[0] + 3 * s[1] + s[2] + 13)];
}

/// Do the triangles intersect, given the sides, where each triangle meets the plane of the other, neither
/// lies in it and (so) both are proper? `edge_sign(p, q, r, s)` is the sign of orient3d.
///
/// Each triangle cuts an interval out of the line common to both planes; its ends are on the edges at the
/// apex. With X on the edge a-a' and Y on b-b', and the line directed along normal(a) x normal(b),
///   orient3d(a, a', b, b') = det(a' - a, Y - X, b' - b), and its sign is sign(Y - X) side(a) side(b).
/// On side +1 the edge to the next corner ends the interval of a above, that of b below; on side -1
/// conversely.
template <class EdgeSign>
bool intervals_overlap(const Triangle& a, const Sides& sides_a, const Triangle& b, const Sides& sides_b,
                       EdgeSign&& edge_sign) {
  static constexpr int next[4] = {1, 2, 0, 1};
  const Apex top_a = apex_of(sides_a), top_b = apex_of(sides_b);
  const double* p = a.corner[top_a.corner];
  const double* q = b.corner[top_b.corner];
  const double* p_high = a.corner[next[top_a.corner]];
  const double* p_low = a.corner[next[top_a.corner + 1]];
  const double* q_low = b.corner[next[top_b.corner]];
  const double* q_high = b.corner[next[top_b.corner + 1]];
  if (top_a.side < 0) std::swap(p_low, p_high);
  if (top_b.side < 0) std::swap(q_low, q_high);
  const int direction = top_a.side * top_b.side;
  return direction * edge_sign(p, p_low, q, q_high) >= 0 && direction * edge_sign(p, p_high, q, q_low) <= 0;
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

/// The axis whose dropping leaves a, b, c a proper triangle, or -1 if they are collinear.
int proper_axis(const double* a, const double* b, const double* c) {
  for (int axis = 2; axis >= 0; --axis)
    if (orient2d(a, b, c, drop_axis(axis)) != 0) return axis;
  return -1;
}

/// The simplex that a triangle's corners span: 3 corners of a proper triangle, the 2 ends of a segment in
/// lexicographical order, or 1 point.
struct Simplex {
  const double* corner[3];
  int size;
  int axis;  // for size 3: may be dropped
};

Simplex reduce(const Triangle& t) {
  const double *p = t.corner[0], *q = t.corner[1], *r = t.corner[2];
  const int axis = proper_axis(p, q, r);
  if (axis >= 0) return {{p, q, r}, 3, axis};
  // Along a line the lexicographical order is the order on the line, or its reverse.
  const double* first = p;
  const double* last = p;
  for (const double* x : {q, r}) {
    if (lexicographically_less(x, first)) first = x;
    if (lexicographically_less(last, x)) last = x;
  }
  return {{first, last, last}, same_point(first, last) ? 1 : 2, -1};
}

/// Does a line through an edge of x strictly separate the projections? Edges of a segment have two outer
/// sides.
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

/// Two simplices in one plane that projects injectively, not all on one line: apart iff the normal of an edge
/// of either separates them (the edges of the Minkowski difference have no other directions).
bool coplanar_intersect(const Simplex& x, const Simplex& y, int axis) {
  const Projection projection = drop_axis(axis);
  return !edge_separates(x, y, projection) && !edge_separates(y, x, projection);
}

/// A proper triangle and a segment or point.
bool triangle_meets_smaller(const Simplex& t, const Simplex& x) {
  const double *a = t.corner[0], *b = t.corner[1], *c = t.corner[2], *p = x.corner[0], *q = x.corner[1];
  const int side_p = orient3d(a, b, c, p);
  const int side_q = x.size == 1 ? side_p : orient3d(a, b, c, q);
  if (side_p == 0 && side_q == 0) return coplanar_intersect(t, x, t.axis);
  if (side_p == side_q) return false;
  // The line p-q crosses the plane in one point: inside iff it passes all edges on the same side.
  const int ab = orient3d(p, q, a, b), bc = orient3d(p, q, b, c), ca = orient3d(p, q, c, a);
  return (ab >= 0 && bc >= 0 && ca >= 0) || (ab <= 0 && bc <= 0 && ca <= 0);
}

/// Segments or points on one line.
bool collinear_intersect(const Simplex& x, const Simplex& y) {
  return !lexicographically_less(x.corner[x.size - 1], y.corner[0]) &&
         !lexicographically_less(y.corner[y.size - 1], x.corner[0]);
}

/// Segments or points, both.
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

/// Triangles that are coplanar, or of which at least one is degenerate.
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

/// From complete sides, whatever is left of them.
Outcome finish(const Triangle& a, const Sides& sides_a, const Triangle& b, const Sides& sides_b, bool exact) {
  const bool overlap = intervals_overlap(
      a, sides_a, b, sides_b, [&exact](const double* p, const double* q, const double* r, const double* s) {
        const int sign = orient3d_filtered(p, q, r, s);
        if (sign != undecided_sign) return sign;
        exact = true;
        return orient3d_exact(p, q, r, s);
      });
  return outcome(overlap, exact);
}

/// The filter left a side open: a corner is in or near the plane of the other triangle.
[[gnu::noinline]] Outcome decide_open(const Triangle& a, Sides sides_a, const Triangle& b, Sides sides_b) {
  // Meshes that lie on each other, or share corners, come here often; most are decided by comparisons.
  if (boxes_apart(a, b)) return Outcome::separate;
  if (share_corner(a, b)) return Outcome::intersect;
  complete_exactly(sides_b, a, b);
  if (strictly_one_side(sides_b)) return Outcome::separate_exactly;
  // All in the plane: coplanar, or a is degenerate and has no plane.
  if (all_equal(sides_b, 0)) return outcome(flat_intersect(a, b), true);
  complete_exactly(sides_a, b, a);
  if (strictly_one_side(sides_a)) return Outcome::separate_exactly;
  // a is proper and b not all in its plane, so b is degenerate.
  if (all_equal(sides_a, 0)) return outcome(flat_intersect(a, b), true);
  return finish(a, sides_a, b, sides_b, true);
}

inline Outcome decide(const Triangle& a, const Triangle& b) {
  const SideValues values_b = side_values(a, b);
  if (values_b.one_side()) return Outcome::separate;
  const SideValues values_a = side_values(b, a);
  if (values_a.one_side()) return Outcome::separate;
  const Sides sides_b = to_sides(values_b), sides_a = to_sides(values_a);
  if (!complete(sides_a) || !complete(sides_b)) return decide_open(a, sides_a, b, sides_b);
  return finish(a, sides_a, b, sides_b, false);
}

}  // namespace

template <class S>
bool triangles_intersect(const S* a0, const S* a1, const S* a2, const S* b0, const S* b1, const S* b2,
                         TriangleTestStats* stats) {
  const Outcome result = decide(load(a0, a1, a2), load(b0, b1, b2));
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
