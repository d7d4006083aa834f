#include "experiments/loop/barrier.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <cmath>
#include <limits>

namespace kbvh::experiments::loop {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::Vector4d;
/// Up to five rows and columns: three directions of the difference, and two parameters of closest points.
using Small = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 5, 5>;
using Span = Eigen::Matrix<double, 12, Eigen::Dynamic, 0, 12, 5>;

/// Sets negative eigenvalues to zero.
template <class Matrix>
void make_positive(Matrix& matrix) {
  const Eigen::SelfAdjointEigenSolver<Matrix> solver(matrix);
  if (solver.eigenvalues()[0] >= 0) return;
  const auto& vectors = solver.eigenvectors();
  matrix = (vectors * solver.eigenvalues().cwiseMax(0).asDiagonal() * vectors.transpose()).eval();
}

/// Writes the direction `axis` of space, weighted for the four points, to a column.
template <class Column>
void set_direction(Column column, const Vector4d& weights, const Vector3d& axis) {
  for (int i = 0; i < 4; ++i) column.template segment<3>(3 * i) = weights[i] * axis;
}

/// Computes the derivatives of an energy of the squared distance, with the given first two derivatives.
///
/// The squared distance is f(x) = |w|^2, w = sum c_i x_i, minimal over the parameters of the weights c. So
/// its Hessian is f_xx - f_xs f_ss^-1 f_sx, with f_xx = 2 c c^T (x) I, f_ss = 2 W^T W, where the columns of W
/// are the derivatives w_s = sum c_s,i x_i, and f_xs = 2 (c_s (x) w + c (x) w_s). All of it lies in the span
/// of q_0 (x) e for three directions e and q_j (x) n for n = w / |w|, where q are orthonormal weights that
/// span c and its derivatives: eigenvalues are those of a matrix of at most five rows.
void distance_force(const ClosestPoints& closest, const FourPoints& points, double slope, double curvature,
                    Curvature wanted, PairForce& force) {
  const int k = closest.parameters;
  const double distance = std::sqrt(closest.squared_distance);
  const Vector3d normal = closest.difference / distance;
  const Vector3d tangent = normal.unitOrthogonal(), other = normal.cross(tangent);
  // Gram-Schmidt: weights = r00 q_0, derivative j = sum r_ij q_i.
  Vector4d q[3];
  Eigen::Matrix3d r = Matrix3d::Zero();
  for (int j = 0; j <= k; ++j) {
    q[j] = j == 0 ? closest.weights : Vector4d(closest.weight_derivatives.col(j - 1));
    for (int i = 0; i < j; ++i) {
      r(i, j) = q[i].dot(q[j]);
      q[j] -= r(i, j) * q[i];
    }
    r(j, j) = q[j].norm();
    q[j] /= r(j, j);
  }
  // Coordinates: q_0 (x) (normal, tangent, other), then q_j (x) normal.
  Small hessian = Small::Zero(3 + k, 3 + k);
  hessian.topLeftCorner(3, 3).diagonal().setConstant(2 * r(0, 0) * r(0, 0));
  if (k > 0) {
    Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, 2> moved = points * closest.weight_derivatives.leftCols(k);
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 5, 2> mixed(3 + k, k);
    for (int j = 0; j < k; ++j) {
      mixed(0, j) = distance * r(0, j + 1) + r(0, 0) * normal.dot(moved.col(j));
      mixed(1, j) = r(0, 0) * tangent.dot(moved.col(j));
      mixed(2, j) = r(0, 0) * other.dot(moved.col(j));
      for (int i = 1; i <= k; ++i) mixed(2 + i, j) = distance * r(i, j + 1);
    }
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 2, 2> inverse = moved.transpose() * moved;
    if (k == 1) {
      inverse(0, 0) = 1 / inverse(0, 0);
    } else {
      const double a = inverse(0, 0), b = inverse(0, 1), c = inverse(1, 1), determinant = a * c - b * b;
      inverse << c / determinant, -b / determinant, -b / determinant, a / determinant;
    }
    hessian -= 2 * mixed * inverse * mixed.transpose();
  }
  hessian *= slope;
  const double step = 2 * distance * r(0, 0);  // the gradient is this times q_0 (x) normal
  hessian(0, 0) += curvature * step * step;
  if (wanted == Curvature::positive) make_positive(hessian);
  Span span(12, 3 + k);
  set_direction(span.col(0), q[0], normal);
  set_direction(span.col(1), q[0], tangent);
  set_direction(span.col(2), q[0], other);
  for (int j = 1; j <= k; ++j) set_direction(span.col(2 + j), q[j], normal);
  force.gradient = slope * step * span.col(0);
  force.hessian = span * hessian * span.transpose();
}

/// The squared area of the parallelogram of two edges, |u x v|^2, and its derivatives by the four points.
struct EdgesArea {
  double squared;
  Vector12 gradient;
  Matrix12 hessian;

  explicit EdgesArea(const FourPoints& x) {
    const Vector3d u = x.col(1) - x.col(0), v = x.col(3) - x.col(2);
    const double uu = u.squaredNorm(), uv = u.dot(v), vv = v.squaredNorm();
    squared = u.cross(v).squaredNorm();
    const Vector3d by_u = 2 * (vv * u - uv * v), by_v = 2 * (uu * v - uv * u);
    gradient << -by_u, by_u, -by_v, by_v;
    const Matrix3d one = Matrix3d::Identity();
    const Matrix3d uu2 = 2 * (vv * one - v * v.transpose()), vv2 = 2 * (uu * one - u * u.transpose());
    const Matrix3d uv2 = 4 * u * v.transpose() - 2 * v * u.transpose() - 2 * uv * one;
    const double sign[4] = {-1, 1, -1, 1};
    for (int i = 0; i < 4; ++i)
      for (int j = 0; j < 4; ++j) {
        Matrix3d block = i < 2 ? (j < 2 ? uu2 : uv2) : (j < 2 ? Matrix3d(uv2.transpose()) : vv2);
        hessian.block<3, 3>(3 * i, 3 * j) = sign[i] * sign[j] * block;
      }
  }
};

double squared_area(const FourPoints& x) {
  return Vector3d(x.col(1) - x.col(0)).cross(Vector3d(x.col(3) - x.col(2))).squaredNorm();
}

/// Returns the factor by which the energy fades: z (2 - z), z = squared area / bound, 1 from the bound on.
double fading_factor(double area, double below) {
  const double z = area / below;
  return z < 1 ? z * (2 - z) : 1;
}

}  // namespace

double Barrier::energy(double squared_distance) const {
  const double s = closeness(squared_distance);
  if (s >= 1) return 0;
  if (!(s >= least_closeness)) return std::numeric_limits<double>::infinity();
  return -scale * (s - 1) * (s - 1) * std::log(s);
}

double Barrier::slope(double squared_distance) const {
  const double s = closeness(squared_distance);
  if (s >= 1) return 0;
  return -scale * (s - 1) * (2 * std::log(s) + (s - 1) / s) / range();
}

double Barrier::curvature(double squared_distance) const {
  const double s = closeness(squared_distance);
  if (s >= 1) return 0;
  const double ratio = (s - 1) / s;
  return scale * (ratio * ratio - 4 * ratio - 2 * std::log(s)) / (range() * range());
}

double pair_energy(const Barrier& barrier, ContactKind kind, const FourPoints& points, const Fading& fading) {
  const double energy = barrier.energy(closest_points(kind, points).squared_distance);
  if (kind != ContactKind::edge_edge || energy == 0 || std::isinf(energy)) return energy;
  return energy * fading_factor(squared_area(points), fading.below);
}

void pair_force(const Barrier& barrier, ContactKind kind, const FourPoints& points, const Fading& fading,
                Curvature curvature, PairForce& force) {
  const ClosestPoints closest = closest_points(kind, points);
  const double squared = closest.squared_distance;
  force.energy = barrier.energy(squared);
  const bool fades = kind == ContactKind::edge_edge && squared_area(points) < fading.below;
  distance_force(closest, points, barrier.slope(squared), barrier.curvature(squared),
                 fades ? Curvature::exact : curvature, force);
  if (!fades) return;
  const EdgesArea area(points);
  const double z = area.squared / fading.below;
  const double factor = z * (2 - z), by_area = 2 * (1 - z) / fading.below,
               twice = -2 / (fading.below * fading.below);
  force.hessian =
      (factor * force.hessian +
       by_area * (area.gradient * force.gradient.transpose() + force.gradient * area.gradient.transpose()) +
       force.energy * (by_area * area.hessian + twice * area.gradient * area.gradient.transpose()))
          .eval();
  force.gradient = (factor * force.gradient + force.energy * by_area * area.gradient).eval();
  force.energy *= factor;
  if (curvature == Curvature::positive) make_positive(force.hessian);
}

}  // namespace kbvh::experiments::loop
