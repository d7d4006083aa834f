// A figure of capsules, which walks, and skirts that hang on its waist.
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "experiments/loop/scene_parts.hpp"

namespace kbvh::experiments::loop {
namespace {

using Vector3 = Eigen::Vector3d;
using std::numbers::pi;

/// A cylinder with two half spheres: all points at `radius` from the segment of a and b.
struct Capsule {
  Vector3 a, b;
  double radius;  // m
  std::int32_t joint;
};

/// Adds a capsule whose vertices lie on its surface, so that its triangles lie inside. `around` vertices make
/// a ring.
void add_capsule(MeshBuilder& builder, const Capsule& capsule, std::uint32_t around) {
  const Vector3 axis = (capsule.b - capsule.a).normalized(), normal = axis.unitOrthogonal(),
                other = axis.cross(normal);
  const double length = (capsule.b - capsule.a).norm(), edge = 2 * pi * capsule.radius / around;
  const std::uint32_t cap_rings = std::max(2u, around / 4);
  const std::uint32_t parts = std::max(1u, std::uint32_t(std::lround(length / edge)));
  std::vector<Vector3> vertices;
  const auto add_ring = [&](const Vector3& centre, double angle) {
    const Vector3 middle = centre + capsule.radius * std::sin(angle) * axis;
    const double radius = capsule.radius * std::cos(angle);
    for (std::uint32_t j = 0; j < around; ++j) {
      const double turn = 2 * pi * j / around;
      vertices.push_back(middle + radius * (std::cos(turn) * normal + std::sin(turn) * other));
    }
  };
  for (std::uint32_t i = 1; i <= cap_rings; ++i) add_ring(capsule.a, pi / 2 * (double(i) / cap_rings - 1));
  for (std::uint32_t i = 1; i < parts; ++i)
    add_ring(capsule.a + double(i) / parts * (capsule.b - capsule.a), 0);
  for (std::uint32_t i = 0; i < cap_rings; ++i) add_ring(capsule.b, pi / 2 * i / cap_rings);
  const auto rings = std::uint32_t(vertices.size() / around);
  const auto low = std::uint32_t(vertices.size()), high = low + 1;
  vertices.push_back(capsule.a - capsule.radius * axis);
  vertices.push_back(capsule.b + capsule.radius * axis);
  std::vector<Eigen::Vector3<std::uint32_t>> faces;
  for (std::uint32_t j = 0; j < around; ++j) {
    const std::uint32_t next = (j + 1) % around, top = (rings - 1) * around;
    faces.emplace_back(low, next, j);
    faces.emplace_back(high, top + j, top + next);
    for (std::uint32_t i = 0; i + 1 < rings; ++i) {
      const std::uint32_t ring = i * around;
      faces.emplace_back(ring + j, ring + next, ring + around + next);
      faces.emplace_back(ring + j, ring + around + next, ring + around + j);
    }
  }
  builder.add_driven_obstacle(vertices, faces, capsule.joint);
}

/// Adds the figure, which stands at the origin, looks along y and walks one step a second in a circle of 2 m.
/// Returns the joint of its trunk.
std::int32_t add_figure(MeshBuilder& builder, std::uint32_t around) {
  constexpr double period = 1;
  Joint walk;
  walk.pivot = {-2, 0, 0};
  walk.turn = 0.5;
  Joint trunk;
  trunk.parent = builder.add_joint(walk);
  trunk.pivot = {0, 0, 1};
  trunk.swing = 0.1;
  trunk.period = period;
  const std::int32_t body = builder.add_joint(trunk);
  add_capsule(builder, {{0, 0, 1}, {0, 0, 1.32}, 0.13, body}, around);
  add_capsule(builder, {{-0.06, 0, 0.95}, {0.06, 0, 0.95}, 0.11, body}, around);
  add_capsule(builder, {{-0.17, 0, 1.38}, {0.17, 0, 1.38}, 0.06, body}, around);
  add_capsule(builder, {{0, 0, 1.4}, {0, 0, 1.55}, 0.045, body}, around);
  add_capsule(builder, {{0, 0, 1.58}, {0, 0, 1.63}, 0.1, body}, around);
  for (const double side : {-1.0, 1.0}) {
    const double phase = side < 0 ? 0 : pi, hip = 0.085 * side, shoulder = 0.22 * side, elbow = 0.3 * side;
    Joint thigh;
    thigh.parent = body;
    thigh.pivot = {hip, 0, 0.93};
    thigh.axis = {1, 0, 0};
    thigh.swing = 0.5;
    thigh.phase = phase;
    thigh.period = period;
    const std::int32_t upper_leg = builder.add_joint(thigh);
    // The knee bends most while its leg swings forward.
    Joint knee;
    knee.parent = upper_leg;
    knee.pivot = {hip, 0, 0.51};
    knee.axis = {1, 0, 0};
    knee.bend = -0.5;
    knee.swing = -0.4;
    knee.phase = phase + pi / 2;
    knee.period = period;
    const std::int32_t lower_leg = builder.add_joint(knee);
    Joint arm = thigh;
    arm.pivot = {shoulder, 0, 1.38};
    arm.swing = -0.3;
    const std::int32_t whole_arm = builder.add_joint(arm);
    add_capsule(builder, {{hip, 0, 0.93}, {hip, 0, 0.51}, 0.065, upper_leg}, around);
    add_capsule(builder, {{hip, 0, 0.51}, {hip, 0, 0.1}, 0.05, lower_leg}, around);
    add_capsule(builder, {{hip, -0.03, 0.05}, {hip, 0.13, 0.05}, 0.035, lower_leg}, around);
    add_capsule(builder, {{shoulder, 0, 1.38}, {elbow, 0, 1.13}, 0.045, whole_arm}, around);
    add_capsule(builder, {{elbow, 0, 1.13}, {elbow, 0.2, 1.12}, 0.04, whole_arm}, around);
  }
  return body;
}

}  // namespace

Simulated walker_scene(std::uint64_t triangles, SceneChance& chance) {
  constexpr std::uint32_t skirts = 3;
  constexpr double waist = 0.2, height = 0.55, flare = 0.06, gap = 0.012, top = 1;
  MeshBuilder builder;
  // Squares of about the same sides: as many columns as fit around the middle of a skirt.
  const double around = 2 * pi * (waist + flare / 2) / height;
  const double rows_wanted = std::sqrt(double(triangles) / skirts / 2 / around);
  const std::uint32_t rows = std::max(3u, 1 + std::uint32_t(std::lround(rows_wanted))),
                      columns = std::max(8u, std::uint32_t(std::lround(around * rows_wanted)));
  const std::int32_t body = add_figure(builder, std::max(6u, columns / 4));
  for (std::uint32_t layer = 0; layer < skirts; ++layer) {
    std::vector<Vector3> points;
    for (std::uint32_t y = 0; y < rows; ++y)
      for (std::uint32_t x = 0; x < columns; ++x) {
        const double down = double(y) / (rows - 1), turn = 2 * pi * x / columns;
        const double radius = waist + gap * layer + flare * down;
        points.emplace_back(radius * std::cos(turn), radius * std::sin(turn), top - height * down);
      }
    const std::uint32_t first = builder.add_cloth({columns, rows, true}, points, MeshBuilder::Material{});
    for (std::uint32_t x = 0; x < columns; ++x) builder.drive(first + x, body);
    const double dent = 0.01 * height / rows;
    for (std::uint32_t v = first + columns; v < first + rows * columns; ++v)
      builder.move(v, dent * chance.vector());
  }
  return {builder.finish(), {}};
}

}  // namespace kbvh::experiments::loop
