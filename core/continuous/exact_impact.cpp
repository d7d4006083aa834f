// Exact impacts by integers: roots of the cubic and of the quadratics as algebraic numbers.

#include <algorithm>
#include <vector>

#include "core/continuous/impact.hpp"
#include "core/motion/moving_vector.hpp"

namespace kbvh {
namespace {

using Integer = Polynomial::Integer;

using Vector = MovingVector<Polynomial>;

/// Converts all 24 coordinates to integers times one power of two; a common factor changes no verdict.
void scale(const MovingPoints& points, Vector (&moving)[4]) {
  Dyadic values[4][3][2];
  int lowest = 0;
  bool first = true;
  for (int i = 0; i < 4; ++i)
    for (int k = 0; k < 3; ++k)
      for (int end = 0; end < 2; ++end) {
        Dyadic& value = values[i][k][end];
        value = Dyadic((end == 0 ? points.begin : points.end)[i][k]);
        if (value.sign() == 0) continue;
        const int exponent = value.exponent() + int(lsb(abs(value.mantissa())));
        lowest = first ? exponent : std::min(lowest, exponent);
        first = false;
      }
  const auto integer = [&](const Dyadic& value) -> Integer {
    if (value.sign() == 0) return 0;
    const int shift = value.exponent() - lowest;
    if (shift >= 0) return value.mantissa() << unsigned(shift);
    return value.mantissa() / (Integer(1) << unsigned(-shift));
  };
  for (int i = 0; i < 4; ++i)
    for (int k = 0; k < 3; ++k)
      moving[i].axis[k] = Polynomial::line(integer(values[i][k][0]), integer(values[i][k][1]));
}

/// One query, as polynomials. Vertex-face: a and b are the edges from the face's first corner, and r goes
/// from there to the vertex; at contact r = y a + x b with x, y, 1 - x - y >= 0, so that a x r = x n and r x
/// b = y n with n = a x b. Edge-edge: a and b are the edges, and r goes from one start to the other; at
/// contact r = y a - x b with x and y in [0, 1], so that r x a = x n and r x b = y n.
class ExactQuery {
 public:
  ExactQuery(Contact::Kind kind, const MovingPoints& points) : kind_(kind) {
    scale(points, p_);
    Vector a, b, r;
    if (kind == Contact::Kind::vertex_face) {
      a = p_[2] - p_[1];
      b = p_[3] - p_[1];
      r = p_[0] - p_[1];
    } else {
      a = p_[1] - p_[0];
      b = p_[3] - p_[2];
      r = p_[2] - p_[0];
    }
    normal_ = cross(a, b);
    coplanar_ = dot(normal_, r);
    const bool at_ends[2] = {coplanar_.sign_at(0, 0) == 0, coplanar_.sign_at(1, 0) == 0};
    for (const int end : {0, 1})
      if (at_ends[end]) times_.emplace_back(DyadicTime{end, 0});
    if (!coplanar_.is_zero()) {
      append_inner_roots(coplanar_, times_);
      if (times_.empty()) return;
    }
    const Vector x = kind == Contact::Kind::vertex_face ? cross(a, r) : cross(r, a);
    const Vector y = cross(r, b);
    if (kind == Contact::Kind::vertex_face)
      shares_ = {x, y, normal_ - x - y};
    else
      shares_ = {x, y, normal_ - x, normal_ - y};
    if (coplanar_.is_zero() && !touch_at(times_[0])) add_times_in_plane();
  }

  Impact impact() {
    Impact result;
    constexpr unsigned bits = 20;
    static_assert(impact_width == 1.0 / (1U << bits));
    for (AlgebraicTime& t : times_) {
      // In a short interval, most polynomials that are not zero at t have one sign throughout.
      t.refine(bits);
      if (!touch_at(t)) continue;
      if (t.end() == 0) return {true, 0, 0};
      if (!result.touches) result = {true, t.begin(), t.end()};
      result.begin = std::min(result.begin, t.begin());
      result.end = std::min(result.end, t.end());
    }
    return result;
  }

 private:
  /// Adds candidate times for points that stay in one plane. The set of contact times is closed, and it can
  /// change only at roots of the polynomials that `touch_at` reads. So if there is any contact, there is one
  /// at such a root or at an end.
  void add_times_in_plane() {
    const auto add = [&](const Vector& vector) {
      for (const Polynomial& q : vector.axis)
        if (q.degree() >= 1) append_inner_roots(q, times_);
    };
    add(normal_);
    for (const Vector& share : shares_) add(share);
    for (const auto& [i, j] : differences()) add(p_[i] - p_[j]);
  }

  struct Two {
    int i, j;
  };
  std::vector<Two> differences() const {
    if (kind_ == Contact::Kind::vertex_face) return {{0, 1}, {0, 2}, {0, 3}};
    return {{0, 2}, {0, 3}, {1, 2}, {1, 3}};
  }

  /// Tests contact at a time at which the four points are coplanar.
  bool touch_at(const AlgebraicTime& t) const {
    for (int k = 0; k < 3; ++k) {
      const int side = t.sign(normal_.axis[k]);
      if (side == 0) continue;
      // Projecting along axis k preserves the points' plane.
      for (const Vector& share : shares_)
        if (t.sign(share.axis[k]) * side < 0) return false;
      return true;
    }
    // The face is a segment or a point, or the edges are parallel or points: an end of one must lie on the
    // other.
    if (kind_ == Contact::Kind::vertex_face)
      return on_segment(t, 0, 1, 2, shares_[0]) || on_segment(t, 0, 1, 3, shares_[1]) ||
             on_segment(t, 0, 2, 3, shares_[2]);
    return on_segment(t, 2, 0, 1, shares_[0]) || on_segment(t, 3, 0, 1, shares_[2]) ||
           on_segment(t, 0, 2, 3, shares_[1]) || on_segment(t, 1, 2, 3, shares_[3]);
  }
  /// Returns whether point i is on the segment from j to k. `area` is twice that of the three points, up to
  /// its sign.
  bool on_segment(const AlgebraicTime& t, int i, int j, int k, const Vector& area) const {
    for (const Polynomial& component : area.axis)
      if (t.sign(component) != 0) return false;
    for (int axis = 0; axis < 3; ++axis)
      if (t.sign(p_[i].axis[axis] - p_[j].axis[axis]) * t.sign(p_[i].axis[axis] - p_[k].axis[axis]) > 0)
        return false;
    return true;
  }

  Contact::Kind kind_;
  Vector p_[4], normal_;
  Polynomial coplanar_;
  std::vector<Vector> shares_;
  std::vector<AlgebraicTime> times_;  ///< candidate times of contact
};

}  // namespace

Impact find_impact_exact(Contact::Kind kind, const MovingPoints& points) {
  return ExactQuery(kind, points).impact();
}

}  // namespace kbvh
