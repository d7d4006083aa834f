// Bodies whose vertices move on curves: thrown ones follow their physics at any number of keyframes, Hermite
// keyframes have no jump of velocity, and curves follow placements and orders of vertices.

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "experiments/scenes/curves.hpp"
#include "experiments/scenes/placement.hpp"
#include "experiments/scenes/scene_spec.hpp"
#include "experiments/scenes/shapes.hpp"
#include "tests/support/mesh_checks.hpp"

namespace kbvh::experiments::curved_bodies_test {
namespace {

LoadedScene loaded(const std::string& name, std::uint32_t triangles, std::uint32_t keyframes,
                   std::uint64_t seed = 1) {
  SceneSpec spec;
  spec.builtin = name;
  spec.options = {.triangles = triangles, .seed = seed, .keyframes = keyframes};
  return load(spec);
}

template <class S>
std::vector<S> positions_at(const FlightPlans<S>& plans, double t) {
  std::vector<S> out(std::size_t(3) * plans.vertex_count());
  plans.evaluate(t, out.data());
  return out;
}

template <class S>
double farthest(const std::vector<S>& a, const std::vector<S>& b) {
  double most = 0;
  for (std::size_t i = 0; i < a.size(); ++i) most = std::max(most, std::abs(double(a[i]) - double(b[i])));
  return most;
}

TEST(CurvedBodies, AreSoundAtEverySize) {
  for (const std::string name : {"thrown_cloth", "thrown_shards"})
    for (const std::uint32_t triangles : {1u, 20u, 2000u})
      for (const std::uint32_t keyframes : {2u, 13u}) {
        const LoadedScene scene = loaded(name, triangles, keyframes);
        for (const io::AnimatedMesh& mesh : scene.meshes)
          test::expect_sound(mesh, mesh.moving() ? keyframes : 1);
        const Scene<float> in_float = assemble<float>(scene);
        EXPECT_TRUE(in_float.bodies[0].plans.curved());
        EXPECT_FALSE(in_float.bodies[1].plans.curved());
        // Float and double hold the same numbers.
        const Scene<double> in_double = assemble<double>(scene);
        EXPECT_LT(farthest(positions_at(in_double.bodies[0].plans, 0.7), std::vector<double>([&] {
                             const auto values = positions_at(in_float.bodies[0].plans, 0.7);
                             return std::vector<double>(values.begin(), values.end());
                           }())),
                  1e-6);
      }
  EXPECT_NE(loaded("thrown_shards", 100, 3).meshes[0].positions,
            loaded("thrown_shards", 100, 3, 2).meshes[0].positions);
}

// The same flight, however many keyframes cut it.
TEST(CurvedBodies, FlightsDoNotDependOnKeyframes) {
  for (const std::string name : {"thrown_cloth", "thrown_shards"}) {
    const FlightPlans<double> whole = assemble<double>(loaded(name, 200, 2)).bodies[0].plans,
                              fine = assemble<double>(loaded(name, 200, 41)).bodies[0].plans;
    for (const double t : {0.0, 0.3, 0.775, 1.0, 1.99, 2.0})
      EXPECT_LT(farthest(positions_at(whole, t), positions_at(fine, t)), 1e-5) << name << " at " << t;
    // Chords alone would be far off.
    EXPECT_GT(farthest(positions_at(whole, 1.0), positions_at(whole, 0.0)), 4) << name;
  }
}

/// Returns the velocity of a curve at its start, or at its end.
double velocity(const CurvedPiece<double>& piece, bool at_end) {
  const double way = piece.x1 - piece.x0;
  return (at_end ? way - piece.bend - piece.twist : way + piece.bend) / (piece.t1 - piece.t0);
}

TEST(CurvedBodies, SmoothMotionHasNoJumpOfVelocity) {
  io::AnimatedMesh mesh = scenes::waving_sheet(200, 7);
  const io::AnimatedMesh before = mesh;
  mesh.keyframe_times = {0, 0.1, 0.15, 0.3, 0.5, 0.55, 0.8};
  scenes::smooth(mesh);
  EXPECT_EQ(mesh.positions, before.positions);
  ASSERT_EQ(mesh.bends.size(), 6u);
  const std::size_t scalars = std::size_t(3) * mesh.vertex_count;
  double bent = 0;
  for (std::size_t i = 0; i < scalars; ++i)
    for (std::size_t k = 1; k < 6; ++k) {
      const auto piece = [&](std::size_t segment) {
        return CurvedPiece<double>{
            mesh.keyframe_times[segment],          mesh.keyframe_times[segment + 1],
            mesh.positions[segment * scalars + i], mesh.positions[(segment + 1) * scalars + i],
            mesh.bends[segment].bend[i],           mesh.bends[segment].twist[i]};
      };
      EXPECT_NEAR(velocity(piece(k - 1), true), velocity(piece(k), false), 1e-5);
      bent = std::max(bent, std::abs(mesh.bends[k].bend[i]));
    }
  EXPECT_GT(bent, 1e-3);
  // A constant velocity stays one, and parabolas are met exactly.
  io::AnimatedMesh straight =
      scenes::translated(scenes::snapped(scenes::sheet(8, {0, 0, 0}, 1), 4), {0.5, 0, 0.25}, 4, 2);
  scenes::smooth(straight);
  for (const auto& segment : straight.bends)
    for (const auto* values : {&segment.bend, &segment.twist})
      for (const double value : *values) EXPECT_EQ(value, 0);
  io::AnimatedMesh two = scenes::waving_sheet(8, 2);
  scenes::smooth(two);
  EXPECT_TRUE(two.bends.empty());
  // Given curves are replaced, whatever the number of keyframes.
  io::AnimatedMesh thrown = scenes::thrown_cloth({.triangles = 8, .keyframes = 2});
  ASSERT_FALSE(thrown.bends.empty());
  scenes::smooth(thrown);
  EXPECT_TRUE(thrown.bends.empty());
}

TEST(CurvedBodies, CurvesFollowPlacementsAndOrders) {
  const LoadedScene scene = loaded("thrown_cloth", 50, 4);
  LoadedScene placed = scene, shuffled = scene;
  Placement placement;
  placement.scale = -2;
  placement.rotations.push_back({{1, 2, 3}, 40});
  placement.translate[1] = 5;
  place(placed.meshes[0], placement);
  shuffle_vertices(shuffled.meshes[0], 3);
  const FlightPlans<double> plans = assemble<double>(scene).bodies[0].plans;
  // Positions in the middle of a segment, placed as vertices at rest are.
  for (const double t : {0.2, 1.0, 1.9}) {
    io::AnimatedMesh still = scene.meshes[0];
    still.keyframe_times = {0};
    still.bends.clear();
    still.positions = positions_at(plans, t);
    io::AnimatedMesh mixed = still;
    place(still, placement);
    EXPECT_LT(farthest(positions_at(assemble<double>(placed).bodies[0].plans, t), still.positions), 1e-12);
    shuffle_vertices(mixed, 3);
    EXPECT_LT(farthest(positions_at(assemble<double>(shuffled).bodies[0].plans, t), mixed.positions), 1e-14);
  }
}

TEST(CurvedBodies, BodiesAskForSmoothCurves) {
  const auto scene = [](const std::string& body) {
    return load(read_scenes(nlohmann::json{{"bodies", {body, "sphere:triangles=20"}}}, "scene", {})[0]);
  };
  const auto names = scene("waving_sheet:triangles=8,keyframes=4,curves=smooth");
  EXPECT_TRUE(assemble<float>(names).bodies[0].plans.curved());
  EXPECT_FALSE(
      assemble<float>(scene("waving_sheet:triangles=8,keyframes=4,curves=lines")).bodies[0].plans.curved());
  try {
    scene("waving_sheet:triangles=8,curves=round");
    FAIL();
  } catch (const io::InputError& error) {
    EXPECT_NE(std::string(error.what()).find("expected given, lines or smooth, got 'round'"),
              std::string::npos);
  }
}

TEST(CurvedBodies, BuiltInScenesAreGivenStraightenedOrSmoothed) {
  const auto plans = [](const std::string& builtin, const std::string& curves) {
    nlohmann::json scene{{"builtin", builtin}, {"triangles", 8}, {"keyframes", 4}};
    if (!curves.empty()) scene["curves"] = curves;
    return assemble<double>(load(read_scenes(scene, "scene", {})[0])).bodies[0].plans;
  };
  const auto given = plans("thrown_shards", ""), lines = plans("thrown_shards", "lines");
  EXPECT_TRUE(given.curved());
  EXPECT_TRUE(plans("thrown_shards", "given").curved());
  EXPECT_FALSE(lines.curved());
  for (const double t : {0.0, 2.0 / 3, 2.0}) EXPECT_EQ(positions_at(given, t), positions_at(lines, t)) << t;
  EXPECT_NE(positions_at(given, 0.25), positions_at(lines, 0.25));
  EXPECT_FALSE(plans("waving_sheet", "").curved());
  EXPECT_TRUE(plans("waving_sheet", "smooth").curved());
  EXPECT_THROW(plans("waving_sheet", "round"), io::InputError);
  EXPECT_THROW(read_scenes({{"bodies", {"sphere:triangles=20"}}, {"curves", "lines"}}, "scene", {}),
               io::InputError);
}

}  // namespace
}  // namespace kbvh::experiments::curved_bodies_test
