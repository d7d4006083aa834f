#include "experiments/scenes/curtain.hpp"

#include <vector>

#include "experiments/scenes/mesh_parts.hpp"
#include "experiments/scenes/shapes.hpp"

namespace kbvh::scenes {

using cloth::Vec;

namespace {

constexpr double side = 2.0, half_path = 1.2;      // of the curtain; of the box's centre
constexpr double half_width = 0.2, reach = 0.6;    // of the box; of the bulge around its centre
constexpr double box_bottom = 0.3, box_top = 0.9;  // heights
constexpr double front = -0.15, back = 0.25;       // of the box, where the curtain hangs at y = 0

double step_of(std::uint32_t keyframes) {
  return keyframes > 1 ? 2 * half_path / double(keyframes - 1) : 0;
}

}  // namespace

io::AnimatedMesh swept_curtain(std::uint32_t triangles, std::uint64_t seed, std::uint32_t keyframes) {
  io::AnimatedMesh mesh = sheet(triangles, {0, 0, 0}, side);
  mesh.name = "swept-curtain-" + std::to_string(mesh.primitive_count());
  const SeededNoise noise(seed);
  std::vector<Vec> hanging;
  for (std::size_t i = 0; i < 3 * std::size_t(mesh.vertex_count); i += 3) {
    const double x = mesh.positions[i], z = mesh.positions[i + 1] + 0.5 * side;
    const double pleats = 0.03 * sine_of_turns(4 * x + noise.signed_unit(0)) +
                          0.01 * sine_of_turns(7 * x + 0.3 * z + noise.signed_unit(1));
    hanging.push_back({x, pleats, z});
  }
  mesh.keyframe_times = keyframe_times(keyframes, 30);
  mesh.positions.clear();
  std::vector<Vec> positions(hanging);
  for (std::uint32_t k = 0; k < keyframes; ++k) {
    const double centre = -half_path + step_of(keyframes) * double(k);
    for (std::size_t v = 0; v < positions.size(); ++v) {
      const double away = (hanging[v].x - centre) / reach, near = 1 - away * away;
      // The rod holds the top; at the height of the box the cloth is pushed almost out of its way.
      const double push = 1.3 * -front * (side - hanging[v].z) / (side - box_bottom);
      positions[v] = hanging[v];
      if (near > 0) positions[v].y -= push * near * near * (3 - 2 * near);
    }
    append_keyframe(mesh, positions);
  }
  return mesh;
}

io::AnimatedMesh sweeping_box(std::uint32_t triangles, std::uint32_t keyframes) {
  return translated(
      box(triangles, {-half_path - half_width, front, box_bottom}, {-half_path + half_width, back, box_top}),
      {step_of(keyframes), 0, 0}, keyframes);
}

}  // namespace kbvh::scenes
