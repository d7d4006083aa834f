#include "experiments/loop/simulated_mesh.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

namespace kbvh::experiments::loop {
namespace {

using Vector3 = Eigen::Vector3d;

/// A side of a face, with the corner opposite to it.
struct FaceSide {
  std::uint32_t low, high, opposite, face;
  auto operator<=>(const FaceSide&) const = default;
};

/// Returns the sides of the faces from `first` on, those of a common edge next to each other.
std::vector<FaceSide> sorted_sides(std::span<const Eigen::Vector3<std::uint32_t>> faces, std::size_t first) {
  std::vector<FaceSide> sides;
  for (std::size_t f = first; f < faces.size(); ++f)
    for (int k = 0; k < 3; ++k) {
      const std::uint32_t a = faces[f][k], b = faces[f][(k + 1) % 3], c = faces[f][(k + 2) % 3];
      sides.push_back({std::min(a, b), std::max(a, b), c, std::uint32_t(f)});
    }
  std::sort(sides.begin(), sides.end());
  return sides;
}

double cotangent(const Vector3& a, const Vector3& b) {
  return a.dot(b) / a.cross(b).norm();
}

}  // namespace

std::uint32_t MeshBuilder::add_vertex(const Vector3& at) {
  vertices_.push_back(at);
  mass_.push_back(0);
  fixed_.push_back(0);
  obstacle_.push_back(0);
  joint_.push_back(-1);
  return std::uint32_t(vertices_.size() - 1);
}

void MeshBuilder::add_spring(std::uint32_t a, std::uint32_t b, double stiffness) {
  springs_.push_back({a, b, (vertices_[a] - vertices_[b]).norm(), stiffness});
}

void MeshBuilder::add_obstacle(std::span<const Vector3> vertices,
                               std::span<const Eigen::Vector3<std::uint32_t>> faces) {
  const auto first = std::uint32_t(vertices_.size());
  for (const Vector3& vertex : vertices) {
    const std::uint32_t id = add_vertex(vertex);
    fix(id);
    mass_[id] = 1;
  }
  for (const auto& face : faces) add_face(first + face[0], first + face[1], first + face[2]);
}

void MeshBuilder::add_driven_obstacle(std::span<const Vector3> vertices,
                                      std::span<const Eigen::Vector3<std::uint32_t>> faces,
                                      std::int32_t joint) {
  const auto first = std::uint32_t(vertices_.size());
  for (const Vector3& vertex : vertices) {
    const std::uint32_t id = add_vertex(vertex);
    obstacle_[id] = 1;
    drive(id, joint);
  }
  for (const auto& face : faces) add_face(first + face[0], first + face[1], first + face[2]);
}

std::int32_t MeshBuilder::add_joint(const Joint& joint) {
  joints_.push_back(joint);
  return std::int32_t(joints_.size() - 1);
}

void MeshBuilder::drive(std::uint32_t vertex, std::int32_t joint) {
  mass_[vertex] = 10;
  joint_[vertex] = joint;
}

std::uint32_t MeshBuilder::add_cloth(const Sheet& sheet, const Material& material) {
  const std::uint32_t side = sheet.side;
  std::vector<Vector3> points;
  for (std::uint32_t y = 0; y < side; ++y)
    for (std::uint32_t x = 0; x < side; ++x)
      points.push_back(sheet.corner + sheet.along * (double(x) / (side - 1)) +
                       sheet.across * (double(y) / (side - 1)));
  return add_cloth(Grid{side, side, false}, points, material);
}

std::uint32_t MeshBuilder::add_cloth(const Grid& grid, std::span<const Vector3> points,
                                     const Material& material) {
  const std::uint32_t columns = grid.columns;
  const auto first = std::uint32_t(vertices_.size());
  const std::size_t first_face = faces_.size(), first_spring = springs_.size();
  for (const Vector3& point : points) add_vertex(point);
  for (std::uint32_t y = 0; y < grid.rows; ++y)
    for (std::uint32_t x = 0; x < columns; ++x) {
      const bool has_next = x + 1 < columns || grid.closed, has_lower = y + 1 < grid.rows;
      const std::uint32_t v = first + y * columns + x;
      const std::uint32_t next = x + 1 < columns ? v + 1 : first + y * columns;
      if (has_next) add_spring(v, next, material.stretch);
      if (has_lower) add_spring(v, v + columns, material.stretch);
      if (!has_next || !has_lower) continue;
      // Both diagonals resist shear, although only one of them is an edge.
      add_spring(v, next + columns, 0.5 * material.stretch);
      add_spring(next, v + columns, 0.5 * material.stretch);
      if ((x + y) % 2 == 0) {
        add_face(v, next, next + columns);
        add_face(v, next + columns, v + columns);
      } else {
        add_face(v, next, v + columns);
        add_face(next, next + columns, v + columns);
      }
    }
  for (std::size_t f = first_face; f < faces_.size(); ++f) {
    const auto& face = faces_[f];
    const Vector3 a = vertices_[face[0]], b = vertices_[face[1]], c = vertices_[face[2]];
    const double third = material.area_density * (b - a).cross(c - a).norm() / 6;
    for (int k = 0; k < 3; ++k) mass_[face[k]] += third;
  }
  // By vertices, so that neighbours in memory are neighbours in space.
  std::sort(springs_.begin() + std::ptrdiff_t(first_spring), springs_.end(),
            [](const Spring& s, const Spring& t) { return std::pair(s.a, s.b) < std::pair(t.a, t.b); });
  add_hinges(first_face, material.bending);
  return first;
}

void MeshBuilder::add_hinges(std::size_t first_face, double bending) {
  const std::vector<FaceSide> sides = sorted_sides(faces_, first_face);
  for (std::size_t i = 0; i + 1 < sides.size(); ++i) {
    const FaceSide &one = sides[i], &other = sides[i + 1];
    if (one.low != other.low || one.high != other.high) continue;
    const Vector3 x0 = vertices_[one.low], x1 = vertices_[one.high], x2 = vertices_[one.opposite],
                  x3 = vertices_[other.opposite];
    // Bergou et al. 2006: cotangents of the angles at the two ends of the edge, in both triangles.
    const double c0 = cotangent(x1 - x0, x2 - x0), c1 = cotangent(x0 - x1, x2 - x1),
                 d0 = cotangent(x1 - x0, x3 - x0), d1 = cotangent(x0 - x1, x3 - x1);
    const double area = 0.5 * ((x1 - x0).cross(x2 - x0).norm() + (x1 - x0).cross(x3 - x0).norm());
    hinges_.push_back({{one.low, one.high, one.opposite, other.opposite},
                       {c1 + d1, c0 + d0, -c0 - c1, -d0 - d1},
                       3 * bending / area});
  }
}

std::uint32_t MeshBuilder::add_soft_box(const Vector3& low, double side, std::uint32_t cells, double density,
                                        double stiffness) {
  const std::uint32_t n = cells + 1;
  const auto first = std::uint32_t(vertices_.size());
  const double spacing = side / cells;
  const auto id = [&](std::uint32_t x, std::uint32_t y, std::uint32_t z) {
    return first + (z * n + y) * n + x;
  };
  for (std::uint32_t z = 0; z < n; ++z)
    for (std::uint32_t y = 0; y < n; ++y)
      for (std::uint32_t x = 0; x < n; ++x)
        mass_[add_vertex(low + spacing * Vector3(x, y, z))] = density * side * side * side / (n * n * n);
  // One spring for each pair of corners of a common cell, from the lower corner in (z, y, x).
  for (std::uint32_t z = 0; z < n; ++z)
    for (std::uint32_t y = 0; y < n; ++y)
      for (std::uint32_t x = 0; x < n; ++x)
        for (int step = 0; step < 13; ++step) {
          // (dx, dy, dz) runs through the half of the 26 neighbours that come later.
          const int code = step + 14, dx = code % 3 - 1, dy = code / 3 % 3 - 1, dz = code / 9 - 1;
          const auto inside = [n](std::uint32_t at, int by) { return std::uint32_t(int(at) + by) < n; };
          if (!inside(x, dx) || !inside(y, dy) || !inside(z, dz)) continue;
          const int diagonal = dx * dx + dy * dy + dz * dz;
          add_spring(id(x, y, z), id(x + std::uint32_t(dx), y + std::uint32_t(dy), z + std::uint32_t(dz)),
                     stiffness / diagonal);
        }
  // The six sides; corner(u, v) of each in an order that turns outward.
  const auto add_side = [&](const auto& corner) {
    for (std::uint32_t v = 0; v < cells; ++v)
      for (std::uint32_t u = 0; u < cells; ++u) {
        add_face(corner(u, v), corner(u + 1, v), corner(u + 1, v + 1));
        add_face(corner(u, v), corner(u + 1, v + 1), corner(u, v + 1));
      }
  };
  add_side([&](std::uint32_t u, std::uint32_t v) { return id(v, u, 0); });
  add_side([&](std::uint32_t u, std::uint32_t v) { return id(u, v, cells); });
  add_side([&](std::uint32_t u, std::uint32_t v) { return id(u, 0, v); });
  add_side([&](std::uint32_t u, std::uint32_t v) { return id(v, cells, u); });
  add_side([&](std::uint32_t u, std::uint32_t v) { return id(0, v, u); });
  add_side([&](std::uint32_t u, std::uint32_t v) { return id(cells, u, v); });
  return first;
}

std::uint32_t MeshBuilder::add_rope(const Rope& rope) {
  const std::span<const Vector3> line = rope.line;
  const std::uint32_t sides = rope.sides, stride = sides + 1;
  const auto rings = std::uint32_t(line.size());
  const auto first = std::uint32_t(vertices_.size());
  const double spacing = (line[1] - line[0]).norm();
  // The frame of a ring is that of the ring before it, turned as little as the line's direction needs.
  Vector3 direction = (line[1] - line[0]).normalized(), normal = direction.unitOrthogonal();
  for (std::uint32_t i = 0; i < rings; ++i) {
    const Vector3 next = (line[std::min(i + 1, rings - 1)] - line[i == 0 ? 0 : i - 1]).normalized();
    normal = Eigen::Quaterniond::FromTwoVectors(direction, next) * normal;
    normal = (normal - normal.dot(next) * next).normalized();
    direction = next;
    const Vector3 other = direction.cross(normal);
    for (std::uint32_t j = 0; j < sides; ++j) {
      const double angle = 2 * std::numbers::pi * j / sides;
      add_vertex(line[i] + rope.radius * (std::cos(angle) * normal + std::sin(angle) * other));
    }
    add_vertex(line[i]);
  }
  const double area = std::numbers::pi * rope.radius * rope.radius;
  const double mass = rope.density * area * spacing / stride;
  for (std::uint32_t v = first; v < vertices_.size(); ++v) mass_[v] = mass;
  // As in a cubic grid of this spacing: springs are weaker the longer they are.
  const double side = 2 * rope.radius * std::sin(std::numbers::pi / sides);
  const auto join = [&](std::uint32_t a, std::uint32_t b) {
    add_spring(a, b, rope.modulus * side * side * side / (vertices_[a] - vertices_[b]).squaredNorm());
  };
  for (std::uint32_t i = 0; i < rings; ++i) {
    const std::uint32_t ring = first + i * stride, centre = ring + sides;
    for (std::uint32_t j = 0; j < sides; ++j) {
      const std::uint32_t v = ring + j, next = ring + (j + 1) % sides;
      join(v, next);
      join(v, centre);
      if (i + 1 == rings) continue;
      join(v, v + stride);
      join(v, next + stride);
      join(next, v + stride);
      join(v, centre + stride);
      join(centre, v + stride);
      add_face(v, next, next + stride);
      add_face(v, next + stride, v + stride);
    }
    if (i + 1 < rings) join(centre, centre + stride);
  }
  const std::uint32_t last = first + (rings - 1) * stride;
  for (std::uint32_t j = 0; j < sides; ++j) {
    add_face(first + sides, first + (j + 1) % sides, first + j);
    add_face(last + sides, last + j, last + (j + 1) % sides);
  }
  return first;
}

SimulatedMesh MeshBuilder::finish() const {
  SimulatedMesh mesh;
  const auto n = Eigen::Index(vertices_.size());
  mesh.positions.resize(n, 3);
  for (Eigen::Index v = 0; v < n; ++v) mesh.positions.row(v) = vertices_[std::size_t(v)].transpose();
  mesh.velocities = Positions::Zero(n, 3);
  mesh.faces.resize(Eigen::Index(faces_.size()), 3);
  for (std::size_t f = 0; f < faces_.size(); ++f) mesh.faces.row(Eigen::Index(f)) = faces_[f].transpose();
  std::vector<std::array<std::uint32_t, 2>> edges;
  for (const FaceSide& side : sorted_sides(faces_, 0))
    if (edges.empty() || edges.back() != std::array{side.low, side.high})
      edges.push_back({side.low, side.high});
  mesh.edges.resize(Eigen::Index(edges.size()), 2);
  for (std::size_t e = 0; e < edges.size(); ++e) mesh.edges.row(Eigen::Index(e)) << edges[e][0], edges[e][1];
  mesh.mass = mass_;
  mesh.fixed = fixed_;
  mesh.joint = joint_;
  mesh.obstacle = obstacle_;
  std::vector<std::uint8_t> outer(vertices_.size(), 0);
  for (const auto& face : faces_)
    for (int k = 0; k < 3; ++k) outer[face[k]] = 1;
  for (std::uint32_t v = 0; v < outer.size(); ++v)
    if (outer[v] == 0) mesh.inner.push_back(v);
  mesh.springs = springs_;
  mesh.hinges = hinges_;
  mesh.joints = joints_;
  return mesh;
}

}  // namespace kbvh::experiments::loop
