// Real files: every sequence, scene and glTF of the shared data folder loads, and the results of baking equal
// the point caches that others baked from the same glTF files.
#include <array>
#include <cmath>
#include <map>
#include <unordered_map>

#include "experiments/io/gltf.hpp"
#include "io_test_support.hpp"

namespace kbvh::io::test::io_data_test {
namespace {

struct Counts {
  std::uint32_t vertices;
  std::size_t primitives, keyframes;
};

TEST(IoData, EverySequenceAndSceneLoads) {
  KBVH_NEED_DATA();
  const std::map<std::string, Counts> expected{
      {"sequences/diffcloth-tshirt-iter0/mesh", {1426, 2745, 251}},
      {"sequences/codimipc-Rumba_Dancing/mesh", {12811, 25472, 121}},
      {"sequences/mannequiny-run/mesh", {7138, 13832, 30}},
      {"sequences/robot-Dance/mesh", {1820, 3234, 80}},
      {"sequences/MorphStressTest/mesh", {1224, 2412, 224}},
      {"sequences/AnimatedMorphSphere/mesh", {482, 960, 216}},
      {"blender/tablecloth-2k/cloth", {1089, 2048, 100}},
      {"blender/tablecloth-2k/table", {960, 1916, 1}},
      {"blender/tablecloth-16k/cloth", {8281, 16200, 121}},
      {"blender/tablecloth-16k/table", {960, 1916, 1}},
      {"blender/dancer-skirt/skirt", {4704, 9216, 121}},
      {"blender/dancer-skirt/hip", {738, 1472, 121}},
      {"blender/dancer-skirt/leg_l", {738, 1472, 121}},
      {"blender/dancer-skirt/leg_r", {738, 1472, 121}},
  };
  for (const auto& [name, counts] : expected) {
    SCOPED_TRACE(name);
    const fs::path stem = data_folder() / name;
    const fs::path motion =
        stem.filename() == "mesh" ? stem.parent_path() / "motion.pc2" : fs::path(stem) += ".pc2";
    const AnimatedMesh mesh =
        load_animated_mesh({fs::path(stem) += ".obj", fs::exists(motion) ? motion : fs::path(), "", 25});
    EXPECT_EQ(mesh.vertex_count, counts.vertices);
    EXPECT_EQ(mesh.primitive_count(), counts.primitives);
    ASSERT_EQ(mesh.keyframe_times.size(), counts.keyframes);
    EXPECT_EQ(mesh.degenerate_primitives, 0u);
    EXPECT_EQ(mesh.merged_keyframes, 0u);
    EXPECT_DOUBLE_EQ(mesh.keyframe_times.back(), static_cast<double>(counts.keyframes - 1) / 25);
  }
}

TEST(IoData, FirstSampleIsTheMeshOfItsObj) {
  KBVH_NEED_DATA();
  for (const char* name :
       {"robot-Dance", "MorphStressTest", "codimipc-Rumba_Dancing", "diffcloth-tshirt-iter0"}) {
    SCOPED_TRACE(name);
    const fs::path folder = data_folder() / "sequences" / name;
    const AnimatedMesh still = load_animated_mesh({folder / "mesh.obj", "", "", 0});
    const AnimatedMesh moving = load_animated_mesh({folder / "mesh.obj", folder / "motion.pc2", "", 0});
    for (std::size_t i = 0; i < still.positions.size(); ++i) {
      // The OBJ has nine digits, which name a float uniquely.
      ASSERT_EQ(static_cast<float>(still.positions[i]), static_cast<float>(moving.positions[i])) << i;
    }
  }
}

TEST(IoData, PlyFramesOfBothByteOrders) {
  KBVH_NEED_DATA();
  const AnimatedMesh ball = load_animated_mesh({data_folder() / "ccd/frames/cloth-ball/frames", "", "", 0});
  EXPECT_EQ(ball.vertex_count, 46598u);
  EXPECT_EQ(ball.primitive_count(), 92230u);
  EXPECT_EQ(ball.keyframe_times, (std::vector<double>{0, 1.0 / 30}));
  const AnimatedMesh rod = load_animated_mesh({data_folder() / "ccd/frames/rod-twist/frames", "", "", 0});
  EXPECT_EQ(rod.vertex_count, 39940u);
  EXPECT_EQ(rod.primitive_count(), 79864u);
  double largest = 0;
  for (double x : ball.positions) largest = std::max(largest, std::abs(x));
  EXPECT_LT(largest, 100);  // the wrong byte order would give absurd numbers
  EXPECT_GT(largest, 0.1);
}

TEST(IoData, EveryClipOfEveryGltfLoads) {
  KBVH_NEED_DATA();
  const std::map<std::string, int> clips{{"AnimatedMorphSphere.glb", 1},
                                         {"Fox.glb", 3},
                                         {"MorphStressTest.gltf", 3},
                                         {"mannequiny.glb", 10},
                                         {"robot.glb", 14}};
  for (const auto& [name, count] : clips) {
    for (int clip = 0; clip < count; ++clip) {
      SCOPED_TRACE(name + " " + std::to_string(clip));
      const AnimatedMesh mesh =
          load_animated_mesh({data_folder() / "gltf" / name, "", std::to_string(clip), 0});
      EXPECT_TRUE(mesh.moving());
      EXPECT_GT(mesh.primitive_count(), 500u);
    }
  }
  const std::string message = error_of(LoadRequest{data_folder() / "gltf/Fox.glb", "", "", 0});
  expect_words(message, {"Fox.glb", "3 animations", "0 'Survey'", "1 'Walk'", "2 'Run'"});
  expect_words(error_of(LoadRequest{data_folder() / "gltf/Fox.glb", "", "Fly", 0}),
               {"Fox.glb", "'Fly'", "'Walk'"});
}

/// Matches the vertices of two meshes with equal keyframe counts by their whole trajectories, in any order.
/// Returns the number of vertices without a partner within `tolerance`, and the largest distance among the
/// pairs.
std::pair<std::size_t, double> match(const AnimatedMesh& a, const AnimatedMesh& b, double tolerance) {
  const double cell = 2 * tolerance;
  const auto key = [&](const double* p, int dx, int dy, int dz) {
    const auto at = [&](int axis, int d) { return static_cast<long>(std::floor(p[axis] / cell)) + d; };
    return static_cast<std::size_t>(at(0, dx)) * 73856093u ^ static_cast<std::size_t>(at(1, dy)) * 19349663u ^
           static_cast<std::size_t>(at(2, dz)) * 83492791u;
  };
  std::unordered_multimap<std::size_t, std::uint32_t> grid;
  for (std::uint32_t v = 0; v < b.vertex_count; ++v) grid.emplace(key(&b.positions[3 * v], 0, 0, 0), v);
  const auto distance = [&](std::uint32_t va, std::uint32_t vb) {
    double largest = 0;
    for (std::size_t k = 0; k < a.keyframe_times.size(); ++k) {
      const double* p = &a.positions[3 * (k * a.vertex_count + va)];
      const double* q = &b.positions[3 * (k * b.vertex_count + vb)];
      for (int i = 0; i < 3; ++i) largest = std::max(largest, std::abs(p[i] - q[i]));
    }
    return largest;
  };
  std::vector<bool> taken(b.vertex_count, false);
  std::size_t alone = 0;
  double worst = 0;
  for (std::uint32_t v = 0; v < a.vertex_count; ++v) {
    double best = tolerance;
    std::uint32_t partner = b.vertex_count;
    for (int n = 0; n < 27; ++n) {
      const auto [begin, end] =
          grid.equal_range(key(&a.positions[3 * v], n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1));
      for (auto it = begin; it != end; ++it) {
        if (taken[it->second]) continue;
        const double d = distance(v, it->second);
        if (d < best) best = d, partner = it->second;
      }
    }
    if (partner == b.vertex_count) {
      ++alone;
    } else {
      taken[partner] = true;
      worst = std::max(worst, best);
    }
  }
  return {alone, worst};
}

TEST(IoData, BakedGltfEqualsThePointCachesMadeElsewhere) {
  KBVH_NEED_DATA();
  struct Case {
    const char *gltf, *clip, *sequence;
    double frames_per_second;
  };
  for (const Case& c : {Case{"robot.glb", "Robot_Dance", "robot-Dance", 24},
                        Case{"mannequiny.glb", "run_root.001", "mannequiny-run", 48},
                        Case{"MorphStressTest.gltf", "Individuals", "MorphStressTest", 24},
                        Case{"AnimatedMorphSphere.glb", "Globe", "AnimatedMorphSphere", 30}}) {
    SCOPED_TRACE(c.sequence);
    const fs::path folder = data_folder() / "sequences" / c.sequence;
    const AnimatedMesh cache =
        load_animated_mesh({folder / "mesh.obj", folder / "motion.pc2", "", c.frames_per_second});
    const AnimatedMesh baked = read_gltf(data_folder() / "gltf" / c.gltf, c.clip, cache.keyframe_times);
    EXPECT_EQ(baked.vertex_count, cache.vertex_count);  // so the welding agrees too
    const auto [alone, worst] = match(baked, cache, 1e-4);
    EXPECT_EQ(alone, 0u);
    EXPECT_LT(worst, 1e-4);
    RecordProperty(std::string(c.sequence) + "_worst", std::to_string(worst));
  }
}

TEST(IoData, KeyTimesOfTheFileAreKeyframes) {
  KBVH_NEED_DATA();
  const AnimatedMesh robot = load_animated_mesh({data_folder() / "gltf/robot.glb", "", "Robot_Dance", 0});
  EXPECT_EQ(robot.keyframe_times.size(), 81 + robot.added_keyframes);
  EXPECT_LT(robot.added_keyframes, 100u);  // its arms swing fast
  EXPECT_EQ(robot.jumps, 0u);
  EXPECT_EQ(robot.primitive_count(), 3238u);   // the point cache's 3,234 and
  EXPECT_EQ(robot.degenerate_primitives, 4u);  // the 4 that its maker dropped
  const AnimatedMesh same = read_gltf(data_folder() / "gltf/robot.glb", "0", robot.keyframe_times);
  EXPECT_EQ(robot.positions, same.positions);
}

}  // namespace
}  // namespace kbvh::io::test::io_data_test
