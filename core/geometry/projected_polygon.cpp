#include "core/geometry/projected_polygon.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/geometry/predicates.hpp"
#include "core/geometry/scaled_integers.hpp"

namespace kbvh {
namespace {

constexpr double unit = 0x1p-53;                             // of rounding
constexpr double tiny = std::numeric_limits<double>::min();  // more than any underflow
constexpr double infinity = std::numeric_limits<double>::infinity();

}  // namespace

void ProjectedPolygon::take(std::span<const double> points) {
  points_ = points;
  is_exact_ = inner_is_exact_ = false;
  const std::size_t n = size();
  const auto offset = [&](std::size_t corner, std::size_t axis) {
    return points_[3 * corner + axis] - points_[axis];
  };
  // Sums of n - 2 cross products: each term is off by three roundings, and the sum by n.
  double area[3] = {}, bound[3] = {};
  for (std::size_t i = 1; i + 1 < n; ++i)
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const std::size_t s = (axis + 1) % 3, t = (axis + 2) % 3;
      const double left = offset(i, s) * offset(i + 1, t), right = offset(i, t) * offset(i + 1, s);
      area[axis] += left - right;
      bound[axis] += std::abs(left) + std::abs(right);
    }
  for (double& b : bound) b = 2 * double(n + 8) * unit * b + double(n) * tiny;
  axis_ = 0;
  for (std::size_t axis = 1; axis < 3; ++axis)
    if (std::abs(area[axis]) > std::abs(area[axis_])) axis_ = axis;
  const std::size_t s = (axis_ + 1) % 3, t = (axis_ + 2) % 3;
  for (auto& seen : seen_) seen.assign(n + 1, 0);
  const double least = std::abs(area[axis_]) - bound[axis_];
  if (!(least > 0)) {
    slack_ = infinity;
    bent_ = 0;
    make_exact();
    if (has_area_) {
      bool flat = true;
      for (std::size_t i = 0; i < n && flat; ++i)
        flat =
            area_[0] * offsets_[3 * i] + area_[1] * offsets_[3 * i + 1] + area_[2] * offsets_[3 * i + 2] == 0;
      bent_ = flat ? 0 : tiny;
    }
    return;
  }
  has_area_ = true;
  const double slope[2] = {area[s] / area[axis_], area[t] / area[axis_]};
  const std::size_t across[2] = {s, t};
  double slack = 0, height = 0, reach = 0;
  for (std::size_t side = 0; side < 2; ++side) {
    const double error = (bound[across[side]] + std::abs(slope[side]) * bound[axis_]) / least +
                         4 * unit * std::abs(slope[side]);
    for (std::size_t i = 0; i < n; ++i) {
      const double along = offset(i, axis_), here = offset(i, across[side]), shift = slope[side] * along;
      seen_[side][i] = here - shift;
      slack = std::max(slack, std::abs(along) * error + 8 * unit * (std::abs(here) + std::abs(shift)));
    }
  }
  // Doubled, to cover the further point and the roundings of this computation, too.
  slack_ = 2 * slack + tiny;
  const double length = std::sqrt(1 + slope[0] * slope[0] + slope[1] * slope[1]);
  for (std::size_t i = 0; i < n; ++i) {
    height = std::max(height, std::abs(offset(i, axis_) + slope[0] * offset(i, s) + slope[1] * offset(i, t)));
    for (std::size_t axis = 0; axis < 3; ++axis) reach = std::max(reach, std::abs(offset(i, axis)));
  }
  bent_ = reach > 0 ? height / length / reach : 0;
  if (area[axis_] < 0) std::swap(seen_[0], seen_[1]);
}

bool ProjectedPolygon::same_place(std::size_t a, std::size_t b) const {
  return a < size() && b < size() && std::equal(&points_[3 * a], &points_[3 * a] + 3, &points_[3 * b]);
}

int ProjectedPolygon::turn(std::size_t a, std::size_t b, std::size_t c) {
  if (a == b || b == c || a == c) return 0;
  const double bu = seen_[0][b] - seen_[0][a], bv = seen_[1][b] - seen_[1][a];
  const double cu = seen_[0][c] - seen_[0][a], cv = seen_[1][c] - seen_[1][a];
  const double left = bu * cv, right = bv * cu;
  const double off = 2 * slack_;
  const double bound = (std::abs(bu) + std::abs(bv) + std::abs(cu) + std::abs(cv)) * off + 2 * off * off +
                       8 * unit * (std::abs(left) + std::abs(right));
  const int sign = sign_beyond(left - right, bound * (1 + 0x1p-20) + tiny);
  if (sign != undecided_sign) return sign;
  if (same_place(a, b) || same_place(b, c) || same_place(a, c)) return 0;
  return exact_turn(a, b, c);
}

bool ProjectedPolygon::boxes_apart(std::size_t a, std::size_t b, std::size_t c, std::size_t d) const {
  for (const std::vector<double>& seen : seen_)
    if (std::max(seen[a], seen[b]) + 2 * slack_ < std::min(seen[c], seen[d]) ||
        std::max(seen[c], seen[d]) + 2 * slack_ < std::min(seen[a], seen[b]))
      return true;
  return false;
}

void ProjectedPolygon::bound(const std::size_t (&triangle)[3]) {
  for (int side = 0; side < 2; ++side) {
    const auto [least, most] =
        std::minmax({seen_[side][triangle[0]], seen_[side][triangle[1]], seen_[side][triangle[2]]});
    bound_[side] = {least - 2 * slack_, most + 2 * slack_};
  }
}

bool ProjectedPolygon::beyond_bound(std::size_t a, std::size_t b) const {
  for (int side = 0; side < 2; ++side)
    if (std::max(seen_[side][a], seen_[side][b]) < bound_[side].lower ||
        std::min(seen_[side][a], seen_[side][b]) > bound_[side].upper)
      return true;
  return false;
}

bool ProjectedPolygon::coincides(std::size_t corner, const std::size_t (&triangle)[3]) const {
  return std::any_of(std::begin(triangle), std::end(triangle),
                     [&](std::size_t other) { return same_place(corner, other); });
}

std::size_t ProjectedPolygon::place_inside(const std::size_t (&triangle)[3]) {
  for (auto& seen : seen_)
    seen[size()] = seen[triangle[0]] / 4 + seen[triangle[1]] / 2 + seen[triangle[2]] / 4;
  std::copy_n(triangle, 3, inner_);
  inner_is_exact_ = false;
  return size();
}

void ProjectedPolygon::make_exact() {
  if (is_exact_) return;
  is_exact_ = true;
  const std::size_t n = size();
  int lowest = std::numeric_limits<int>::max();
  for (const double x : points_)
    if (const scaled::OddMultiple value = scaled::odd_multiple(x); value.mantissa != 0)
      lowest = std::min(lowest, value.exponent);
  offsets_.resize(3 * n);
  for (std::size_t i = 3 * n; i-- > 0;) {  // the first corner comes last
    const auto integer = [&](double x) {
      const scaled::OddMultiple value = scaled::odd_multiple(x);
      Integer result(value.mantissa);
      if (value.mantissa != 0) result <<= value.exponent - lowest;
      return result;
    };
    offsets_[i] = integer(points_[i]) - integer(points_[i % 3]);
  }
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::size_t s = (axis + 1) % 3, t = (axis + 2) % 3;
    area_[axis] = 0;
    for (std::size_t i = 1; i + 1 < n; ++i)
      area_[axis] +=
          offsets_[3 * i + s] * offsets_[3 * i + 3 + t] - offsets_[3 * i + t] * offsets_[3 * i + 3 + s];
  }
  has_area_ = area_[0] != 0 || area_[1] != 0 || area_[2] != 0;
  if (!has_area_) return;
  if (slack_ == infinity)
    for (std::size_t axis = 0; axis < 3; ++axis)
      if (abs(area_[axis]) > abs(area_[axis_])) axis_ = axis;
  const std::size_t across[2] = {(axis_ + 1) % 3, (axis_ + 2) % 3};
  // Multiplied by four, so that the further point has integer coordinates.
  for (std::size_t side = 0; side < 2; ++side) {
    exact_seen_[side].resize(n + 1);
    for (std::size_t i = 0; i < n; ++i)
      exact_seen_[side][i] =
          4 * (area_[axis_] * offsets_[3 * i + across[side]] - area_[across[side]] * offsets_[3 * i + axis_]);
  }
  if (area_[axis_] < 0) std::swap(exact_seen_[0], exact_seen_[1]);
}

int ProjectedPolygon::exact_turn(std::size_t a, std::size_t b, std::size_t c) {
  make_exact();
  if (!inner_is_exact_ && std::max({a, b, c}) == size()) {
    for (auto& seen : exact_seen_)
      seen[size()] = (seen[inner_[0]] + 2 * seen[inner_[1]] + seen[inner_[2]]) / 4;
    inner_is_exact_ = true;
  }
  const Integer bu = exact_seen_[0][b] - exact_seen_[0][a], bv = exact_seen_[1][b] - exact_seen_[1][a];
  const Integer cu = exact_seen_[0][c] - exact_seen_[0][a], cv = exact_seen_[1][c] - exact_seen_[1][a];
  return Integer(bu * cv).compare(Integer(bv * cu));
}

bool ProjectedPolygon::is_straight() {
  make_exact();
  std::size_t first = 1;
  const auto at = [&](std::size_t corner) { return &offsets_[3 * corner]; };
  const auto is_zero = [](const Integer* p) { return p[0] == 0 && p[1] == 0 && p[2] == 0; };
  while (first < size() && is_zero(at(first))) ++first;
  for (std::size_t i = first + 1; i < size(); ++i)
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const std::size_t s = (axis + 1) % 3, t = (axis + 2) % 3;
      if (at(first)[s] * at(i)[t] != at(first)[t] * at(i)[s]) return false;
    }
  return true;
}

}  // namespace kbvh
