// The scenes that age trees: sizes, soundness, determinism, and that trees do age.
#include <gtest/gtest.h>

#include <set>
#include <string>
#include <vector>

#include "core/judge/audit.hpp"
#include "core/topology/builders.hpp"
#include "experiments/scenes/builtin_scenes.hpp"
#include "experiments/scenes/scene_card.hpp"
#include "experiments/scenes/scene_spec.hpp"
#include "tests/support/mesh_checks.hpp"

namespace kbvh::experiments::ageing_scenes_test {
namespace {

using namespace test;

struct Expected {
  const char* name;
  std::uint64_t hash;  // of both bodies' positions: 600 triangles, seed 1, 12 keyframes
  double ageing;       // lower bound at 2000 triangles, 60 keyframes
};

/// Writes the name where a test shows the parameter.
void PrintTo(const Expected& expected, std::ostream* out) {
  *out << expected.name;
}

const std::vector<Expected>& scenes_that_age() {
  static const std::vector<Expected> list{
      {"mixing_swarms", 4867445497390876551u, 5},      {"crossing_crowd", 1062811244079137155u, 2.5},
      {"shattering_balls", 14205977155971312464u, 10}, {"flowing_soup", 11712640580242507919u, 5},
      {"twisted_rod", 5189276561319336181u, 1},        {"tightening_knot", 9723841596757303907u, 2.5},
      {"unrolling_yarns", 13707727564082997568u, 20},  {"funnel_cloth", 901331336081563817u, 1.1},
      {"running_figures", 40435015911480821u, 1},
  };
  return list;
}

LoadedScene loaded(const std::string& name, std::uint32_t triangles, std::uint32_t keyframes,
                   std::uint64_t seed = 1) {
  SceneSpec spec;
  spec.builtin = name;
  spec.options = {.triangles = triangles, .seed = seed, .keyframes = keyframes};
  return load(spec);
}

std::uint64_t hash_of_positions(const LoadedScene& scene) {
  std::vector<double> all;
  for (const io::AnimatedMesh& mesh : scene.meshes)
    all.insert(all.end(), mesh.positions.begin(), mesh.positions.end());
  return hash(all);
}

class AgeingScenes : public testing::TestWithParam<Expected> {};

TEST_P(AgeingScenes, AreSoundAtEverySize) {
  for (const std::uint32_t triangles : {1u, 20u, 300u, 2000u})
    for (const std::uint32_t keyframes : {2u, 13u}) {
      const LoadedScene scene = loaded(GetParam().name, triangles, keyframes);
      for (const io::AnimatedMesh& mesh : scene.meshes) expect_sound(mesh, mesh.moving() ? keyframes : 1);
      EXPECT_TRUE(scene.meshes[0].moving());
      // The nearest number that the pattern allows: patterns are coarse at small sizes.
      if (triangles < 2000) continue;
      EXPECT_NEAR(double(scene.meshes[0].primitive_count()), 2000, 120) << GetParam().name;
    }
}

TEST_P(AgeingScenes, AskForPairsWithinSingleBodies) {
  const Scene<float> scene = assemble<float>(loaded(GetParam().name, 100, 2));
  ASSERT_EQ(scene.pairs.size(), 1u);
  EXPECT_EQ(scene.pairs[0].first == scene.pairs[0].second, scene.bodies.size() == 1);
}

// The same bits on every machine, in float and in double.
TEST_P(AgeingScenes, SameSeedSameBits) {
  const LoadedScene scene = loaded(GetParam().name, 600, 12);
  EXPECT_EQ(hash_of_positions(scene), GetParam().hash) << GetParam().name;
  EXPECT_NE(hash_of_positions(scene), hash_of_positions(loaded(GetParam().name, 600, 12, 2)));
  const Scene<float> single = assemble<float>(scene);
  const Scene<double> twice = assemble<double>(scene);
  for (std::size_t body = 0; body < single.bodies.size(); ++body)
    for (std::size_t k = 0; k < scene.meshes[body].keyframe_times.size(); ++k)
      for (std::size_t i = 0; i < 3 * std::size_t(scene.meshes[body].vertex_count); ++i)
        ASSERT_EQ(double(single.bodies[body].plans.keyframe(k)[i]), twice.bodies[body].plans.keyframe(k)[i]);
}

/// Returns the SAH cost at the last keyframe of the first keyframe's tree, divided by that of a tree built
/// there.
double ageing(const LoadedScene& loaded) {
  const Scene<float> scene = assemble<float>(loaded);
  double kept = 0, rebuilt = 0;
  for (const Body<float>& body : scene.bodies) {
    if (!body.plans.moving()) continue;
    const BuilderConfig config{.method = BuildMethod::sah, .width = 2, .leaf_size = 4};
    const float* last = body.plans.keyframe(body.plans.keyframe_count() - 1);
    const Topology first_tree = build_topology(body.primitives, body.plans.keyframe(0), config);
    const Topology last_tree = build_topology(body.primitives, last, config);
    kept += sah_cost(first_tree, tight_boxes(first_tree, body.primitives, last));
    rebuilt += sah_cost(last_tree, tight_boxes(last_tree, body.primitives, last));
  }
  return kept / rebuilt;
}

TEST_P(AgeingScenes, TreesAge) {
  const double found = ageing(loaded(GetParam().name, 2000, 60));
  EXPECT_GE(found, GetParam().ageing);
  RecordProperty("ageing", std::to_string(found));
}

INSTANTIATE_TEST_SUITE_P(All, AgeingScenes, testing::ValuesIn(scenes_that_age()),
                         [](const auto& test) { return std::string(test.param.name); });

TEST(AgeingScenes, ClosedBodiesAreClosed) {
  // Every part of a crowd or a swarm is a separate surface: 2 each.
  const LoadedScene swarms = loaded("mixing_swarms", 600, 2);
  for (const io::AnimatedMesh& mesh : swarms.meshes)
    expect_closed(mesh, 2 * std::int64_t(mesh.primitive_count()) / 20);
  const LoadedScene crowd = loaded("crossing_crowd", 720, 2);
  expect_closed(crowd.meshes[0], 3 * 2 * 20);
  for (const char* name : {"twisted_rod", "tightening_knot", "unrolling_yarns"})
    for (const io::AnimatedMesh& mesh : loaded(name, 700, 2).meshes) expect_closed(mesh);
  expect_closed(loaded("funnel_cloth", 700, 2).meshes[1], 0);
}

TEST(AgeingScenes, RunnersStepAsFarAsTheirTrianglesAreLong) {
  const LoadedScene scene = loaded("running_figures", 16000, 26);
  for (const BodyCard& card : cards(scene)) {
    EXPECT_GT(card.mean_step, 0.7) << card.name;
    EXPECT_LT(card.mean_step, 4) << card.name;
  }
}

TEST(AgeingScenes, ScenesOfOneBodyRefuseAnObstacle) {
  const auto message = [](const char* scene) {
    try {
      read_scenes({{"builtin", scene}, {"obstacle", 100}}, "scene 1", {});
    } catch (const io::InputError& problem) {
      return std::string(problem.what());
    }
    return std::string();
  };
  EXPECT_EQ(message("twisted_rod"), "scene 1: obstacle: the scene 'twisted_rod' has one body");
  EXPECT_EQ(message("mixing_swarms"), "");
}

}  // namespace
}  // namespace kbvh::experiments::ageing_scenes_test
