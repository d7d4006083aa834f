#include "core/geometry/volumes/slab_area.hpp"

#include <algorithm>
#include <cmath>

#include "core/base/assert.hpp"

namespace kbvh {
namespace {

struct Point {
  double x[3];
};

double scalar_product(const double* a, const double* b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/// A convex polygon that is clipped by half-spaces; each clip adds at most one corner.
class Polygon {
 public:
  /// Makes the square around a point of a plane, with half-width `reach`.
  Polygon(const Point& centre, const Point& u, const Point& v, double reach) {
    for (const auto& [along_u, along_v] : {std::pair{-1.0, -1.0}, {1.0, -1.0}, {1.0, 1.0}, {-1.0, 1.0}}) {
      Point& corner = corners_[count_++];
      for (int d = 0; d < 3; ++d) corner.x[d] = centre.x[d] + reach * (along_u * u.x[d] + along_v * v.x[d]);
    }
  }
  /// Clips the polygon to normal . p <= offset.
  void clip(const double* normal, double offset) {
    double at[capacity];
    bool whole = true;
    for (int i = 0; i < count_; ++i) {
      at[i] = scalar_product(normal, corners_[i].x) - offset;
      whole = whole && at[i] <= 0;
    }
    if (whole) return;
    Point kept[capacity];
    int kept_count = 0;
    for (int i = 0; i < count_; ++i) {
      const int next = i + 1 < count_ ? i + 1 : 0;
      const Point &p = corners_[i], &q = corners_[next];
      const double at_p = at[i], at_q = at[next];
      if (at_p <= 0) kept[kept_count++] = p;
      if ((at_p < 0 && at_q > 0) || (at_p > 0 && at_q < 0)) {
        const double share = at_p / (at_p - at_q);
        Point& cut = kept[kept_count++];
        for (int d = 0; d < 3; ++d) cut.x[d] = p.x[d] + share * (q.x[d] - p.x[d]);
      }
      KBVH_ASSERT(kept_count < capacity);
    }
    std::copy_n(kept, kept_count, corners_);
    count_ = kept_count;
  }
  bool empty() const { return count_ == 0; }
  double area() const {
    double twice[3] = {0, 0, 0};
    for (int i = 1; i + 1 < count_; ++i) {
      double a[3], b[3];
      for (int d = 0; d < 3; ++d) {
        a[d] = corners_[i].x[d] - corners_[0].x[d];
        b[d] = corners_[i + 1].x[d] - corners_[0].x[d];
      }
      for (int d = 0; d < 3; ++d)
        twice[d] += a[(d + 1) % 3] * b[(d + 2) % 3] - a[(d + 2) % 3] * b[(d + 1) % 3];
    }
    return 0.5 * std::sqrt(scalar_product(twice, twice));
  }

 private:
  static constexpr int capacity = 160;  // rounding may make a polygon of many sides slightly concave
  Point corners_[capacity];
  int count_ = 0;
};

/// Computes two unit vectors that span the plane of a normal.
void span_plane(const double* normal, Point& u, Point& v) {
  const double length = std::sqrt(scalar_product(normal, normal));
  int least = 0;
  for (int d = 1; d < 3; ++d)
    if (std::fabs(normal[d]) < std::fabs(normal[least])) least = d;
  const int next = (least + 1) % 3, last = (least + 2) % 3;
  const double in_plane = std::sqrt(normal[next] * normal[next] + normal[last] * normal[last]);
  u.x[least] = 0;
  u.x[next] = -normal[last] / in_plane;
  u.x[last] = normal[next] / in_plane;
  for (int d = 0; d < 3; ++d)
    v.x[d] = (normal[(d + 1) % 3] * u.x[(d + 2) % 3] - normal[(d + 2) % 3] * u.x[(d + 1) % 3]) / length;
}

}  // namespace

double slab_area(std::span<const Slab> slabs) {
  KBVH_ASSERT(slabs.size() >= 3 && slabs.size() <= 32);
  // Coordinates are relative to the middle of the box of the first three slabs.
  double middle[3], reach = 0;
  for (int d = 0; d < 3; ++d) {
    middle[d] = 0.5 * slabs[std::size_t(d)].lower + 0.5 * slabs[std::size_t(d)].upper;
    reach += slabs[std::size_t(d)].upper - slabs[std::size_t(d)].lower;
  }
  if (!(reach > 0)) return 0;
  Slab relative[32];
  for (std::size_t i = 0; i < slabs.size(); ++i) {
    relative[i] = slabs[i];
    const double at = scalar_product(slabs[i].normal, middle);
    relative[i].lower = (slabs[i].lower - at) / reach;
    relative[i].upper = (slabs[i].upper - at) / reach;
  }
  double area = 0;
  for (std::size_t i = 0; i < slabs.size(); ++i)
    for (const double offset : {relative[i].lower, relative[i].upper}) {
      const double* const normal = relative[i].normal;
      Point foot, u, v;
      for (int d = 0; d < 3; ++d) foot.x[d] = normal[d] * offset / scalar_product(normal, normal);
      span_plane(normal, u, v);
      Polygon polygon(foot, u, v, 2.0);
      for (std::size_t j = 0; j < slabs.size() && !polygon.empty(); ++j) {
        if (j == i) continue;
        const double* const other = relative[j].normal;
        const double opposite[3] = {-other[0], -other[1], -other[2]};
        polygon.clip(other, relative[j].upper);
        polygon.clip(opposite, -relative[j].lower);
      }
      area += polygon.area();
    }
  return area * reach * reach;
}

}  // namespace kbvh
