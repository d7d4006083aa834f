#include "experiments/loop/closest_points.hpp"

#include <Eigen/Geometry>

namespace kbvh::experiments::loop {
namespace {

using Eigen::Vector3d;

/// Keeps the nearer of the points that were offered.
class Nearest {
 public:
  explicit Nearest(const FourPoints& points) : points_(points) {}

  void offer(const Eigen::Vector4d& weights, int parameters, const Eigen::Matrix<double, 4, 2>& derivatives) {
    const Vector3d difference = points_ * weights;
    const double squared = difference.squaredNorm();
    if (any_ && squared >= found_.squared_distance) return;
    any_ = true;
    found_ = {weights, difference, squared, parameters, derivatives};
  }

  /// Offers the closest points of the point `p` and the segment from `a` to `b`. `sign` is 1 if the
  /// difference is from the segment to the point.
  void offer_segment(int p, int a, int b, double sign) {
    const Vector3d along = points_.col(b) - points_.col(a), from = points_.col(p) - points_.col(a);
    const double at = from.dot(along), length = along.squaredNorm();
    Eigen::Vector4d weights = Eigen::Vector4d::Zero();
    Eigen::Matrix<double, 4, 2> derivatives = Eigen::Matrix<double, 4, 2>::Zero();
    weights[p] = sign;
    if (at <= 0 || at >= length) {
      weights[at <= 0 ? a : b] = -sign;
      return offer(weights, 0, derivatives);
    }
    const double r = at / length;
    weights[a] = -sign * (1 - r);
    weights[b] = -sign * r;
    derivatives(a, 0) = sign;
    derivatives(b, 0) = -sign;
    offer(weights, 1, derivatives);
  }

  const ClosestPoints& found() const { return found_; }

 private:
  const FourPoints& points_;
  ClosestPoints found_;
  bool any_ = false;
};

void of_face_and_vertex(const FourPoints& x, Nearest& nearest) {
  const Vector3d u = x.col(2) - x.col(1), v = x.col(3) - x.col(1), w = x.col(0) - x.col(1);
  const Vector3d normal = u.cross(v);
  const double area = normal.squaredNorm();
  const double b = w.cross(v).dot(normal), c = u.cross(w).dot(normal);
  if (area > 0 && b > 0 && c > 0 && b + c < area) {
    Eigen::Matrix<double, 4, 2> derivatives;
    derivatives << 0, 0, 1, 1, -1, 0, 0, -1;
    return nearest.offer(Eigen::Vector4d(1, b / area + c / area - 1, -b / area, -c / area), 2, derivatives);
  }
  // The nearest point of the plane is outside, so the nearest point of the face is on its border.
  nearest.offer_segment(0, 1, 2, 1);
  nearest.offer_segment(0, 2, 3, 1);
  nearest.offer_segment(0, 3, 1, 1);
}

void of_edges(const FourPoints& x, Nearest& nearest) {
  const Vector3d u = x.col(1) - x.col(0), v = x.col(3) - x.col(2), w = x.col(0) - x.col(2);
  const double a = u.squaredNorm(), b = u.dot(v), c = v.squaredNorm(), d = u.dot(w), e = v.dot(w);
  const double determinant = u.cross(v).squaredNorm();
  // Nearly parallel: the inside of both edges is no nearer than their ends, up to rounding.
  if (determinant > 1e-12 * a * c) {
    const double s = (b * e - c * d) / determinant, t = (a * e - b * d) / determinant;
    if (s > 0 && s < 1 && t > 0 && t < 1) {
      Eigen::Matrix<double, 4, 2> derivatives;
      derivatives << -1, 0, 1, 0, 0, 1, 0, -1;
      return nearest.offer(Eigen::Vector4d(1 - s, s, t - 1, -t), 2, derivatives);
    }
  }
  // The nearest points of the lines are outside, so one of the nearest points is an end.
  nearest.offer_segment(0, 2, 3, 1);
  nearest.offer_segment(1, 2, 3, 1);
  nearest.offer_segment(2, 0, 1, -1);
  nearest.offer_segment(3, 0, 1, -1);
}

}  // namespace

ClosestPoints closest_points(ContactKind kind, const FourPoints& points) {
  Nearest nearest(points);
  if (kind == ContactKind::face_vertex)
    of_face_and_vertex(points, nearest);
  else
    of_edges(points, nearest);
  return nearest.found();
}

}  // namespace kbvh::experiments::loop
