// Two people who run on the spot.
#include <utility>
#include <vector>

#include "experiments/scenes/ageing.hpp"
#include "experiments/scenes/mesh_parts.hpp"
#include "experiments/scenes/shapes.hpp"
#include "experiments/scenes/walker.hpp"

namespace kbvh::scenes {

using cloth::Vec;

std::pair<io::AnimatedMesh, io::AnimatedMesh> running_figures(const AgeingConfig& config,
                                                              std::uint32_t second_triangles) {
  constexpr double apart_x = 0.38, apart_y = 0.12;
  const SeededNoise noise(config.seed);
  const FigureShape shapes[2] = {man(), woman()};
  const std::uint32_t triangles[2] = {config.triangles, second_triangles};
  io::AnimatedMesh meshes[2];
  for (std::size_t i = 0; i < 2; ++i) {
    const Gait gait{.cycles_per_second = 1.45 + 0.1 * noise.signed_unit(2 * i),
                    .metres_per_second = 0,
                    .hip_swing = 34,
                    .arm_swing = 42,
                    .phase = noise.signed_unit(2 * i + 1)};
    Walker walker(shapes[i], gait);
    const Skin skin(walker, shapes[i], triangles[i], 0);
    meshes[i] = skin.mesh();
    meshes[i].name = "runner-" + std::to_string(meshes[i].primitive_count());
    meshes[i].keyframe_times = keyframe_times(config.keyframes, 25);
    meshes[i].positions.clear();
    std::vector<Vec> positions;
    for (const double t : meshes[i].keyframe_times) {
      walker.pose(t, 1);
      skin.positions(walker, positions);
      // The second one faces the first.
      if (i == 1)
        for (Vec& p : positions) p = {apart_x - p.x, apart_y - p.y, p.z};
      append_keyframe(meshes[i], positions);
    }
  }
  return {std::move(meshes[0]), std::move(meshes[1])};
}

}  // namespace kbvh::scenes
