// The scenes whose motion is linear in few modes, or deforms few places: sizes, soundness, determinism,
// modes.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "core/families/blend/reduced_model.hpp"
#include "experiments/scenes/builtin_scenes.hpp"
#include "experiments/scenes/scene_spec.hpp"
#include "tests/support/mesh_checks.hpp"

namespace kbvh::experiments::modal_scenes_test {
namespace {

using namespace test;

LoadedScene loaded(const std::string& name, std::uint32_t triangles, std::uint32_t keyframes,
                   std::uint64_t seed = 1) {
  SceneSpec spec;
  spec.builtin = name;
  spec.options = {.triangles = triangles, .seed = seed, .keyframes = keyframes};
  return load(spec);
}

struct Expected {
  const char* name;
  std::uint64_t hash;   // of the moving body's positions: 600 triangles, seed 1, 25 keyframes
  std::uint32_t modes;  // of these
};
constexpr Expected scenes[] = {{"morphing_ball", 2368582499016020357u, 3},
                               {"vibrating_plate", 14167524437729109103u, 8},
                               {"dented_sheet", 15954401202638848579u, 4}};

TEST(ModalScenes, AreSoundAtEverySize) {
  for (const Expected& expected : scenes)
    for (const std::uint32_t triangles : {1u, 20u, 2000u})
      for (const std::uint32_t keyframes : {2u, 13u}) {
        const LoadedScene scene = loaded(expected.name, triangles, keyframes);
        for (const io::AnimatedMesh& mesh : scene.meshes) expect_sound(mesh, mesh.moving() ? keyframes : 1);
        EXPECT_TRUE(scene.meshes[0].moving());
        if (triangles < 2000) continue;
        EXPECT_NEAR(double(scene.meshes[0].primitive_count()), 2000, 120);
      }
  expect_closed(loaded("morphing_ball", 700, 2).meshes[0]);
}

TEST(ModalScenes, SameSeedSameBitsAndFewModes) {
  for (const Expected& expected : scenes) {
    const LoadedScene scene = loaded(expected.name, 600, 25);
    EXPECT_EQ(hash(scene.meshes[0].positions), expected.hash) << expected.name;
    EXPECT_NE(hash(scene.meshes[0].positions), hash(loaded(expected.name, 600, 25, 2).meshes[0].positions));
    const Scene<double> assembled = assemble<double>(scene);
    const ReducedModel<double> model(assembled.bodies[0].plans, {25, 1e-6});
    EXPECT_EQ(model.mode_count, expected.modes) << expected.name;
    EXPECT_LT(model.rms, 1e-6) << expected.name;
  }
}

TEST(ModalScenes, DentsMoveFewVertices) {
  const LoadedScene scene = loaded("dented_sheet", 2000, 13);
  const io::AnimatedMesh& mesh = scene.meshes[0];
  const std::size_t row = 3 * std::size_t(mesh.vertex_count);
  for (std::size_t k = 1; k < 13; ++k) {
    std::size_t moved = 0;
    for (std::size_t i = 0; i < row; ++i)
      moved += mesh.positions[k * row + i] != mesh.positions[(k - 1) * row + i] ? 1 : 0;
    EXPECT_GT(moved, 0u);
    EXPECT_LT(double(moved), 0.07 * double(mesh.vertex_count));
  }
}

}  // namespace
}  // namespace kbvh::experiments::modal_scenes_test
