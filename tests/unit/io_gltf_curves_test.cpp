// The motion of a glTF animation between its keys: turns, splines and steps, followed by keyframes on
// straight lines.
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "experiments/io/gltf.hpp"
#include "experiments/io/keyframe_times.hpp"
#include "io_gltf_fixture.hpp"

namespace kbvh::io::test::io_gltf_curves_test {
namespace {

class IoGltfCurves : public IoTest {
 protected:
  /// A triangle under one node, moved by one sampler.
  fs::path moved(const std::string& path, const std::string& type, const std::string& interpolation,
                 const std::vector<float>& times, const std::vector<float>& values) const {
    GltfBuilder b;
    b.add<float>("VEC3", {0, 0, 0, 1, 0, 0, 0, 1, 0});
    b.add<float>("SCALAR", times);
    b.add<float>(type, values);
    return write("c.gltf",
                 b.json(R"("nodes":[{"mesh":0}],"meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],
"animations":[{"samplers":[{"input":1,"output":2,"interpolation":")" +
                        interpolation + R"("}],"channels":[{"sampler":0,"target":{"node":0,"path":")" + path +
                        R"("}}]}])"));
  }
};

/// The position of a vertex on the straight lines between keyframes.
std::array<double, 3> on_lines(const AnimatedMesh& mesh, std::size_t vertex, double t) {
  const auto& times = mesh.keyframe_times;
  const auto above = std::upper_bound(times.begin(), times.end(), t);
  const std::size_t k = above == times.begin() ? 0 : std::size_t(above - times.begin()) - 1;
  const std::size_t next = std::min(k + 1, times.size() - 1);
  const double u = next == k ? 0 : (t - times[k]) / (times[next] - times[k]);
  std::array<double, 3> p;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto at = [&](std::size_t frame) {
      return mesh.positions[3 * (frame * mesh.vertex_count + vertex) + axis];
    };
    p[axis] = (1 - u) * at(k) + u * at(next);
  }
  return p;
}

double diagonal(const AnimatedMesh& mesh) {
  std::array<double, 3> low{1e300, 1e300, 1e300}, high{-1e300, -1e300, -1e300};
  for (std::size_t i = 0; i < std::size_t{3} * mesh.vertex_count; ++i) {
    low[i % 3] = std::min(low[i % 3], mesh.positions[i]);
    high[i % 3] = std::max(high[i % 3], mesh.positions[i]);
  }
  return std::hypot(high[0] - low[0], high[1] - low[1], high[2] - low[2]);
}

/// Returns how far the lines are from the animation itself at many times, in diagonals of the body.
double furthest(const fs::path& file, const AnimatedMesh& mesh) {
  std::vector<double> times;
  const double first = mesh.keyframe_times.front(), last = mesh.keyframe_times.back();
  for (int i = 0; i <= 3000; ++i) times.push_back(first + (last - first) * i / 3000);
  const AnimatedMesh truth = read_gltf(file, "", times);
  EXPECT_EQ(truth.vertex_count, mesh.vertex_count);
  double most = 0;
  for (std::size_t f = 0; f < times.size(); ++f)
    for (std::size_t v = 0; v < mesh.vertex_count; ++v) {
      const auto p = on_lines(mesh, v, times[f]);
      const double* q = &truth.positions[3 * (f * truth.vertex_count + v)];
      most = std::max(most, std::hypot(p[0] - q[0], p[1] - q[1], p[2] - q[2]));
    }
  return most / diagonal(mesh);
}

TEST_F(IoGltfCurves, AHalfTurnIsATurn) {
  const fs::path file = moved("rotation", "VEC4", "LINEAR", {0, 1}, {0, 0, 0, 1, 0, 0, 1, 0});
  const AnimatedMesh mesh = load_animated_mesh({file, "", "", 0});
  EXPECT_GT(mesh.added_keyframes, 10u);
  EXPECT_LT(mesh.added_keyframes, 100u);
  EXPECT_EQ(mesh.keyframe_times.size(), 2 + mesh.added_keyframes);
  EXPECT_LE(furthest(file, mesh), gltf_tolerance);
  // On the way the corner at (1, 0, 0) stays on its circle; a straight line would lead through the centre.
  const auto middle = on_lines(mesh, 1, 0.5);
  EXPECT_NEAR(std::hypot(middle[0], middle[1]), 1, 2e-3);
}

TEST_F(IoGltfCurves, ASplineIsASpline) {
  // From 0 to 0 in one second, away by the tangents: at the keys alone nothing would move.
  const fs::path file = moved("translation", "VEC3", "CUBICSPLINE", {0, 1},
                              {0, 0, 0, 0, 0, 0, 8, 0, 0, 8, 0, 0, 0, 0, 0, 0, 0, 0});
  const AnimatedMesh mesh = load_animated_mesh({file, "", "", 0});
  EXPECT_GT(mesh.added_keyframes, 3u);
  EXPECT_LE(furthest(file, mesh), gltf_tolerance);
  const double high = on_lines(mesh, 0, 0.21)[0];
  EXPECT_GT(high, 0.7);
}

TEST_F(IoGltfCurves, AStepIsAJump) {
  const fs::path file =
      moved("translation", "VEC3", "STEP", {0, 1, 2, 3}, {0, 0, 0, 0, 0, 10, 0, 0, 10, 0, 0, 0});
  const AnimatedMesh mesh = load_animated_mesh({file, "", "", 0});
  const double before_1 = std::nextafter(1.0, 0.0), before_3 = std::nextafter(3.0, 0.0);
  EXPECT_EQ(mesh.keyframe_times, (std::vector<double>{0, before_1, 1, 2, before_3, 3}));
  EXPECT_EQ(mesh.jumps, 2u);
  EXPECT_EQ(mesh.added_keyframes, 0u);
  for (const double t : {0.0, 0.3, 0.999, before_1, 3.0}) EXPECT_EQ(on_lines(mesh, 0, t)[2], 0) << t;
  for (const double t : {1.0, 1.5, 2.0, before_3}) EXPECT_EQ(on_lines(mesh, 0, t)[2], 10) << t;
}

// A body that unfolds is not measured by its initial size of a point.
TEST_F(IoGltfCurves, TheToleranceIsOfTheLargestKey) {
  const auto keyframes = [&](float first) {
    const AnimatedMesh mesh = load_animated_mesh(
        {moved("scale", "VEC3", "CUBICSPLINE", {0, 1, 2},
               {0, 0, 0, first, first, first, 1, 1, 1, 0, 0, 0, 1, 1, 1, 0, 0, 0, 0, 0, 0, 2, 2, 2, 0, 0, 0}),
         "", "", 0});
    return mesh.keyframe_times.size();
  };
  EXPECT_GT(keyframes(1), 5u);
  EXPECT_LT(keyframes(1), 40u);
  for (const float first : {0.0f, 1e-9f, 1e-4f, 0.1f}) EXPECT_LT(keyframes(first), 50u) << first;
}

TEST_F(IoGltfCurves, StraightMotionNeedsNoMore) {
  const AnimatedMesh line = load_animated_mesh(
      {moved("translation", "VEC3", "LINEAR", {0, 1, 4}, {0, 0, 0, 5, 0, 0, 0, 7, 0}), "", "", 0});
  EXPECT_EQ(line.keyframe_times, (std::vector<double>{0, 1, 4}));
  const AnimatedMesh grown =
      load_animated_mesh({moved("scale", "VEC3", "LINEAR", {0, 1}, {0, 0, 0, 5, 5, 5}), "", "", 0});
  EXPECT_EQ(grown.keyframe_times, (std::vector<double>{0, 1}));
  const AnimatedMesh held =
      load_animated_mesh({moved("scale", "VEC3", "STEP", {0, 1}, {5, 5, 5, 5, 5, 5}), "", "", 0});
  EXPECT_EQ(held.keyframe_times, (std::vector<double>{0, 1}));
  EXPECT_EQ(held.jumps, 0u);
}

TEST_F(IoGltfCurves, WhatTurnsTooFastIsRefused) {
  expect_words(error_of(moved("translation", "VEC3", "CUBICSPLINE", {0, 1},
                              {0, 0, 0, 0, 0, 0, 1e12f, 0, 0, 1e12f, 0, 0, 0, 0, 0, 0, 0, 0})),
               {"c.gltf", "4096 keyframes"});
}

// Two nodes, one below the other, that turn and move, a skin, random keys: never further away than promised.
TEST_F(IoGltfCurves, RandomAnimationsAreFollowed) {
  std::mt19937 random(7);
  const auto unit = [&] { return float(random() % 2001) / 1000 - 1; };
  const std::vector<std::string> kinds{"LINEAR", "CUBICSPLINE", "STEP"};
  for (int round = 0; round < 30; ++round) {
    const std::string kind = kinds[random() % 3];
    const std::size_t keys = 2 + random() % 4, parts = kind == "CUBICSPLINE" ? 3 : 1;
    GltfBuilder b = BendingStrip().builder;
    std::vector<float> times, turns, ways;
    for (std::size_t k = 0; k < keys; ++k) {
      times.push_back((k == 0 ? 0 : times.back()) + 0.1f + float(random() % 10) / 10);
      for (std::size_t part = 0; part < parts; ++part) {
        const bool value = parts == 1 || part == 1;
        for (int i = 0; i < 4; ++i) turns.push_back(unit() + (i == 3 && value ? 1.5f : 0));
        for (int i = 0; i < 3; ++i) ways.push_back(unit());
      }
    }
    b.add<float>("SCALAR", times);  // 9
    b.add<float>("VEC4", turns);    // 10
    b.add<float>("VEC3", ways);     // 11
    std::string body = BendingStrip().body;
    body.replace(body.find("\"animations\""), std::string::npos,
                 R"("animations":[{"samplers":[{"input":9,"output":10,"interpolation":")" + kind +
                     R"("},{"input":9,"output":11,"interpolation":")" + kind +
                     R"("}],"channels":[{"sampler":0,"target":{"node":1,"path":"rotation"}},
{"sampler":0,"target":{"node":2,"path":"rotation"}}]}])");
    const fs::path file = write("r.gltf", b.json(body));
    const AnimatedMesh mesh = load_animated_mesh({file, "", "", 0});
    EXPECT_EQ(mesh.keyframe_times.size(), keys + mesh.added_keyframes + mesh.jumps);
    if (kind != "STEP") {
      EXPECT_LE(furthest(file, mesh), 1.2 * gltf_tolerance) << "round " << round << ", " << kind;
    }
    for (std::size_t k = 1; k < mesh.keyframe_times.size(); ++k)
      ASSERT_LT(mesh.keyframe_times[k - 1], mesh.keyframe_times[k]);
  }
}

TEST(KeyframeTimes, JumpsOfNeighbouringDoubles) {
  const double next = std::nextafter(1.0, 2.0);
  const CurvedMotion motion{{0, 1, next}, {1, next}, [&](double t, std::vector<double>& out) {
                              out = {t < 1 ? 0.0 : t < next ? 1.0 : 2.0, 0, 0};
                            }};
  const auto found = follow(motion, 1e-3, 100);
  ASSERT_TRUE(found);
  EXPECT_EQ(found->times, (std::vector<double>{0, std::nextafter(1.0, 0.0), 1, next}));
  EXPECT_EQ(found->jumps, 2u);
  EXPECT_FALSE(follow(motion, 1e-3, 2));
}

}  // namespace
}  // namespace kbvh::io::test::io_gltf_curves_test
