// Scene cards: counts, and shares of realisers against a plain search over every node.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>
#include <vector>

#include "core/base/hasher.hpp"
#include "core/topology/builders.hpp"
#include "experiments/common/text.hpp"
#include "experiments/scenes/curves.hpp"
#include "experiments/scenes/lab_scene.hpp"
#include "experiments/scenes/scene_card.hpp"
#include "experiments/scenes/shapes.hpp"

namespace kbvh::experiments::scene_card_test {
namespace {

LoadedScene scene_of(std::vector<io::AnimatedMesh> meshes) {
  LoadedScene scene;
  scene.name = "test";
  for (const io::AnimatedMesh& mesh : meshes) scene.sources.push_back(mesh.name);
  scene.meshes = std::move(meshes);
  return scene;
}

TEST(SceneCard, NothingChangesInWhatIsMovedAsAWhole) {
  // On a lattice, so that the motion is exact in float.
  const io::AnimatedMesh ball = scenes::snapped(scenes::icosphere(80, {0, 0, 0}, 1.0), 12);
  const auto list = cards(scene_of({scenes::translated(ball, {0.25, 0, 0}, 5), ball}));
  ASSERT_EQ(list.size(), 2u);
  EXPECT_EQ(list[0].name, "icosphere-80");
  EXPECT_EQ(list[0].primitives, 80u);
  EXPECT_EQ(list[0].vertices, 42u);
  EXPECT_EQ(list[0].nodes, 159u);
  EXPECT_EQ(list[0].keyframes, 5u);
  EXPECT_NEAR(list[0].seconds, 4.0 / 30, 1e-12);
  EXPECT_EQ(list[0].sides_changed, 0);
  EXPECT_EQ(list[0].most_sides_changed, 0);
  EXPECT_GT(list[0].mean_step, 0);
  EXPECT_NEAR(list[0].mean_step, list[0].largest_step, 1e-9);
  EXPECT_EQ(list[1].keyframes, 1u);
  EXPECT_EQ(list[1].sides_changed, 0);
  EXPECT_EQ(list[1].largest_step, 0);
}

TEST(SceneCard, SharesEqualAPlainSearch) {
  const LoadedScene scene = scene_of({scenes::random_soup(60, 3, 6)});
  const Body<float> body = assemble<float>(scene).bodies[0];
  const Topology topology =
      build_topology(body.primitives, body.plans.keyframe(0), {BuildMethod::median, 2, 1});
  // In a soup in general position no two vertices of a node are equal: the realiser is the extreme one.
  const auto realiser = [&](std::size_t k, std::uint32_t node, std::size_t side) {
    std::uint32_t best = 0xffffffffu;
    const std::function<void(std::uint32_t)> visit = [&](std::uint32_t n) {
      const TopologyNode& at = topology.nodes[n];
      for (std::uint32_t i = at.first(); i < at.first() + at.count(); ++i) {
        if (!at.is_leaf()) {
          visit(i);
          continue;
        }
        for (const std::uint32_t v : body.primitives[topology.primitives[i]]) {
          const float* x = body.plans.keyframe(k) + side / 2;
          if (best == 0xffffffffu || (side % 2 == 0 ? x[3 * v] < x[3 * best] : x[3 * v] > x[3 * best]))
            best = v;
        }
      }
    };
    visit(node);
    return best;
  };
  double mean = 0, most = 0;
  for (std::size_t k = 1; k < 6; ++k) {
    std::size_t changed = 0;
    for (std::uint32_t node = 0; node < topology.size(); ++node)
      for (std::size_t side = 0; side < 6; ++side)
        changed += realiser(k - 1, node, side) != realiser(k, node, side);
    const double share = double(changed) / (6.0 * topology.size());
    mean += share / 5;
    most = std::max(most, share);
  }
  const BodyCard card = cards(scene)[0];
  EXPECT_GT(card.sides_changed, 0);
  EXPECT_DOUBLE_EQ(card.sides_changed, mean);
  EXPECT_DOUBLE_EQ(card.most_sides_changed, most);
}

TEST(SceneCard, HashesSeeCurvesBetweenKeyframes) {
  const auto hash_of_mesh = [](const io::AnimatedMesh& mesh) { return card_hash(scene_of({mesh})); };
  const io::AnimatedMesh flight = scenes::thrown_cloth({.triangles = 50, .keyframes = 3});
  ASSERT_EQ(flight.bends.size(), 2u);
  io::AnimatedMesh lines = flight, bent = flight, twisted = flight, turned = flight;
  lines.bends.clear();
  bent.bends[1].bend[7] += 0.5;
  twisted.bends[0].twist[4] += 0.5;
  std::swap(turned.bends[0], turned.bends[1]);
  std::vector<std::uint64_t> hashes;
  for (const io::AnimatedMesh& mesh : std::vector<io::AnimatedMesh>{flight, lines, bent, twisted, turned}) {
    EXPECT_EQ(std::count(hashes.begin(), hashes.end(), hash_of_mesh(mesh)), 0);
    hashes.push_back(hash_of_mesh(mesh));
  }
}

// Folders of pictures that were written before keep their names.
TEST(SceneCard, HashesOfScenesWithoutCurvesAreThoseOfTheirKeyframes) {
  const LoadedScene scene = scene_of({scenes::random_soup(4, 3, 2)});
  const io::AnimatedMesh& mesh = scene.meshes[0];
  Hasher hasher;
  hasher.mix(std::uint64_t(scene.order));
  hasher.mix(hash_of(mesh.name));
  hasher.mix(std::uint64_t(mesh.kind));
  hasher.list(mesh.primitive_offsets);
  hasher.list(mesh.primitive_vertices);
  hasher.list(mesh.keyframe_times);
  hasher.list(mesh.positions);
  EXPECT_EQ(card_hash(scene), hasher.value());
}

TEST(LabScene, HoldsWhatTheSceneIs) {
  io::AnimatedMesh square;
  square.name = "square";
  square.vertex_count = 4;
  square.primitive_offsets = {0, 4};
  square.primitive_vertices = {0, 1, 2, 3};
  square.keyframe_times = {0.1};
  square.positions = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 1.0 / 3};
  LoadedScene scene = scene_of({scenes::random_soup(4, 3, 6), square});
  scene.self = {false, true};
  const nlohmann::json written = nlohmann::json::parse(lab_scene(scene, 7).dump());
  EXPECT_EQ(written.at("format"), "kbvh-scene");
  EXPECT_EQ(written.at("pairs"), nlohmann::json::parse("[[0, 1], [1, 1]]"));
  EXPECT_EQ(written.at("frames").at("l"), 7);
  const nlohmann::json &soup = written.at("bodies").at(0), &flat = written.at("bodies").at(1);
  EXPECT_EQ(soup.at("vertices"), 12);
  EXPECT_FALSE(soup.contains("offsets")) << "triangles need none";
  EXPECT_EQ(soup.at("times").size(), 6u);
  std::vector<double> positions;
  for (const auto& keyframe : soup.at("positions"))
    for (const auto& number : keyframe) positions.push_back(number);
  EXPECT_EQ(positions, scene.meshes[0].positions);
  EXPECT_EQ(flat.at("offsets"), nlohmann::json::parse("[0, 4]"));
  EXPECT_EQ(flat.at("positions").at(0).at(11), 1.0 / 3);
}

}  // namespace
}  // namespace kbvh::experiments::scene_card_test
