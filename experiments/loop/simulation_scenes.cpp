#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <stdexcept>

#include "experiments/loop/scene_parts.hpp"

namespace kbvh::experiments::loop {
namespace {

using Vector3 = Eigen::Vector3d;

/// Returns the vertices a side of a cloth with about this many triangles.
std::uint32_t cloth_side(double triangles) {
  return std::max<std::uint32_t>(3, 1 + std::uint32_t(std::lround(std::sqrt(triangles / 2))));
}

/// Adds a sphere at rest around the origin: an octahedron whose sides are cut into `cuts`^2 triangles.
void add_sphere(MeshBuilder& builder, double radius, int cuts) {
  std::vector<Vector3> vertices;
  std::vector<Eigen::Vector3<std::uint32_t>> faces;
  std::map<std::array<int, 3>, std::uint32_t> ids;
  const auto id = [&](int x, int y, int z) {
    const auto [at, is_new] = ids.try_emplace({x, y, z}, std::uint32_t(vertices.size()));
    if (is_new) vertices.push_back(radius * Vector3(x, y, z).normalized());
    return at->second;
  };
  for (const int sx : {1, -1})
    for (const int sy : {1, -1})
      for (const int sz : {1, -1})
        for (int i = 0; i < cuts; ++i)
          for (int j = 0; i + j < cuts; ++j) {
            // Points (i, j, cuts - i - j) of one eighth; an odd number of mirrors turns a triangle around.
            const auto at = [&](int x, int y) { return id(sx * x, sy * y, sz * (cuts - x - y)); };
            const auto add = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c) {
              if (sx * sy * sz > 0)
                faces.emplace_back(a, b, c);
              else
                faces.emplace_back(a, c, b);
            };
            add(at(i, j), at(i + 1, j), at(i, j + 1));
            if (i + j + 1 < cuts) add(at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
          }
  builder.add_obstacle(vertices, faces);
}

/// Adds a square floor at rest in the plane z = 0, around the origin.
void add_floor(MeshBuilder& builder, double side, std::uint32_t cells) {
  std::vector<Vector3> vertices;
  std::vector<Eigen::Vector3<std::uint32_t>> faces;
  const std::uint32_t n = cells + 1;
  for (std::uint32_t y = 0; y < n; ++y)
    for (std::uint32_t x = 0; x < n; ++x)
      vertices.emplace_back(side * (double(x) / cells - 0.5), side * (double(y) / cells - 0.5), 0);
  for (std::uint32_t y = 0; y < cells; ++y)
    for (std::uint32_t x = 0; x < cells; ++x) {
      const std::uint32_t v = y * n + x;
      faces.emplace_back(v, v + 1, v + n + 1);
      faces.emplace_back(v, v + n + 1, v + n);
    }
  builder.add_obstacle(vertices, faces);
}

/// Adds a square cloth around a point, turned about the vertical axis and tilted, with small seeded dents.
std::uint32_t add_turned_cloth(MeshBuilder& builder, const Vector3& centre, double length, std::uint32_t side,
                               double turn, double tilt, SceneChance& chance) {
  const Eigen::Matrix3d rotation =
      (Eigen::AngleAxisd(turn, Vector3::UnitZ()) * Eigen::AngleAxisd(tilt, Vector3::UnitX()))
          .toRotationMatrix();
  const Vector3 along = rotation * Vector3(length, 0, 0), across = rotation * Vector3(0, length, 0);
  const std::uint32_t first =
      builder.add_cloth({side, centre - 0.5 * (along + across), along, across}, MeshBuilder::Material{});
  // A plane is a saddle point for cloth under pressure: it would not know to which side to buckle.
  const double dent = 0.01 * length / side;
  for (std::uint32_t v = 0; v < side * side; ++v) builder.move(first + v, dent * chance.vector());
  return first;
}

Simulated sphere_scene(std::uint64_t triangles, SceneChance& chance) {
  MeshBuilder builder;
  add_sphere(builder, 0.3, std::max(4, int(std::lround(std::sqrt(double(triangles) / 16)))));
  add_turned_cloth(builder, {0, 0, 0.32}, 1, cloth_side(double(triangles)), 0.3 * chance.about_zero(), 0,
                   chance);
  return {builder.finish(), {}};
}

Simulated cloths_scene(std::uint64_t triangles, SceneChance& chance) {
  MeshBuilder builder;
  const std::uint32_t side = cloth_side(double(triangles) / 2);
  const std::uint32_t first = add_turned_cloth(builder, {0, 0, 0}, 1, side, 0, 0, chance);
  for (const std::uint32_t corner : {0u, side - 1, side * (side - 1), side * side - 1})
    builder.fix(first + corner);
  add_turned_cloth(builder, {0, 0, 0.04}, 0.8, side, 0.8 * chance.about_zero(), 0, chance);
  return {builder.finish(), {}};
}

Simulated sheets_scene(std::uint64_t triangles, SceneChance& chance) {
  constexpr std::uint32_t sheets = 6;
  MeshBuilder builder;
  add_floor(builder, 2.4, 8);
  for (std::uint32_t i = 0; i < sheets; ++i) {
    const double turn = 3 * chance.about_zero(), tilt = 0.1 * chance.about_zero();
    const Vector3 centre(0.1 * chance.about_zero(), 0.1 * chance.about_zero(), 0.05 + 0.08 * i);
    add_turned_cloth(builder, centre, 0.5, cloth_side(double(triangles) / sheets), turn, tilt, chance);
  }
  return {builder.finish(), {}};
}

Simulated stack_scene(std::uint64_t triangles, SceneChance& chance) {
  constexpr std::uint32_t boxes = 3;
  constexpr double side = 0.2, modulus = 2e4, density = 100;
  MeshBuilder builder;
  add_floor(builder, 1.2, 4);
  const auto cells =
      std::max<std::uint32_t>(2, std::uint32_t(std::lround(std::sqrt(double(triangles) / (12 * boxes)))));
  for (std::uint32_t i = 0; i < boxes; ++i) {
    const Vector3 low(-side / 2 + 0.03 * chance.about_zero(), -side / 2 + 0.03 * chance.about_zero(),
                      0.02 + 1.1 * side * i);
    const std::uint32_t first = builder.add_soft_box(low, side, cells, density, modulus * side / cells);
    const std::uint32_t n = cells + 1;
    for (std::uint32_t v = 0; v < n * n * n; ++v)
      builder.move(first + v, 0.01 * side / cells * chance.vector());
  }
  return {builder.finish(), {}};
}

struct SceneEntry {
  const char *name, *title;
  Simulated (*make)(std::uint64_t triangles, SceneChance& chance);
};

constexpr SceneEntry scene_table[] = {
    {"sphere", "a square cloth falls onto a sphere at rest", sphere_scene},
    {"cloths", "a cloth falls onto a cloth that is held at its corners", cloths_scene},
    {"sheets", "six sheets fall, turned at random, onto a floor and onto each other", sheets_scene},
    {"stack", "three soft boxes fall onto a floor and onto each other", stack_scene},
    {"walker", "three skirts, one over the other, on a figure that walks in a circle", walker_scene},
    {"knot", "a rope with an overhand knot is pulled at its ends and let go, again and again", knot_scene}};

const SceneEntry& scene_named(const std::string& name) {
  for (const SceneEntry& entry : scene_table)
    if (name == entry.name) return entry;
  throw std::invalid_argument("there is no scene '" + name + "' of the simulator");
}

/// Makes thickness and reach small enough for the mesh: neighbours in one surface, which have no common
/// vertex, must not repel each other at rest.
void fit_distances(Simulated& scene) {
  double shortest = 1;
  for (const Spring& spring : scene.mesh.springs) shortest = std::min(shortest, spring.length);
  Physics& physics = scene.physics;
  physics.thickness = std::min(physics.thickness, 0.1 * shortest);
  physics.reach = std::min(physics.reach, 0.2 * shortest);
  physics.tolerance = 0.01 * physics.reach;
}

}  // namespace

const std::vector<std::string>& scene_names() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> list;
    for (const SceneEntry& entry : scene_table) list.emplace_back(entry.name);
    return list;
  }();
  return names;
}

std::string scene_title(const std::string& name) {
  return scene_named(name).title;
}

Simulated make_scene(const std::string& name, std::uint64_t triangles, std::uint64_t seed) {
  const SceneEntry& entry = scene_named(name);
  SceneChance chance(seed);
  Simulated scene = entry.make(std::max<std::uint64_t>(triangles, 8), chance);
  fit_distances(scene);
  return scene;
}

}  // namespace kbvh::experiments::loop
