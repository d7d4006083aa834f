// First times of nearness by integers: the polynomials of squared distances, their roots as algebraic
// numbers.
#include <algorithm>
#include <cmath>
#include <vector>

#include "core/broad_phase/approach.hpp"
#include "core/motion/moving_vector.hpp"

namespace kbvh {
namespace {

using Integer = Dyadic::Integer;
using Time = BasicAlgebraicTime<LongPolynomial>;

using Vector = MovingVector<LongPolynomial>;

/// Two points, a point and a line, a point and a plane, or two lines, and where their nearest points are.
/// They are near at t if `size` is positive there, all of `inside` are at least 0 and `beyond` is at most 0.
struct Feature {
  LongPolynomial size;  ///< zero as a polynomial: not needed
  std::vector<LongPolynomial> inside;
  LongPolynomial beyond;
};

/// The two elements as features. Elements are near exactly when one of their features is: that of their
/// nearest points. So the set of times at which the elements are near is closed; where it begins, a feature
/// begins to be near, at a root of one of its polynomials other than `size`, which is positive there.
class Approach {
 public:
  Approach(Contact::Kind kind, const Dyadic (&begin)[4][3], const Dyadic (&end)[4][3], double distance) {
    scale(begin, end, Dyadic(distance));
    if (kind == Contact::Kind::vertex_face) {
      for (const int i : {1, 2, 3}) add_points(0, i);
      add_point_line(0, 1, 2);
      add_point_line(0, 2, 3);
      add_point_line(0, 3, 1);
      add_point_plane();
    } else {
      for (const int i : {0, 1})
        for (const int j : {2, 3}) add_points(i, j);
      for (const int i : {0, 1}) add_point_line(i, 2, 3);
      for (const int i : {2, 3}) add_point_line(i, 0, 1);
      add_lines();
    }
  }

  Impact first() const {
    if (near_at(Time(DyadicTime{0, 0}))) return {true, 0, 0};
    std::vector<Time> times;
    for (const Feature& feature : features_) {
      append_roots(feature.beyond, times);
      for (const LongPolynomial& q : feature.inside) append_roots(q, times);
    }
    times.emplace_back(DyadicTime{1, 0});
    constexpr unsigned bits = 20;
    static_assert(impact_width == 1.0 / (1U << bits));
    for (Time& t : times) t.refine(bits);  // in a short interval, most polynomials have one sign throughout
    std::sort(times.begin(), times.end(), [](const Time& a, const Time& b) { return a.end() < b.end(); });
    Impact result;
    for (const Time& t : times) {
      if (result.touches && t.begin() >= result.begin) continue;  // the first one begins no later
      if (!near_at(t)) continue;
      if (!result.touches) result = {true, t.begin(), t.end()};
      result.begin = std::min(result.begin, t.begin());
    }
    return result;
  }

 private:
  /// Converts all numbers to integers times one power of two, which changes no verdict.
  void scale(const Dyadic (&begin)[4][3], const Dyadic (&end)[4][3], const Dyadic& distance) {
    int lowest = 0;
    bool first = true;
    const auto look = [&](const Dyadic& value) {
      if (value.sign() == 0) return;
      const int exponent = value.exponent() + int(lsb(abs(value.mantissa())));
      lowest = first ? exponent : std::min(lowest, exponent);
      first = false;
    };
    const auto integer = [&](const Dyadic& value) -> Integer {
      if (value.sign() == 0) return 0;
      const int shift = value.exponent() - lowest;
      if (shift >= 0) return value.mantissa() << unsigned(shift);
      return value.mantissa() / (Integer(1) << unsigned(-shift));
    };
    look(distance);
    for (int i = 0; i < 4; ++i)
      for (int k = 0; k < 3; ++k) {
        look(begin[i][k]);
        look(end[i][k]);
      }
    for (int i = 0; i < 4; ++i)
      for (int k = 0; k < 3; ++k)
        p_[i].axis[k] = LongPolynomial::line(integer(begin[i][k]), integer(end[i][k]));
    const Integer length = integer(distance);
    squared_ = LongPolynomial::line(length * length, length * length);
  }

  void add_points(int i, int j) {
    const Vector between = p_[i] - p_[j];
    features_.push_back({{}, {}, dot(between, between) - squared_});
  }
  void add_point_line(int i, int a, int b) {
    const Vector along = p_[b] - p_[a], from = p_[i] - p_[a];
    const LongPolynomial at = dot(from, along), length = dot(along, along);
    add(length, {at, length - at}, dot(from, from) * length - at * at);
  }
  void add_point_plane() {
    const Vector a = p_[2] - p_[1], b = p_[3] - p_[1], from = p_[0] - p_[1], normal = cross(a, b);
    const LongPolynomial size = dot(normal, normal), height = dot(from, normal);
    const LongPolynomial second = dot(cross(a, from), normal), first = dot(cross(from, b), normal);
    add(size, {second, first, size - first - second}, height * height);
  }
  void add_lines() {
    const Vector u = p_[1] - p_[0], v = p_[3] - p_[2], from = p_[2] - p_[0], normal = cross(u, v);
    const LongPolynomial size = dot(normal, normal), height = dot(from, normal);
    const LongPolynomial on_first = dot(cross(from, v), normal), on_second = dot(cross(from, u), normal);
    add(size, {on_first, size - on_first, on_second, size - on_second}, height * height);
  }
  /// Adds a feature whose squared distance is numerator / size.
  void add(const LongPolynomial& size, std::vector<LongPolynomial> inside, const LongPolynomial& numerator) {
    if (!size.is_zero()) features_.push_back({size, std::move(inside), numerator - squared_ * size});
  }

  static void append_roots(const LongPolynomial& q, std::vector<Time>& times) {
    if (q.degree() >= 1) append_inner_roots(q, times);
  }
  bool near_at(const Time& t) const {
    return std::any_of(features_.begin(), features_.end(), [&](const Feature& feature) {
      return t.sign(feature.beyond) <= 0 &&
             std::all_of(feature.inside.begin(), feature.inside.end(),
                         [&](const LongPolynomial& q) { return t.sign(q) >= 0; }) &&
             (feature.size.is_zero() || t.sign(feature.size) > 0);
    });
  }

  Vector p_[4];
  LongPolynomial squared_;
  std::vector<Feature> features_;
};

}  // namespace

Impact find_approach_within(Contact::Kind kind, const MovingPoints& points, double distance, unsigned k,
                            unsigned exponent) {
  // Shares of the motion are exact, and so are the points then.
  const double length = std::ldexp(1.0, -int(exponent)), start = double(k) * length;
  const auto at = [&](int i, int axis, double t) {
    return (Dyadic(1.0) - Dyadic(t)) * Dyadic(points.begin[i][axis]) +
           Dyadic(t) * Dyadic(points.end[i][axis]);
  };
  Dyadic from[4][3], to[4][3];
  for (int i = 0; i < 4; ++i)
    for (int axis = 0; axis < 3; ++axis) {
      from[i][axis] = at(i, axis, start);
      to[i][axis] = at(i, axis, start + length);
    }
  const Impact impact = Approach(kind, from, to, distance).first();
  if (!impact.touches) return impact;
  // Rounds outward. A start other than 0 is at least as large as the length, so that the rounding error of
  // the sum is known exactly.
  const auto place = [&](double share, double outward) {
    const double sum = start + length * share;
    return sum - start == length * share ? sum : std::nextafter(sum, outward);
  };
  return {true, place(impact.begin, 0), place(impact.end, 2)};
}

Impact find_approach_exact(Contact::Kind kind, const MovingPoints& points, double distance) {
  return find_approach_within(kind, points, distance, 0, 0);
}

}  // namespace kbvh
