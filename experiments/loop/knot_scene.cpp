// A rope with an overhand knot, held at both ends.
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <span>

#include "experiments/loop/scene_parts.hpp"

namespace kbvh::experiments::loop {
namespace {

using Vector3 = Eigen::Vector3d;
using std::numbers::pi;

/// The trefoil, whose lobe around t = pi points along -y; without that lobe's tip it is an overhand knot.
constexpr double knot_height = 1.3;
Vector3 trefoil(double t) {
  return {std::sin(t) + 2 * std::sin(2 * t), std::cos(t) - 2 * std::cos(2 * t),
          -knot_height * std::sin(3 * t)};
}
Vector3 trefoil_direction(double t) {
  return Vector3(std::cos(t) + 4 * std::cos(2 * t), -std::sin(t) + 4 * std::sin(2 * t),
                 -3 * knot_height * std::cos(3 * t))
      .normalized();
}

/// Returns the line of the rope, in no unit: the knot, and two straight ends along -y. It is cut where the
/// trefoil turns from -y: cos(t) + 4 cos(2 t) = 0.
std::vector<Vector3> fine_line() {
  constexpr int samples = 4000;
  constexpr double tail = 6;
  const double cut = std::acos((1 + std::sqrt(129.0)) / 16);
  const double begin = cut - pi, end = pi - cut;
  std::vector<Vector3> line{trefoil(begin) - tail * trefoil_direction(begin)};
  for (int i = 0; i <= samples; ++i) line.push_back(trefoil(begin + (end - begin) * i / samples));
  line.push_back(trefoil(end) + tail * trefoil_direction(end));
  return line;
}

double length_of(std::span<const Vector3> line) {
  double sum = 0;
  for (std::size_t i = 1; i < line.size(); ++i) sum += (line[i] - line[i - 1]).norm();
  return sum;
}

/// Returns `count` points of a line at equal distances along it, its ends included.
std::vector<Vector3> resampled(std::span<const Vector3> line, std::size_t count) {
  const double spacing = length_of(line) / double(count - 1);
  std::vector<Vector3> points{line.front()};
  double passed = 0;
  for (std::size_t i = 1; i < line.size(); ++i) {
    const double part = (line[i] - line[i - 1]).norm();
    for (double wanted = spacing * double(points.size());
         wanted <= passed + part && points.size() + 1 < count; wanted = spacing * double(points.size()))
      points.push_back(line[i - 1] + (wanted - passed) / part * (line[i] - line[i - 1]));
    passed += part;
  }
  points.push_back(line.back());
  return points;
}

/// Returns the largest diameter of a rope along this line that neither touches itself nor bends more sharply
/// than its radius: the smallest distance between parts that are a tenth of the length apart or more, or
/// twice the smallest radius of curvature.
double room_of(std::span<const Vector3> line) {
  double least = std::numeric_limits<double>::infinity();
  const std::size_t apart = line.size() / 10;
  for (std::size_t i = 0; i < line.size(); ++i)
    for (std::size_t j = i + apart; j < line.size(); ++j) least = std::min(least, (line[i] - line[j]).norm());
  for (std::size_t i = 1; i + 1 < line.size(); ++i) {
    // Twice the radius of the circle through three points.
    const Vector3 a = line[i] - line[i - 1], b = line[i + 1] - line[i];
    const double twice_area = a.cross(b).norm();
    if (twice_area > 0) least = std::min(least, a.norm() * b.norm() * (a + b).norm() / twice_area);
  }
  return least;
}

}  // namespace

Simulated knot_scene(std::uint64_t triangles, SceneChance& chance) {
  constexpr double radius = 0.012, used_room = 0.35, slack = 24, period = 2;
  const std::vector<Vector3> fine = fine_line();
  const double scale = radius / (used_room * room_of(resampled(fine, 400)));
  const double length = scale * length_of(fine);
  // Rings as far apart as their corners are.
  const double slender = length / (2 * pi * radius);
  const std::uint32_t sides =
      std::max(5u, std::uint32_t(std::lround(std::sqrt(double(triangles) / (2 * slender)))));
  const auto rings = std::uint32_t(std::lround(slender * sides));
  std::vector<Vector3> line = resampled(fine, rings);
  for (Vector3& point : line) point *= scale;

  MeshBuilder builder;
  MeshBuilder::Rope rope;
  rope.line = line;
  rope.sides = sides;
  rope.radius = radius;
  const std::uint32_t first = builder.add_rope(rope), stride = sides + 1;
  // The line begins at x > 0 or x < 0; its ends are pulled apart along x until the knot has taken the slack.
  const double apart = std::fabs(line.back()[0] - line.front()[0]);
  const double way = (length - slack * radius - apart) / 2;
  const double dent = 0.01 * length / rings;
  for (std::uint32_t v = first + 2 * stride; v < first + (rings - 2) * stride; ++v)
    builder.move(v, dent * chance.vector());
  for (const std::uint32_t ring : {0u, rings - 2}) {
    Joint pull;
    pull.travel = {std::copysign(way, line[ring][0]), 0, 0};
    pull.period = period;
    const std::int32_t joint = builder.add_joint(pull);
    for (std::uint32_t v = 0; v < 2 * stride; ++v) builder.drive(first + ring * stride + v, joint);
  }
  return {builder.finish(), {}};
}

}  // namespace kbvh::experiments::loop
