#include "core/broad_phase/approach.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/scene/distance_comparison.hpp"

namespace kbvh {
namespace {

constexpr unsigned finest = 20;
static_assert(impact_width == 1.0 / (1U << finest));
/// Comparisons of distances before the rest of a motion is left to integers. A plain approach takes two for
/// each halving.
constexpr int most_comparisons = 96;

/// The two elements at any t, compared with distances: in double with bounds, then in dyadic numbers. All t
/// are multiples of 2^-21, so that the points are exact.
class MovingElements {
 public:
  MovingElements(Contact::Kind kind, const MovingPoints& points)
      : points_(points), face_(kind == Contact::Kind::vertex_face), largest_step_(largest_step()) {}

  bool near_at(double t, double distance) {
    DistanceComparison<BoundedDouble> filtered(distance);
    const bool near = compare(filtered, t);
    if (!filtered.undecided()) return near;
    exact_ = true;
    DistanceComparison<Dyadic> exact(distance);
    return compare(exact, t);
  }
  /// Returns whether the elements are farther apart than the distance from t - half to t + half; false where
  /// this is not proved.
  bool free_around(double t, double half, double distance) {
    const double limit =
        (distance + half * largest_step_) * (1 + 0x1p-50) + std::numeric_limits<double>::min();
    return std::isfinite(limit) && !near_at(t, limit);
  }
  /// Returns whether any comparison needed dyadic numbers.
  bool exact() const { return exact_; }

 private:
  template <class T>
  bool compare(DistanceComparison<T>& comparison, double t) const {
    typename DistanceComparison<T>::Point p[4];
    for (int i = 0; i < 4; ++i)
      for (int k = 0; k < 3; ++k) p[i].v[k] = T(1 - t) * T(points_.begin[i][k]) + T(t) * T(points_.end[i][k]);
    return face_ ? comparison.point_triangle(p[0], p[1], p[2], p[3])
                 : comparison.segments(p[0], p[1], p[2], p[3]);
  }
  /// Returns a bound on the difference of the displacements of two points, one of each element. These are
  /// convex combinations of corners' displacements, so two corners differ most.
  double largest_step() const {
    double largest = 0;
    const int split = face_ ? 1 : 2;
    for (int i = 0; i < split; ++i)
      for (int j = split; j < 4; ++j) {
        double squared = 0, size = 0;
        for (int k = 0; k < 3; ++k) {
          const double a = points_.end[i][k] - points_.begin[i][k],
                       b = points_.end[j][k] - points_.begin[j][k];
          squared += (a - b) * (a - b);
          size = std::max({size, std::fabs(points_.end[i][k]), std::fabs(points_.begin[i][k]),
                           std::fabs(points_.end[j][k]), std::fabs(points_.begin[j][k])});
        }
        // Each difference is wrong by at most 8 half ulps of the largest coordinate, or by underflow.
        largest = std::max(largest, std::sqrt(squared) * (1 + 0x1p-48) + size * 0x1p-47 + 0x1p-500);
      }
    return largest;
  }

  const MovingPoints& points_;
  bool face_, exact_ = false;
  double largest_step_;
};

}  // namespace

Impact find_approach(Contact::Kind kind, const MovingPoints& points, double distance, ImpactStats* stats) {
  MovingElements elements(kind, points);
  bool by_integers = false;
  const auto decided = [&](const Impact& impact) {
    if (stats != nullptr) {
      ++stats->tests;
      ++(by_integers || elements.exact() ? stats->exact : stats->filtered);
    }
    return impact;
  };
  if (elements.near_at(0, distance)) return decided({true, 0, 0});

  // Intervals [k, k + 1] / 2^exponent, the earliest on top; the elements are apart before it.
  struct Interval {
    unsigned k, exponent;
  };
  Interval stack[finest + 2] = {{0, 0}};
  int comparisons = 1;
  for (int depth = 1; depth > 0;) {
    const auto [k, exponent] = stack[--depth];
    const double length = std::ldexp(1.0, -int(exponent)), begin = double(k) * length;
    if (comparisons < most_comparisons) {
      ++comparisons;
      if (elements.free_around(begin + length / 2, length / 2, distance)) continue;
      if (exponent < finest) {
        stack[depth++] = {2 * k + 1, exponent + 1};
        stack[depth++] = {2 * k, exponent + 1};
        continue;
      }
      ++comparisons;
      if (elements.near_at(begin + length, distance)) return decided({true, begin, begin + length});
    }
    // Where the filter has failed once, it seldom decides later.
    by_integers = true;
    comparisons = most_comparisons;
    const Impact impact = find_approach_within(kind, points, distance, k, exponent);
    if (impact.touches) return decided(impact);
  }
  return decided({});
}

}  // namespace kbvh
