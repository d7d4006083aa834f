#include "core/scene/rays.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <tuple>

#include "core/motion/admissible.hpp"

namespace kbvh {

template <class S>
bool RaySearch<S>::offer(std::uint32_t body, std::uint32_t primitive, const PolygonTriangles& polygon,
                         const S* positions, TriangleTestStats& stats) {
  for (std::uint32_t i = 0; i < polygon.count(); ++i) {
    const auto vertices = polygon[i];
    double corners[9];
    for (std::size_t c = 0; c < 3; ++c)
      for (std::size_t axis = 0; axis < 3; ++axis)
        corners[3 * c + axis] = double(positions[std::size_t(3) * vertices[c] + axis]);
    RayMeeting meeting;
    // Equal meetings need no arithmetic: the smaller (body, primitive) wins.
    RayMeeting known;
    const bool same = hit_ && meets_at_same_corners(line_, corners_, best_, corners, known);
    const bool smaller = std::tie(body, primitive) < std::tie(hit_.body, hit_.primitive);
    if (same && !smaller) {
      ++stats.tests;
      ++stats.filtered;
      continue;
    }
    if (!ray_meets_triangle(line_, corners, meeting, stats, same ? &known : nullptr)) continue;
    if (hit_ && !same) {
      int order = 0;
      if (meeting.parameter + meeting.error < best_.parameter - best_.error)
        order = -1;
      else if (meeting.parameter - meeting.error > best_.parameter + best_.error)
        order = 1;
      else {
        ++stats.ray_decisions;
        order = compare_meetings(line_, corners, corners_);
      }
      if (order > 0 || (order == 0 && !smaller)) continue;
    }
    hit_ = {body, primitive, meeting.parameter};
    best_ = meeting;
    std::copy_n(corners, 9, corners_);
  }
  return query_ == RayQuery::any && hit_;
}

template <class S>
void check_rays(std::span<const Ray<S>> rays) {
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const Ray<S>& ray = rays[i];
    for (const S* values : {ray.origin, ray.direction})
      for (int axis = 0; axis < 3; ++axis)
        if (!(std::abs(values[axis]) <= admissible_magnitude<S>))
          throw std::invalid_argument("ray " + std::to_string(i) + ": " +
                                      (values == ray.origin ? "origin" : "direction") + " has " +
                                      number_text(double(values[axis])) + " on axis " + std::to_string(axis));
    if (!(ray.length >= 0))
      throw std::invalid_argument("ray " + std::to_string(i) + ": length " + number_text(double(ray.length)));
  }
}

template void check_rays(std::span<const Ray<float>>);
template void check_rays(std::span<const Ray<double>>);
template class RaySearch<float>;
template class RaySearch<double>;

}  // namespace kbvh
