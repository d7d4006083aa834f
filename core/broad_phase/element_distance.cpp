#include "core/broad_phase/element_distance.hpp"

#include <algorithm>
#include <cmath>

#include "core/geometry/triangle_triangle.hpp"
#include "core/motion/exact_arithmetic.hpp"

namespace kbvh {
namespace {

/// A double with a bound on its distance from the real number that it stands for. Sums and products take a
/// few operations; the bound covers its own rounding, too.
class Bounded {
 public:
  Bounded() = default;
  Bounded(double value) : value_(value) {}  // NOLINT(google-explicit-constructor): formulas read better

  friend Bounded operator+(const Bounded& a, const Bounded& b) {
    const double sum = a.value_ + b.value_;
    return {sum, (a.error_ + b.error_ + std::fabs(sum) * unit) * slack + tiny};
  }
  friend Bounded operator-(const Bounded& a, const Bounded& b) { return a + Bounded(-b.value_, b.error_); }
  friend Bounded operator*(const Bounded& a, const Bounded& b) {
    const double product = a.value_ * b.value_;
    const double error = std::fabs(a.value_) * b.error_ + std::fabs(b.value_) * a.error_ +
                         a.error_ * b.error_ + std::fabs(product) * unit;
    return {product, error * slack + tiny};
  }
  /// Returns -1 or 1; undecided_sign where the bound does not exclude another sign, or is no number:
  /// a zero is never proved.
  int sign() const {
    if (value_ > error_) return 1;
    if (value_ < -error_) return -1;
    return undecided_sign;
  }

 private:
  Bounded(double value, double error) : value_(value), error_(error) {}
  // Half an ulp of the result; the few roundings within a bound; products that underflow, in the value or in
  // the bound.
  static constexpr double unit = 0x1p-53, slack = 1 + 0x1p-49, tiny = 0x1p-1060;
  double value_ = 0, error_ = 0;
};

/// Distances of elements against one distance, in numbers of type T. A sign that T leaves undecided is noted,
/// and the verdict means nothing then.
template <class T>
class Comparison {
 public:
  explicit Comparison(double distance) : squared_(T(distance) * T(distance)) {}
  bool undecided() const { return undecided_; }

  struct Point {
    T v[3];
  };
  static Point point(const double* p) { return {{T(p[0]), T(p[1]), T(p[2])}}; }

  bool points(const Point& p, const Point& q) { return not_beyond(dot(minus(p, q), minus(p, q)), T(1.0)); }

  /// The nearest point of a segment is an end, or the foot of the perpendicular if that lies between them.
  bool point_segment(const Point& p, const Point& a, const Point& b) {
    const Point along = minus(b, a), from = minus(p, a);
    const T at = dot(from, along);
    if (sign(at) <= 0) return points(p, a);
    const T length = dot(along, along);
    if (sign(at - length) >= 0) return points(p, b);
    return not_beyond(dot(from, from) * length - at * at, length);
  }

  /// The nearest point of a triangle is the foot of the perpendicular if it lies inside, else on a side.
  bool point_triangle(const Point& p, const Point& a, const Point& b, const Point& c) {
    const Point normal = cross(minus(b, a), minus(c, a)), from = minus(p, a);
    const T size = dot(normal, normal);
    if (sign(size) > 0 && sign(dot(cross(minus(b, a), from), normal)) >= 0 &&
        sign(dot(cross(minus(c, b), minus(p, b)), normal)) >= 0 &&
        sign(dot(cross(minus(a, c), minus(p, c)), normal)) >= 0) {
      const T height = dot(from, normal);
      return not_beyond(height * height, size);
    }
    return point_segment(p, a, b) || point_segment(p, b, c) || point_segment(p, c, a);
  }

  /// The nearest points of two segments are those of their lines if these lie on both, else one is an end.
  bool segments(const Point& a, const Point& b, const Point& c, const Point& d) {
    const Point u = minus(b, a), v = minus(d, c), w = minus(c, a), normal = cross(u, v);
    const T size = dot(normal, normal);
    if (sign(size) > 0) {
      const T on_first = dot(cross(w, v), normal), on_second = dot(cross(w, u), normal);
      if (sign(on_first) >= 0 && sign(on_first - size) <= 0 && sign(on_second) >= 0 &&
          sign(on_second - size) <= 0) {
        const T height = dot(w, normal);
        return not_beyond(height * height, size);
      }
    }
    return point_segment(a, c, d) || point_segment(b, c, d) || point_segment(c, a, b) ||
           point_segment(d, a, b);
  }

 private:
  static Point minus(const Point& a, const Point& b) {
    return {{a.v[0] - b.v[0], a.v[1] - b.v[1], a.v[2] - b.v[2]}};
  }
  static T dot(const Point& a, const Point& b) { return a.v[0] * b.v[0] + a.v[1] * b.v[1] + a.v[2] * b.v[2]; }
  static Point cross(const Point& a, const Point& b) {
    return {{a.v[1] * b.v[2] - a.v[2] * b.v[1], a.v[2] * b.v[0] - a.v[0] * b.v[2],
             a.v[0] * b.v[1] - a.v[1] * b.v[0]}};
  }
  int sign(const T& x) {
    const int s = x.sign();
    if (s != undecided_sign) return s;
    undecided_ = true;
    return 0;
  }
  /// Returns whether numerator / denominator, a squared distance, is at most the given one squared.
  bool not_beyond(const T& numerator, const T& denominator) {
    return sign(squared_ * denominator - numerator) >= 0;
  }

  T squared_;
  bool undecided_ = false;
};

/// Returns whether an edge and a face, or two faces, have a common point.
bool touch(CandidateKind kind, const double* const* a, const double* const* b) {
  return triangles_intersect<double>(a[0], a[1], kind == CandidateKind::edge_face ? a[1] : a[2], b[0], b[1],
                                     b[2]);
}

template <class T>
bool compare(CandidateKind kind, const double* const* a, const double* const* b, Comparison<T>& distance) {
  using Point = typename Comparison<T>::Point;
  const auto corners = [](const double* const* from, std::size_t count, Point(&to)[3]) {
    for (std::size_t i = 0; i < count; ++i) to[i] = Comparison<T>::point(from[i]);
  };
  const auto count = [](Element element) {
    return element == Element::vertex ? std::size_t(1) : element == Element::edge ? 2 : 3;
  };
  Point p[3], q[3];
  corners(a, count(first_element(kind)), p);
  corners(b, count(second_element(kind)), q);
  switch (kind) {
    case CandidateKind::vertex_vertex:
      return distance.points(p[0], q[0]);
    case CandidateKind::edge_vertex:
      return distance.point_segment(q[0], p[0], p[1]);
    case CandidateKind::edge_edge:
      return distance.segments(p[0], p[1], q[0], q[1]);
    case CandidateKind::face_vertex:
      return distance.point_triangle(q[0], p[0], p[1], p[2]);
    case CandidateKind::edge_face:
      // Of an edge and a face that are apart, one nearest point is an end of the edge, or both are on edges.
      for (int i = 0; i < 2; ++i)
        if (distance.point_triangle(p[i], q[0], q[1], q[2])) return true;
      for (int i = 0; i < 3; ++i)
        if (distance.segments(p[0], p[1], q[i], q[(i + 1) % 3])) return true;
      return false;
    case CandidateKind::face_face:
      break;
  }
  for (int i = 0; i < 3; ++i)
    if (distance.point_triangle(p[i], q[0], q[1], q[2]) || distance.point_triangle(q[i], p[0], p[1], p[2]))
      return true;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      if (distance.segments(p[i], p[(i + 1) % 3], q[j], q[(j + 1) % 3])) return true;
  return false;
}

std::size_t corner_count(Element element) {
  return std::size_t(element) + 1;
}

/// Returns whether the boxes of two elements are certainly farther apart than the distance along an axis.
bool boxes_apart(const double* const* a, std::size_t count_a, const double* const* b, std::size_t count_b,
                 double distance) {
  for (int axis = 0; axis < 3; ++axis) {
    double low_a = a[0][axis], high_a = low_a, low_b = b[0][axis], high_b = low_b;
    for (std::size_t i = 1; i < count_a; ++i) {
      low_a = std::min(low_a, a[i][axis]);
      high_a = std::max(high_a, a[i][axis]);
    }
    for (std::size_t i = 1; i < count_b; ++i) {
      low_b = std::min(low_b, b[i][axis]);
      high_b = std::max(high_b, b[i][axis]);
    }
    // The rounding of a difference is monotone, so a rounded gap beyond the distance is a gap beyond it.
    if (low_b - high_a > distance || low_a - high_b > distance) return true;
  }
  return false;
}

}  // namespace

bool is_within_exact(CandidateKind kind, const double* const* a, const double* const* b, double distance) {
  if ((kind == CandidateKind::edge_face || kind == CandidateKind::face_face) && touch(kind, a, b))
    return true;
  Comparison<Dyadic> exact(distance);
  return compare(kind, a, b, exact);
}

bool is_within(CandidateKind kind, const double* const* a, const double* const* b, double distance,
               DistanceStats* stats) {
  if (stats != nullptr) ++stats->tests;
  if (boxes_apart(a, corner_count(first_element(kind)), b, corner_count(second_element(kind)), distance)) {
    if (stats != nullptr) ++stats->apart;
    return false;
  }
  Comparison<Bounded> filtered(distance);
  const bool near = compare(kind, a, b, filtered);
  if (!filtered.undecided()) {
    if (stats != nullptr) ++stats->filtered;
    const bool may_touch = kind == CandidateKind::edge_face || kind == CandidateKind::face_face;
    return near || (may_touch && touch(kind, a, b));
  }
  if (stats != nullptr) ++stats->exact;
  return is_within_exact(kind, a, b, distance);
}

template <class S>
std::size_t keep_within(CandidateKind kind, const Elements& elements, const S* points, double distance,
                        std::span<const Candidate> candidates, Candidate* out, DistanceStats* stats) {
  const Element first = first_element(kind), second = second_element(kind);
  const std::uint32_t* const lists[2] = {elements.of(first).vertices.data(),
                                         elements.of(second).vertices.data()};
  const std::size_t counts[2] = {corner_count(first), corner_count(second)};
  double numbers[2][3][3];
  const double* corners[2][3];
  for (int side = 0; side < 2; ++side)
    for (int i = 0; i < 3; ++i) corners[side][i] = numbers[side][i];
  std::size_t kept = 0;
  for (const Candidate& candidate : candidates) {
    const std::uint32_t ids[2] = {candidate.first, candidate.second};
    for (int side = 0; side < 2; ++side)
      for (std::size_t i = 0; i < counts[side]; ++i) {
        const S* const from = points + std::size_t(4) * lists[side][counts[side] * ids[side] + i];
        for (int axis = 0; axis < 3; ++axis) numbers[side][i][axis] = double(from[axis]);
      }
    if (is_within(kind, corners[0], corners[1], distance, stats)) out[kept++] = candidate;
  }
  return kept;
}

template std::size_t keep_within(CandidateKind, const Elements&, const float*, double,
                                 std::span<const Candidate>, Candidate*, DistanceStats*);
template std::size_t keep_within(CandidateKind, const Elements&, const double*, double,
                                 std::span<const Candidate>, Candidate*, DistanceStats*);

}  // namespace kbvh
