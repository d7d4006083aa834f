#pragma once
#include <array>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include <boost/multiprecision/cpp_int.hpp>

#include "core/geometry/ray_triangle.hpp"
#include "core/scene/playback.hpp"

namespace kbvh {

/// A simple planar polygon as its even-odd region with its boundary, in rational arithmetic: the truth about
/// a polygon, independent of how it is cut.
class PolygonRegion {
 public:
  /// Makes the region of a polygon with corners [corner][3]; nothing unless the polygon is planar, has a
  /// nonzero area, and its edges meet only at common corners. O(corners^2).
  static std::optional<PolygonRegion> of(std::span<const std::array<double, 3>> corners);

  /// Returns whether two regions share a point. O(corners^2).
  bool meets(const PolygonRegion& other) const;
  /// Returns whether a ray shares a point with the region.
  bool meets(const RayLine& ray) const;

 private:
  using Rational = boost::multiprecision::cpp_rational;
  using Point = std::array<Rational, 3>;
  bool apart_by_boxes(const PolygonRegion& other) const;
  bool meets_segment(const Point& p, const Point& q) const;
  bool contains(const Point& p) const;  ///< p lies in the plane
  Rational height(const Point& p) const;
  int turn(const Point& a, const Point& b, const Point& c) const;
  bool on_segment(const Point& a, const Point& b, const Point& p) const;
  bool segments_meet(const Point& a, const Point& b, const Point& c, const Point& d) const;
  bool is_simple() const;

  std::vector<Point> corners_;
  std::array<double, 3> lower_{}, upper_{};
  Point normal_;
  std::size_t u_ = 0, v_ = 1;  ///< axes of the projection
};

/// The regions of a scene's polygons at one time, made when they are asked for.
template <class S>
class PolygonRegions {
 public:
  PolygonRegions(const Scene<S>& scene, const Playback<S>& playback) : scene_(&scene), playback_(&playback) {}

  /// Returns whether a polygon was cut at the playback's current time, so that a region may decide about it.
  bool decides(std::uint32_t body, std::uint32_t primitive) const {
    const PolygonCuts& cuts = scene_->bodies[body].primitives.cuts;
    return cuts.contains(primitive) && cuts.times[primitive] == playback_->time();
  }
  /// Returns a polygon's region; null if it has none. All positions must be current.
  const PolygonRegion* region(std::uint32_t body, std::uint32_t primitive);

 private:
  const Scene<S>* scene_;
  const Playback<S>* playback_;
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::optional<PolygonRegion>> made_;
};

extern template class PolygonRegions<float>;
extern template class PolygonRegions<double>;

}  // namespace kbvh
