#include "experiments/scenes/modal.hpp"

#include <array>
#include <cmath>
#include <vector>

#include "experiments/scenes/mesh_parts.hpp"
#include "experiments/scenes/shapes.hpp"

namespace kbvh::scenes {

using cloth::dot;
using cloth::length;
using cloth::Vec;

namespace {

constexpr double rate = 30;  // keyframes per second
constexpr std::size_t target_count = 4;

/// A rounded bump around a direction.
struct Bump {
  Vec direction;
  double height;
};

std::vector<Bump> bumps(const SeededNoise& noise) {
  std::vector<Bump> result;
  for (std::uint64_t n = 0; result.size() < 24; n += 4) {
    const Vec p{noise.signed_unit(n), noise.signed_unit(n + 1), noise.signed_unit(n + 2)};
    if (dot(p, p) > 1 || dot(p, p) < 0.01) continue;
    result.push_back({p * (1 / length(p)), 0.12 * noise.signed_unit(n + 3)});
  }
  return result;
}

/// The targets at a direction of length 1.
std::array<Vec, target_count> targets_at(const Vec& n, const std::vector<Bump>& all) {
  double bumpy = 0.5;
  for (const Bump& bump : all) {
    const double near = dot(n, bump.direction) - 0.85;
    if (near > 0) bumpy += bump.height * near * near * (1 / (0.15 * 0.15));
  }
  const double z2 = n.z * n.z, x2 = n.x * n.x, y2 = n.y * n.y;
  const double star = 0.45 * (1 + 0.3 * (35 * z2 * z2 - 30 * z2 + 3) / 8);
  const double across = 0.2 + 0.25 * x2;
  const double cube = 0.42 / std::sqrt(std::sqrt(x2 * x2 + y2 * y2 + z2 * z2));
  return {n * bumpy, n * star, Vec{0.75 * n.x, across * n.y, across * n.z}, n * cube};
}

}  // namespace

io::AnimatedMesh morphing_ball(const ModalConfig& config) {
  io::AnimatedMesh mesh = icosphere(config.triangles, {0, 0, 0}, 1.0);
  mesh.name = "morphing-" + mesh.name;
  const std::vector<Bump> all = bumps(SeededNoise(config.seed));
  std::vector<std::array<Vec, target_count>> targets;
  for (std::size_t i = 0; i < 3 * std::size_t(mesh.vertex_count); i += 3) {
    const Vec p{mesh.positions[i], mesh.positions[i + 1], mesh.positions[i + 2]};
    targets.push_back(targets_at(p * (1 / length(p)), all));
  }
  mesh.keyframe_times = keyframe_times(config.keyframes, rate);
  mesh.positions.clear();
  std::vector<Vec> positions(targets.size());
  constexpr double periods[target_count] = {2.0, 1.7, 1.3, 1.1};  // seconds
  for (std::uint32_t k = 0; k < config.keyframes; ++k) {
    double weights[target_count], sum = 0;
    for (std::size_t i = 0; i < target_count; ++i) {
      const double wave = 1 + sine_of_turns(mesh.keyframe_times[k] / periods[i] + 0.25 * double(i));
      weights[i] = 0.02 + wave * wave;
      sum += weights[i];
    }
    for (std::size_t v = 0; v < positions.size(); ++v) {
      positions[v] = Vec{0, 0, 0};
      for (std::size_t i = 0; i < target_count; ++i) positions[v] += targets[v][i] * (weights[i] / sum);
    }
    append_keyframe(mesh, positions);
  }
  return mesh;
}

io::AnimatedMesh vibrating_plate(const ModalConfig& config) {
  io::AnimatedMesh mesh = sheet(config.triangles, {0, 0, 0}, 2.0);
  mesh.name = "vibrating-" + mesh.name;
  constexpr std::size_t modes = 8;
  constexpr int waves[modes][2] = {{1, 1}, {2, 1}, {1, 2}, {2, 2}, {3, 1}, {1, 3}, {3, 2}, {2, 3}};
  const SeededNoise noise(config.seed);
  std::vector<Vec> flat;
  std::vector<std::array<double, modes>> shapes;
  for (std::size_t i = 0; i < 3 * std::size_t(mesh.vertex_count); i += 3) {
    flat.push_back({mesh.positions[i], mesh.positions[i + 1], 0});
    const double x = 0.25 * (mesh.positions[i] + 1), y = 0.25 * (mesh.positions[i + 1] + 1);
    std::array<double, modes> shape{};
    for (std::size_t m = 0; m < modes; ++m)
      shape[m] = sine_of_turns(waves[m][0] * x) * sine_of_turns(waves[m][1] * y);
    shapes.push_back(shape);
  }
  mesh.keyframe_times = keyframe_times(config.keyframes, rate);
  mesh.positions.clear();
  std::vector<Vec> positions(flat);
  for (std::uint32_t k = 0; k < config.keyframes; ++k) {
    double amplitudes[modes];
    for (std::size_t m = 0; m < modes; ++m) {
      const double squares = waves[m][0] * waves[m][0] + waves[m][1] * waves[m][1];
      const double t = mesh.keyframe_times[k];
      amplitudes[m] = 0.5 / squares * (1 + 0.5 * noise.signed_unit(2 * m)) / (1 + 0.02 * squares * t) *
                      sine_of_turns(0.15 * squares * t + noise.signed_unit(2 * m + 1));
    }
    for (std::size_t v = 0; v < positions.size(); ++v) {
      positions[v] = flat[v];
      for (std::size_t m = 0; m < modes; ++m) positions[v].z += amplitudes[m] * shapes[v][m];
    }
    append_keyframe(mesh, positions);
  }
  return mesh;
}

io::AnimatedMesh dented_sheet(const ModalConfig& config) {
  io::AnimatedMesh mesh = sheet(config.triangles, {0, 0, 0}, 2.0);
  mesh.name = "dented-" + mesh.name;
  constexpr double radius = 0.25;
  constexpr std::uint32_t steps = 6;  // keyframes of a dent
  const SeededNoise noise(config.seed);
  std::vector<Vec> positions;
  for (std::size_t i = 0; i < 3 * std::size_t(mesh.vertex_count); i += 3)
    positions.push_back({mesh.positions[i], mesh.positions[i + 1], 0});
  mesh.keyframe_times = keyframe_times(config.keyframes, rate);
  mesh.positions.clear();
  for (std::uint32_t k = 0; k < config.keyframes; ++k) {
    if (k > 0) {
      const std::uint64_t n = 3 * std::uint64_t((k - 1) / steps);
      const double x = 0.75 * noise.signed_unit(n), y = 0.75 * noise.signed_unit(n + 1);
      const double depth = (0.12 + 0.06 * noise.signed_unit(n + 2)) / steps;
      for (Vec& p : positions) {
        const double near = 1 - ((p.x - x) * (p.x - x) + (p.y - y) * (p.y - y)) * (1 / (radius * radius));
        if (near > 0) p.z -= depth * near * near * near;
      }
    }
    append_keyframe(mesh, positions);
  }
  return mesh;
}

}  // namespace kbvh::scenes
