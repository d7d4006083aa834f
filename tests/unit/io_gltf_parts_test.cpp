// Parts of glTF files that are read on their own (points), skipped with a note, or refused with their name.
#include "io_gltf_fixture.hpp"

namespace kbvh::io::test::io_gltf_parts_test {
namespace {

using Ids = std::vector<std::uint32_t>;

class IoGltfParts : public IoTest {
 protected:
  AnimatedMesh load(const std::string& text) const {
    return load_animated_mesh({write("a.gltf", text), "", "", 0});
  }
};

std::string joined(const std::vector<std::string>& notes) {
  std::string text;
  for (const std::string& note : notes) text += note + "; ";
  return text;
}

GltfBuilder triangle() {
  GltfBuilder b;
  b.add<float>("VEC3", {0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 0, 0});  // 0: the last is a copy
  b.add<std::uint16_t>("SCALAR", {0, 1, 2});                   // 1
  b.add<float>("SCALAR", {0, 1});                              // 2
  b.add<float>("VEC3", {0, 0, 0, 0, 0, 5});                    // 3
  b.add<std::uint16_t>("SCALAR", {3, 1});                      // 4
  return b;
}

const std::string solid = R"({"attributes":{"POSITION":0},"indices":1})",
                  cloud = R"({"attributes":{"POSITION":0},"mode":0})",
                  part = R"({"attributes":{"POSITION":0},"mode":0,"indices":4})",
                  line = R"({"attributes":{"POSITION":0},"mode":3})";

std::string scene(const std::string& primitives, const std::string& more = "", const std::string& node = "") {
  return "\"nodes\":[{\"mesh\":0" + node + "}],\"meshes\":[{\"primitives\":[" + primitives + "]}]" + more;
}

std::string channel(const std::string& target) {
  return "{\"sampler\":0,\"target\":" + target + "}";
}

std::string animation(const std::string& channels) {
  return R"(,"animations":[{"name":"go","samplers":[{"input":2,"output":3}],"channels":[)" + channels + "]}]";
}

const std::string
    moves = channel(R"({"node":0,"path":"translation"})"),
    points_at =
        channel(R"({"path":"pointer","extensions":{"KHR_animation_pointer":{"pointer":"/nodes/0/scale"}}})");

TEST_F(IoGltfParts, PointsWithoutTrianglesAreACloud) {
  const GltfBuilder b = triangle();
  const AnimatedMesh still = load(b.json(scene(cloud)));
  EXPECT_EQ(still.kind, MeshKind::points);
  EXPECT_EQ(still.vertex_count, 4u);  // points at the same place are two
  EXPECT_EQ(still.primitive_offsets, (Ids{0, 1, 2, 3, 4}));
  EXPECT_EQ(still.primitive_vertices, (Ids{0, 1, 2, 3}));
  EXPECT_EQ(still.welded_vertices, 0u);
  const AnimatedMesh moving = load(b.json(scene(part, animation(moves))));
  EXPECT_EQ(moving.positions, (std::vector<double>{1, 0, 0, 1, 0, 0, 1, 0, 5, 1, 0, 5}));
  EXPECT_EQ(moving.primitive_vertices,
            (Ids{1, 0}));  // according to its indices, without vertices that are not points
  const AnimatedMesh beside = load(b.json(scene(solid + "," + cloud + "," + line)));
  EXPECT_EQ(beside.kind, MeshKind::polygons);
  EXPECT_EQ(beside.vertex_count, 3u);
  expect_words(joined(beside.notes), {"skipped 1 primitive of points", "skipped 1 primitive of lines"});
  expect_words(joined(load(b.json(scene(cloud + "," + line))).notes), {"skipped 1 primitive of lines"});
  expect_words(error_of(write("l.gltf", b.json(scene(line)))), {"l.gltf", "no triangles and no points"});
}

TEST_F(IoGltfParts, InstancesAreNoted) {
  const GltfBuilder b = triangle();
  const AnimatedMesh mesh =
      load(b.json(scene(solid, R"(,"extensionsUsed":["EXT_mesh_gpu_instancing"])",
                        R"(,"extensions":{"EXT_mesh_gpu_instancing":{"attributes":{"TRANSLATION":3}}})")));
  EXPECT_EQ(mesh.primitive_count(), 1u);
  ASSERT_EQ(mesh.notes.size(), 1u);
  expect_words(mesh.notes[0], {"nodes[0]", "EXT_mesh_gpu_instancing", "once"});
  expect_words(
      error_of(write("r.gltf", b.json(scene(solid, R"(,"extensionsRequired":["EXT_mesh_gpu_instancing"])")))),
      {"r.gltf", "extensionsRequired[0]", "EXT_mesh_gpu_instancing"});
  EXPECT_TRUE(
      load(b.json(scene(solid, R"(,"extensionsUsed":["KHR_materials_unlit","KHR_mesh_quantization"])")))
          .notes.empty());
  expect_words(joined(load(b.json(scene(solid, R"(,"extensionsUsed":["CESIUM_RTC"])"))).notes),
               {"'CESIUM_RTC'"});
}

TEST_F(IoGltfParts, ChannelsThatMoveNoNodeAreCounted) {
  const GltfBuilder b = triangle();
  expect_words(error_of(write("p.gltf", b.json(scene(solid, animation(points_at))))),
               {"p.gltf", "'go'", "moves no node", "1 channel", "KHR_animation_pointer"});
  const AnimatedMesh mesh = load(b.json(scene(solid, animation(moves + "," + points_at))));
  EXPECT_TRUE(mesh.moving());
  expect_words(joined(mesh.notes), {"'go'", "1 channel", "KHR_animation_pointer", "skipped"});
  EXPECT_TRUE(load(b.json(scene(solid, animation(moves)))).notes.empty());
}

TEST_F(IoGltfParts, BytesBehindTheEndAreNoted) {
  const GltfBuilder b = triangle();
  const std::string good = b.glb(scene(solid));
  EXPECT_TRUE(load_animated_mesh({write("a.glb", good), "", "", 0}).notes.empty());
  expect_words(joined(load_animated_mesh({write("a.glb", good + "1234"), "", "", 0}).notes),
               {"4 bytes beyond"});
}

TEST_F(IoGltfParts, FallbackBuffersAreNamed) {
  const std::string good = triangle().json(scene(solid));
  for (const std::string name : {"EXT_meshopt_compression", "KHR_meshopt_compression"}) {
    std::string text = good;
    const std::string empty = R"({"byteLength":96,"extensions":{")" + name + R"(":{"fallback":true}}})";
    text.insert(text.find("\"buffers\":[") + 11, empty + ",");
    expect_words(error_of(write("m.gltf", text)), {"m.gltf", "buffers[0]", "fallback", name, "compressed"});
  }
}

}  // namespace
}  // namespace kbvh::io::test::io_gltf_parts_test
