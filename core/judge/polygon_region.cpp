#include "core/judge/polygon_region.hpp"

#include <algorithm>
#include <cmath>

namespace kbvh {

std::optional<PolygonRegion> PolygonRegion::of(std::span<const std::array<double, 3>> corners) {
  PolygonRegion made;
  const std::size_t n = corners.size();
  if (n < 3) return {};
  made.lower_ = made.upper_ = corners[0];
  for (const auto& corner : corners) {
    made.corners_.push_back({Rational(corner[0]), Rational(corner[1]), Rational(corner[2])});
    for (std::size_t axis = 0; axis < 3; ++axis) {
      made.lower_[axis] = std::min(made.lower_[axis], corner[axis]);
      made.upper_[axis] = std::max(made.upper_[axis], corner[axis]);
    }
  }
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::size_t s = (axis + 1) % 3, t = (axis + 2) % 3;
    made.normal_[axis] = 0;
    for (std::size_t i = 0; i < n; ++i) {
      const Point &p = made.corners_[i], &q = made.corners_[(i + 1) % n];
      made.normal_[axis] += p[s] * q[t] - p[t] * q[s];
    }
  }
  std::size_t axis = 0;
  while (axis < 3 && made.normal_[axis] == 0) ++axis;
  if (axis == 3) return {};
  made.u_ = (axis + 1) % 3;
  made.v_ = (axis + 2) % 3;
  for (const Point& corner : made.corners_)
    if (made.height(corner) != 0) return {};
  if (!made.is_simple()) return {};
  return made;
}

PolygonRegion::Rational PolygonRegion::height(const Point& p) const {
  Rational sum = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) sum += normal_[axis] * (p[axis] - corners_[0][axis]);
  return sum;
}

int PolygonRegion::turn(const Point& a, const Point& b, const Point& c) const {
  const Rational left = (b[u_] - a[u_]) * (c[v_] - a[v_]), right = (b[v_] - a[v_]) * (c[u_] - a[u_]);
  return left.compare(right);
}

bool PolygonRegion::on_segment(const Point& a, const Point& b, const Point& p) const {
  if (turn(a, b, p) != 0) return false;
  for (const std::size_t axis : {u_, v_})
    if (p[axis] < std::min(a[axis], b[axis]) || p[axis] > std::max(a[axis], b[axis])) return false;
  return true;
}

bool PolygonRegion::segments_meet(const Point& a, const Point& b, const Point& c, const Point& d) const {
  if (on_segment(a, b, c) || on_segment(a, b, d) || on_segment(c, d, a) || on_segment(c, d, b)) return true;
  return turn(a, b, c) * turn(a, b, d) < 0 && turn(c, d, a) * turn(c, d, b) < 0;
}

bool PolygonRegion::is_simple() const {
  const std::size_t n = corners_.size();
  for (std::size_t i = 0; i < n; ++i) {
    const Point &a = corners_[i], &b = corners_[(i + 1) % n], &c = corners_[(i + 2) % n];
    if (a == b || on_segment(a, b, c) || on_segment(b, c, a)) return false;
    for (std::size_t j = i + 2; j < n; ++j)
      if ((j + 1) % n != i && segments_meet(a, b, corners_[j], corners_[(j + 1) % n])) return false;
  }
  return true;
}

bool PolygonRegion::contains(const Point& p) const {
  bool inside = false;
  for (std::size_t i = 0; i < corners_.size(); ++i) {
    const Point &a = corners_[i], &b = corners_[(i + 1) % corners_.size()];
    if (on_segment(a, b, p)) return true;
    const bool above_a = a[v_] > p[v_], above_b = b[v_] > p[v_];
    if (above_a != above_b && (above_b ? turn(a, b, p) : turn(b, a, p)) > 0) inside = !inside;
  }
  return inside;
}

bool PolygonRegion::meets_segment(const Point& p, const Point& q) const {
  const Rational at_p = height(p), at_q = height(q);
  if ((at_p > 0 && at_q > 0) || (at_p < 0 && at_q < 0)) return false;
  if (at_p == 0 && at_q == 0) {
    if (contains(p) || contains(q)) return true;
    for (std::size_t i = 0; i < corners_.size(); ++i)
      if (segments_meet(corners_[i], corners_[(i + 1) % corners_.size()], p, q)) return true;
    return false;
  }
  const Rational share = at_p / (at_p - at_q);
  Point crossing;
  for (std::size_t axis = 0; axis < 3; ++axis) crossing[axis] = p[axis] + share * (q[axis] - p[axis]);
  return contains(crossing);
}

bool PolygonRegion::apart_by_boxes(const PolygonRegion& other) const {
  for (std::size_t axis = 0; axis < 3; ++axis)
    if (upper_[axis] < other.lower_[axis] || other.upper_[axis] < lower_[axis]) return true;
  return false;
}

bool PolygonRegion::meets(const PolygonRegion& other) const {
  if (apart_by_boxes(other)) return false;
  // Where two regions meet, an end of their common part lies on the boundary of one of them.
  for (std::size_t i = 0; i < corners_.size(); ++i)
    if (other.meets_segment(corners_[i], corners_[(i + 1) % corners_.size()])) return true;
  for (std::size_t i = 0; i < other.corners_.size(); ++i)
    if (meets_segment(other.corners_[i], other.corners_[(i + 1) % other.corners_.size()])) return true;
  return false;
}

bool PolygonRegion::meets(const RayLine& ray) const {
  Point origin, end;
  Rational length = 0;
  if (std::isfinite(ray.length)) {
    length = Rational(ray.length);
  } else {
    // A point beyond the box on every axis along which the ray moves.
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (ray.direction[axis] == 0) continue;
      const Rational far = abs(Rational(lower_[axis]) - Rational(ray.origin[axis])) +
                           abs(Rational(upper_[axis]) - Rational(ray.origin[axis]));
      length = std::max(length, Rational(far / abs(Rational(ray.direction[axis]))));
    }
  }
  for (std::size_t axis = 0; axis < 3; ++axis) {
    origin[axis] = Rational(ray.origin[axis]);
    end[axis] = origin[axis] + length * Rational(ray.direction[axis]);
  }
  return meets_segment(origin, end);
}

template <class S>
const PolygonRegion* PolygonRegions<S>::region(std::uint32_t body, std::uint32_t primitive) {
  const auto [entry, fresh] = made_.try_emplace({body, primitive});
  if (fresh) {
    const S* const positions = playback_->positions(body);
    std::vector<std::array<double, 3>> corners;
    for (const std::uint32_t v : scene_->bodies[body].primitives[primitive]) {
      const S* const p = positions + std::size_t(3) * v;
      corners.push_back({double(p[0]), double(p[1]), double(p[2])});
    }
    entry->second = PolygonRegion::of(corners);
  }
  return entry->second ? &*entry->second : nullptr;
}

template class PolygonRegions<float>;
template class PolygonRegions<double>;

}  // namespace kbvh
