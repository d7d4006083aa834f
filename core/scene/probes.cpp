#include "core/scene/probes.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "core/motion/admissible.hpp"
#include "core/scene/distance_comparison.hpp"

namespace kbvh {
namespace {

/// Tests whether the distance of a point and a closed triangle is at most that of the comparison.
template <class T>
bool compare(DistanceComparison<T>& distance, const double* centre, const double* corners) {
  using Comparison = DistanceComparison<T>;
  return distance.point_triangle(Comparison::point(centre), Comparison::point(corners),
                                 Comparison::point(corners + 3), Comparison::point(corners + 6));
}

void check(const RayProbes<float>& probes) {
  check_rays(probes.rays);
}
void check(const RayProbes<double>& probes) {
  check_rays(probes.rays);
}
template <class S>
void check(const BallProbes<S>& probes) {
  if (probes.found == nullptr) throw std::invalid_argument("there is no list for what balls meet");
  for (std::size_t i = 0; i < probes.balls.size(); ++i) {
    const Ball<S>& ball = probes.balls[i];
    for (int axis = 0; axis < 3; ++axis)
      if (!(std::abs(ball.centre[axis]) <= admissible_magnitude<S>))
        throw std::invalid_argument("ball " + std::to_string(i) + ": centre has " +
                                    number_text(double(ball.centre[axis])) + " on axis " +
                                    std::to_string(axis));
    if (!(ball.radius >= 0 && ball.radius <= admissible_magnitude<S>))
      throw std::invalid_argument("ball " + std::to_string(i) + ": radius " +
                                  number_text(double(ball.radius)));
  }
}

}  // namespace

BallBox::BallBox(const double* centre, double radius) {
  constexpr double infinity = std::numeric_limits<double>::infinity();
  for (int axis = 0; axis < 3; ++axis) {
    lower_[axis] = std::nextafter(centre[axis] - radius, -infinity);
    upper_[axis] = std::nextafter(centre[axis] + radius, infinity);
  }
}

template <class S>
BallSearch<S>::BallSearch(const Ball<S>& ball, std::uint32_t index, BallHits& found)
    : radius_(double(ball.radius)), index_(index), found_(&found) {
  for (int axis = 0; axis < 3; ++axis) centre_[axis] = double(ball.centre[axis]);
}

template <class S>
bool BallSearch<S>::apart(const double* corners) const {
  for (int axis = 0; axis < 3; ++axis) {
    // The rounding of a difference is monotone, so a rounded gap beyond the radius is a gap beyond it.
    const auto [low, high] = std::minmax({corners[axis], corners[axis + 3], corners[axis + 6]});
    if (low - centre_[axis] > radius_ || centre_[axis] - high > radius_) return true;
  }
  return false;
}

template <class S>
bool BallSearch<S>::offer(std::uint32_t body, std::uint32_t primitive, const PolygonTriangles& polygon,
                          const S* positions, TriangleTestStats& stats) {
  for (std::uint32_t i = 0; i < polygon.count(); ++i) {
    const auto vertices = polygon[i];
    double corners[9];
    for (std::size_t c = 0; c < 3; ++c)
      for (std::size_t axis = 0; axis < 3; ++axis)
        corners[3 * c + axis] = double(positions[std::size_t(3) * vertices[c] + axis]);
    ++stats.tests;
    if (apart(corners)) {
      ++stats.filtered;
      continue;
    }
    DistanceComparison<BoundedDouble> filtered(radius_);
    bool met = compare(filtered, centre_, corners);
    if (filtered.undecided()) {
      ++stats.exact;
      DistanceComparison<Dyadic> exact(radius_);
      met = compare(exact, centre_, corners);
    } else {
      ++stats.filtered;
    }
    if (!met) continue;
    found_->push_back({index_, body, primitive});
    break;
  }
  return false;
}

template <class S>
void check_probes(const Probes<S>& probes) {
  if (const auto* rays = std::get_if<RayProbes<S>>(&probes); rays && rays->hits.size() != rays->rays.size())
    throw std::invalid_argument(std::to_string(rays->rays.size()) + " rays take as many answers, not " +
                                std::to_string(rays->hits.size()));
  std::visit([](const auto& asked) { check(asked); }, probes);
}

template void check_probes(const Probes<float>&);
template void check_probes(const Probes<double>&);
template class BallSearch<float>;
template class BallSearch<double>;

}  // namespace kbvh
