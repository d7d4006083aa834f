// glTF files made by hand: skins, morph targets, interpolation, welding, accessor layouts, and the defects of
// bad files.
#include <cmath>

#include "experiments/io/gltf.hpp"
#include "io_gltf_fixture.hpp"

namespace kbvh::io::test::io_gltf_test {
namespace {

class IoGltf : public IoTest {
 protected:
  AnimatedMesh load(const std::string& text, const std::string& name = "a.gltf") const {
    return load_animated_mesh({write(name, text), "", "", 0});
  }
};

void expect_position(const AnimatedMesh& mesh, std::size_t keyframe, std::size_t vertex,
                     std::array<double, 3> p) {
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(mesh.positions[3 * (keyframe * mesh.vertex_count + vertex) + i], p[i], 1e-6)
        << "keyframe " << keyframe << ", vertex " << vertex << ", axis " << i;
  }
}

/// Returns the keyframes at these times.
std::vector<std::size_t> keyframes_at(const AnimatedMesh& mesh, const std::vector<double>& times) {
  std::vector<std::size_t> found;
  for (const double t : times) {
    const auto at = std::lower_bound(mesh.keyframe_times.begin(), mesh.keyframe_times.end(), t);
    if (at == mesh.keyframe_times.end() || *at != t) {
      ADD_FAILURE() << "no keyframe at " << t;
      return std::vector<std::size_t>(times.size(), 0);
    }
    found.push_back(std::size_t(at - mesh.keyframe_times.begin()));
  }
  return found;
}

TEST_F(IoGltf, SkinIsBakedAtTheUnionOfKeyTimesAndSeamsAreWelded) {
  const BendingStrip strip;
  for (const AnimatedMesh& mesh :
       {load(strip.builder.json(strip.body)), load(strip.builder.glb(strip.body), "a.glb")}) {
    const std::vector<std::size_t> keys = keyframes_at(mesh, {0.5, 1, 1.5});
    EXPECT_EQ(mesh.keyframe_times.size(), 3 + mesh.added_keyframes);
    ASSERT_EQ(mesh.vertex_count, 4u);
    EXPECT_EQ(mesh.primitive_vertices, (std::vector<std::uint32_t>{0, 1, 2, 1, 3, 2}));
    EXPECT_EQ(mesh.primitive_offsets, (std::vector<std::uint32_t>{0, 3, 6}));
    expect_position(mesh, keys[0], 2, {0, 2, 0});
    const double h = std::sqrt(0.5);
    expect_position(mesh, keys[1], 2, {-h, 1 + h, 0});  // half way round
    expect_position(mesh, keys[1], 3, {0, 1 + 2 * h, 0});
    expect_position(mesh, keys[2], 1, {11, 0, 0});  // the node's own transform does not move a skinned mesh
    expect_position(mesh, keys[2], 2, {9, 1, 0});
    expect_position(mesh, keys[2], 3, {9, 2, 0});
  }
}

TEST_F(IoGltf, StepHoldsAndCubicSplineCurves) {
  const BendingStrip step("STEP"), cubic("CUBICSPLINE");
  const AnimatedMesh jumping = load(step.builder.json(step.body)),
                     curved = load(cubic.builder.json(cubic.body));
  expect_position(jumping, keyframes_at(jumping, {1})[0], 2, {0, 2, 0});
  expect_position(jumping, keyframes_at(jumping, {1.5})[0], 2, {9, 1, 0});
  const double h = std::sqrt(0.5);
  expect_position(curved, keyframes_at(curved, {1})[0], 2,
                  {-h, 1 + h, 0});  // by symmetry, tangents being zero

  GltfBuilder b;
  b.add<float>("VEC3", {0, 0, 0, 1, 0, 0, 0, 1, 0});
  b.add<float>("SCALAR", {0, 2});
  b.add<float>("VEC3", {9, 9, 9, 0, 0, 0, 4, 0, 0, 0, 8, 0, 1, 1, 1, 9, 9, 9});  // in, value, out tangents
  const std::string body = R"("nodes":[{"mesh":0}],"meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],
"animations":[{"samplers":[{"input":1,"output":2,"interpolation":"CUBICSPLINE"}],
"channels":[{"sampler":0,"target":{"node":0,"path":"translation"}}]}])";
  const AnimatedMesh mesh = read_gltf(write("c.gltf", b.json(body)), "", {0, 1, 2, 5});
  // At the middle: (a + b) / 2 + span * (leaving - arriving) / 8, span 2.
  expect_position(mesh, 1, 0, {0.5 + 2 * 4 / 8.0, 0.5 - 2 * 8 / 8.0, 0.5});
  expect_position(mesh, 2, 0, {1, 1, 1});
  expect_position(mesh, 3, 0, {1, 1, 1});  // held beyond the end
}

TEST_F(IoGltf, MorphTargetsBelowAMovingParent) {
  GltfBuilder b;
  b.add<float>("VEC3", {0, 0, 0, 1, 0, 0, 0, 1, 0});
  b.add<float>("VEC3", {0, 0, 1, 0, 0, 1, 0, 0, 1});  // target 0; target 1 has no POSITION
  b.add<float>("SCALAR", {0, 1});
  b.add<std::uint8_t>("SCALAR", {0, 0, 255, 51}, ",\"normalized\":true");
  b.add<float>("VEC3", {1, 1, 1, 2, 3, 4});
  const AnimatedMesh mesh = load(b.json(
      R"("nodes":[{"children":[1],"translation":[0,0,5]},{"mesh":0}],"scenes":[{"nodes":[0]}],
"meshes":[{"weights":[0.5,0],"primitives":[{"attributes":{"POSITION":0},"targets":[{"POSITION":1},{}]}]}],
"animations":[{"samplers":[{"input":2,"output":3},{"input":2,"output":4}],"channels":[
{"sampler":0,"target":{"node":1,"path":"weights"}},{"sampler":1,"target":{"node":0,"path":"scale"}}]}])"));
  const std::size_t last = keyframes_at(mesh, {1})[0];  // weights times scale: a curve between
  EXPECT_GT(last, 1u);
  expect_position(mesh, 0, 1, {1, 0, 5});
  expect_position(mesh, last, 1, {2, 0, 5 + 4 * 1});
  expect_position(mesh, last, 2, {0, 3, 5 + 4 * 1});
}

TEST_F(IoGltf, WithoutAnimationTheFilesOwnPose) {
  GltfBuilder b;
  b.add<float>("VEC3", {0, 0, 0, 1, 0, 0, 0, 1, 0});
  b.add<float>("VEC3", {0, 0, 2, 0, 0, 2, 0, 0, 2});
  const AnimatedMesh mesh = load(b.json(
      R"("nodes":[{"mesh":0,"matrix":[0,1,0,0,-1,0,0,0,0,0,1,0,7,0,0,1]}],
"meshes":[{"weights":[0.5],"primitives":[{"attributes":{"POSITION":0},"targets":[{"POSITION":1}]}]}])"));
  EXPECT_FALSE(mesh.moving());
  EXPECT_EQ(mesh.keyframe_times, std::vector<double>{0});
  expect_position(mesh, 0, 1, {7, 1, 1});
}

TEST_F(IoGltf, StripsFansStridesSparseAndSmallIntegers) {
  GltfBuilder b;
  std::string interleaved;  // position, 4 bytes of something else, twice in one view
  for (float x : {0.f, 1.f, 2.f, 3.f, 4.f}) interleaved += bytes_of<float>({x, x * x, 0, 777});
  const int view = b.add_view(interleaved, ",\"byteStride\":16");
  b.add_accessor("{\"bufferView\":" + std::to_string(view) +
                 R"(,"componentType":5126,"type":"VEC3","count":5})");  // 0
  b.add<std::uint8_t>("SCALAR", {0, 1, 2, 3});                          // 1
  const int which = b.add_view(bytes_of<std::uint8_t>({2, 4})),
            what = b.add_view(bytes_of<float>({5, 5, 5, 6, 6, 6}));
  b.add_accessor(
      R"({"componentType":5126,"type":"VEC3","count":5,"sparse":{"count":2,"indices":{"bufferView":)" +
      std::to_string(which) + R"(,"componentType":5121},"values":{"bufferView":)" + std::to_string(what) +
      "}}}");                                                                                 // 2
  b.add<std::int16_t>("VEC3", {0, 0, 0, 32767, 0, 0, 0, -32768, 0}, ",\"normalized\":true");  // 3
  const AnimatedMesh mesh = load(b.json(
      R"("nodes":[{"mesh":0}],"meshes":[{"primitives":[
{"attributes":{"POSITION":0},"indices":1,"mode":5},{"attributes":{"POSITION":0},"indices":1,"mode":6},
{"attributes":{"POSITION":0},"mode":0},{"attributes":{"POSITION":2},"mode":5},{"attributes":{"POSITION":3}}]}])"));
  // Welding makes the strip and the fan share vertices 0..3, and the zeros of the others fall on vertex 0.
  ASSERT_EQ(mesh.vertex_count, 8u);  // 4, then (5,5,5), (6,6,6), then (1,0,0), (0,-1,0)
  const std::vector<std::uint32_t> expected{0, 1, 2, 2, 1, 3, 0, 1, 2, 0, 2, 3,
                                            0, 0, 4, 4, 0, 0, 4, 0, 5, 0, 6, 7};
  EXPECT_EQ(mesh.primitive_vertices, expected);
  EXPECT_EQ(mesh.degenerate_primitives, 3u);  // two with repeated vertices, one collinear
  expect_position(mesh, 0, 3, {3, 9, 0});
  expect_position(mesh, 0, 5, {6, 6, 6});
  expect_position(mesh, 0, 7, {0, -1, 0});
}

TEST_F(IoGltf, WhatMovesApartIsNotWelded) {
  GltfBuilder b;
  b.add<float>("VEC3", {0, 0, 0, 1, 0, 0, 0, 1, 0});
  b.add<float>("SCALAR", {0, 1});
  b.add<float>("VEC3", {0, 0, 0, 0, 0, 1});
  const std::string body =
      R"("nodes":[{"mesh":0},{"mesh":0}],"meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}])";
  EXPECT_EQ(load(b.json(body)).vertex_count, 3u);
  EXPECT_EQ(load(b.json(body + R"(,"animations":[{"samplers":[{"input":1,"output":2}],
"channels":[{"sampler":0,"target":{"node":1,"path":"translation"}}]}])"))
                .vertex_count,
            6u);
}

TEST_F(IoGltf, UnweightedVerticesFollowTheirFirstJointAndWeightsAreScaled) {
  BendingStrip strip;
  strip.builder.add<float>("VEC4",
                           {0, 0, 0, 0, .5, 0, 0, 0, 2, 0, 0, 0, .5, 0, 0, 0, 0, 0, 0, 0, 2, 0, 0, 0});  // 9
  strip.body.replace(strip.body.find("\"WEIGHTS_0\":2"), 13, "\"WEIGHTS_0\":9");
  const AnimatedMesh mesh = load(strip.builder.json(strip.body));
  ASSERT_EQ(mesh.vertex_count, 4u);
  const std::size_t last = keyframes_at(mesh, {1.5})[0];
  expect_position(mesh, last, 0, {10, 0, 0});
  expect_position(mesh, last, 3, {9, 2, 0});
}

TEST_F(IoGltf, ABufferBesideTheFile) {
  const BendingStrip strip;
  write("sub/data 1.bin", strip.builder.buffer());
  EXPECT_EQ(load(strip.builder.json(strip.body, "sub/data%201.bin")).vertex_count, 4u);
  expect_words(error_of(write("b.gltf", strip.builder.json(strip.body, "missing.bin"))),
               {"missing.bin", "no such file"});
  write("short.bin", strip.builder.buffer().substr(0, 100));
  expect_words(error_of(write("b.gltf", strip.builder.json(strip.body, "short.bin"))),
               {"b.gltf", "buffers[0]", std::to_string(strip.builder.buffer().size()), "100"});
  for (const char* uri :
       {"../data.bin", "/etc/passwd", "http://localhost/x.bin", "sub/../../x.bin", "%2e%2e/x.bin", "C:x"}) {
    expect_words(error_of(write("b.gltf", strip.builder.json(strip.body, uri))),
                 {"b.gltf", "buffers[0].uri", "folder"});
  }
  expect_words(
      error_of(write("b.gltf", strip.builder.json(strip.body, "data:application/octet-stream;base64,AA*A"))),
      {"b.gltf", "buffers[0].uri", "character 2", "'*'"});
}

struct Fault {
  std::string from, to;
  std::vector<std::string> words;
};

TEST_F(IoGltf, EveryBrokenReferenceIsNamed) {
  const BendingStrip strip;
  const std::string good = strip.builder.json(strip.body);
  const std::vector<Fault> faults{
      {"\"version\":\"2.0\"", "\"version\":\"1.0\"", {"asset.version", "'1.0'"}},
      {"\"asset\":{\"version\":\"2.0\"},", "", {"'asset'"}},
      {"\"scene\":0", "\"scene\":3", {"scene", "3", "1 scenes"}},
      {"\"nodes\":[0,1]", "\"nodes\":[0,7]", {"scenes[0].nodes[1]", "7", "3 nodes"}},
      {"\"children\":[2]", "\"children\":[1]", {"nodes[1]", "its own ancestor"}},
      {"\"translation\":[0,1,0]}", "\"children\":[2]}", {"nodes[2]", "child of both"}},
      {"\"translation\":[0,1,0]}", "\"translation\":[0,1]}", {"nodes[2].translation", "2 numbers", "3"}},
      {"\"translation\":[0,1,0]}", "\"translation\":[0,1,1e999]}", {"JSON", "1e999"}},
      {"\"translation\":[0,1,0]}", "\"translation\":[0,1e31,0]}", {"keyframe 0, vertex 2", "y", "1e+31"}},
      {"\"translation\":[0,1,0]}", "\"rotation\":[0,0,0,0]}", {"nodes[2].rotation", "length 0"}},
      {"\"translation\":[0,1,0]}",
       "\"matrix\":[1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1]}",
       {"channels[0]", "nodes[2]", "matrix"}},
      {"\"mesh\":0", "\"mesh\":-1", {"nodes[0].mesh", "-1"}},
      {"\"skin\":0", "\"skin\":1", {"nodes[0].skin", "1", "1 skins"}},
      {"\"POSITION\":0", "\"POSITION\":40", {"primitives[0].attributes.POSITION", "40", "9 accessors"}},
      {"\"POSITION\":0", "\"POSITION\":3", {"accessors[3]", "1 components", "3"}},
      {"\"POSITION\":0,", "", {"primitives[0].attributes", "POSITION"}},
      {"\"POSITION\":0", "\"POSITION\":\"x\"", {"attributes.POSITION", "x"}},
      {",\"WEIGHTS_0\":2", "", {"attributes", "WEIGHTS_0"}},
      {"\"indices\":3", "\"indices\":2", {"accessors[2].componentType", "5126"}},
      {"\"indices\":3", "\"indices\":3,\"mode\":9", {"primitives[0].mode", "9"}},
      {"\"indices\":3", "\"indices\":3,\"targets\":[{\"POSITION\":5}]", {"accessors[5]", "1 components"}},
      {"\"indices\":3",
       "\"indices\":3,\"targets\":[{\"POSITION\":8}]",
       {"accessors[8]", "3 elements", "6 vertices"}},
      {"\"indices\":3", "\"indices\":3,\"mode\":1", {"no triangles"}},
      {"\"joints\":[1,2]", "\"joints\":[1]", {"accessors[1], element 2", "joint index 1", "1 joints"}},
      {"\"joints\":[1,2]", "\"joints\":[1,2,0]", {"accessors[4]", "2 inverse bind matrices", "3 joints"}},
      {"\"joints\":[1,2]", "\"joints\":[1,12]", {"skins[0].joints[1]", "12"}},
      {"\"joints\":[1,2]", "\"joints\":[]", {"skins[0]", "no joints"}},
      {"\"output\":6", "\"output\":8", {"accessors[8]", "3 components", "4"}},
      {"\"input\":5,\"output\":6", "\"input\":7,\"output\":6", {"channels[0]", "8 output", "3 keys"}},
      {"\"sampler\":0", "\"sampler\":5", {"channels[0].sampler", "5", "2 samplers"}},
      {"\"LINEAR\"", "\"SMOOTH\"", {"samplers[0]", "'SMOOTH'"}},
      {"\"node\":2,\"path\":\"rotation\"",
       "\"node\":2,\"path\":\"weights\"",
       {"channels[0]", "nodes[2]", "morph"}},
      {"\"node\":2,\"path\":\"rotation\"", "\"node\":1,\"path\":\"translation\"", {"4", "3"}},
      {"\"channels\":[", "\"channels\":[],\"was\":[", {"'bend'", "no keyframes"}},
      {"\"count\":6", "\"count\":7", {"accessors[0]", "7 elements", "bufferViews[0]", "72 bytes"}},
      {"\"count\":6", "\"count\":1e15", {"accessors[0]", "1000000000000000", "72 bytes"}},
      {"\"count\":6", "\"count\":-6", {"accessors[0].count", "-6"}},
      {"\"count\":6", "\"count\":2.5", {"accessors[0].count", "2.5"}},
      {"\"count\":6",
       "\"byteOffset\":18446744073709551615,\"count\":6",
       {"accessors[0].byteOffset", "18446744073709551615"}},
      {"\"count\":6", "\"byteOffset\":4,\"count\":6", {"accessors[0]", "byte 4", "72 bytes"}},
      {"\"bufferView\":0", "\"bufferView\":77", {"accessors[0].bufferView", "77"}},
      {"\"componentType\":5126", "\"componentType\":5124", {"accessors[0].componentType", "5124"}},
      {"\"VEC3\"", "\"VEC5\"", {"accessors[0].type", "'VEC5'"}},
      {"\"byteLength\":72", "\"byteLength\":7200", {"bufferViews[0]", "7200", "buffers[0]"}},
      {"\"byteLength\":72",
       "\"byteLength\":72,\"byteStride\":3",
       {"accessors[0]", "12 bytes", "byteStride is 3"}},
      {"\"buffer\":0", "\"buffer\":1", {"bufferViews[0].buffer", "1"}},
      {"\"scene\":0",
       "\"scene\":0,\"extensionsRequired\":[\"KHR_draco_mesh_compression\"]",
       {"extensionsRequired[0]", "draco"}},
      {"\"scene\":0", "\"scene\":0,", {"JSON", "line 1"}},
  };
  for (const Fault& fault : faults) {
    SCOPED_TRACE(fault.from + " -> " + fault.to);
    std::string bad = good;
    const std::size_t at = bad.find(fault.from);
    ASSERT_NE(at, std::string::npos);
    bad.replace(at, fault.from.size(), fault.to);
    std::vector<std::string> words = fault.words;
    words.push_back("bad.gltf");
    expect_words(error_of(write("bad.gltf", bad)), words);
  }
}

TEST_F(IoGltf, BadNumbersAreNamed) {
  const auto with = [&](const std::string& replacement, int id) {
    std::string body = BendingStrip().body;
    const std::size_t at = body.find(replacement);
    EXPECT_NE(at, std::string::npos);
    return body.replace(at + replacement.size() - 1, 1, std::to_string(id));
  };
  const float nan = std::nanf("");
  BendingStrip a;
  a.builder.add<float>("VEC3", {0, 0, 0, 1, 0, 0, 0, 2, nan, 1, 0, 0, 1, 2, 0, 0, 2, 0});
  expect_words(error_of(write("n.gltf", a.builder.json(with("\"POSITION\":0", 9)))),
               {"n.gltf", "accessors[9], element 2", "component 2", "nan"});
  BendingStrip b;
  b.builder.add<float>("VEC4", {1, 0, 0, 0, 1, nan, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0});
  expect_words(error_of(write("n.gltf", b.builder.json(with("\"WEIGHTS_0\":2", 9)))),
               {"n.gltf", "accessors[9], element 1", "component 1", "nan"});
  BendingStrip c;
  c.builder.add<float>("VEC4", {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, -0.25, 0, 1, 0, 0, 0, 1, 0, 0, 0});
  expect_words(error_of(write("n.gltf", c.builder.json(with("\"WEIGHTS_0\":2", 9)))),
               {"n.gltf", "accessors[9], element 3", "-0.25"});
  BendingStrip d;
  d.builder.add<std::uint16_t>("SCALAR", {0, 1, 2, 3, 65535, 5});
  expect_words(error_of(write("n.gltf", d.builder.json(with("\"indices\":3", 9)))),
               {"n.gltf", "accessors[9], element 4", "65535", "6 vertices"});
  BendingStrip e;
  e.builder.add<std::uint16_t>("SCALAR", {0, 1, 2, 3});
  expect_words(error_of(write("n.gltf", e.builder.json(with("\"indices\":3", 9)))),
               {"n.gltf", "primitives[0]", "4"});
  BendingStrip f;
  f.builder.add<float>("SCALAR", {0.5f, 0.25f});
  expect_words(error_of(write("n.gltf", f.builder.json(with("\"input\":5", 9)))),
               {"n.gltf", "accessors[9], element 1", "0.25", "0.5"});
  BendingStrip g;
  g.builder.add<float>("SCALAR", {0.5f, 0.5f});
  expect_words(error_of(write("n.gltf", g.builder.json(with("\"input\":5", 9)))),
               {"n.gltf", "accessors[9], element 1", "0.5", "same time"});
  BendingStrip h;
  h.builder.add<float>("VEC4", {0, 0, 0, 1, 0, 0, 0, 0});
  expect_words(error_of(write("n.gltf", h.builder.json(with("\"output\":6", 9)))),
               {"n.gltf", "accessors[9], element 1", "length 0"});
}

TEST_F(IoGltf, EqualKeysOfEqualValueMerge) {
  BendingStrip strip;
  strip.builder.add<float>("SCALAR", {0.5f, 0.5f});
  strip.builder.add<float>("VEC4", {0, 0, 0, 1, 0, 0, 0, 1});
  strip.body.replace(strip.body.find("\"input\":5,\"output\":6"), 20, "\"input\":9,\"output\":10");
  const AnimatedMesh mesh = load(strip.builder.json(strip.body));
  EXPECT_EQ(mesh.merged_keyframes, 1u);
  EXPECT_EQ(mesh.keyframe_times.size(), 3 + mesh.added_keyframes);
}

TEST_F(IoGltf, BrokenContainers) {
  const BendingStrip strip;
  const std::string good = strip.builder.glb(strip.body);
  const auto patched = [&](std::size_t at, std::uint32_t value) {
    return std::string(good).replace(at, 4, bytes_of<std::uint32_t>({value}));
  };
  expect_words(error_of(write("t.glb", good.substr(0, 10))), {"t.glb", "header", "10 bytes"});
  expect_words(error_of(write("t.glb", good.substr(0, good.size() - 40))),
               {"t.glb", std::to_string(good.size()), std::to_string(good.size() - 40)});
  expect_words(error_of(write("t.glb", patched(4, 1))), {"t.glb", "version is 1"});
  expect_words(error_of(write("t.glb", patched(12, 0xFFFFFFFF))), {"t.glb", "chunk 0", "4294967295"});
  expect_words(error_of(write("t.glb", patched(16, 0x20202020))), {"t.glb", "chunk 0", "'    '", "JSON"});
  expect_words(error_of(write("t.glb", GltfBuilder::glb(strip.builder.json(strip.body, ""), "abc "))),
               {"t.glb", "buffers[0]", "4 bytes"});
  expect_words(error_of(write("t.gltf", strip.builder.json(strip.body, ""))),
               {"t.gltf", "buffers[0]", "uri"});
  expect_words(error_of(write("t.gltf", "[]")), {"t.gltf", "[]", "object"});
  expect_words(error_of(write("t.gltf", "{}")), {"t.gltf", "asset"});
  expect_words(error_of(write("t.gltf", "{\"asset\":{\"version\":\"2.0\"}}")), {"t.gltf", "no triangles"});
  // Deep nesting must not overflow a stack.
  expect_words(error_of(write("t.gltf", std::string(1000000, '['))), {"t.gltf", "JSON", "deeper than 256"});
  expect_words(
      error_of(write("t.gltf", "{\"a\":" + std::string(500000, '[') + std::string(500000, ']') + "}")),
      {"t.gltf: line 1, column 261", "deeper than 256"});
}

TEST_F(IoGltf, ALongChainOfNodes) {
  GltfBuilder b;
  b.add<float>("VEC3", {0, 0, 0, 1, 0, 0, 0, 1, 0});
  std::string nodes = "{\"mesh\":0}";
  for (int i = 1; i < 100000; ++i) nodes += ",{\"children\":[" + std::to_string(i - 1) + "]}";
  EXPECT_EQ(
      load(
          b.json(
              R"("scenes":[{"nodes":[99999]}],"meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],"nodes":[)" +
              nodes + "]"))
          .vertex_count,
      3u);
}

}  // namespace
}  // namespace kbvh::io::test::io_gltf_test
