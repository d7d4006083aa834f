// OBJ, PLY, PC2, folders of frames, writers and the cache: what they accept, what they refuse, and their
// messages.
#include <cmath>
#include <limits>

#include "experiments/io/animated_mesh_cache.hpp"
#include "experiments/io/number_text.hpp"
#include "experiments/io/obj.hpp"
#include "experiments/io/pc2.hpp"
#include "experiments/io/validate.hpp"
#include "io_test_support.hpp"

namespace kbvh::io::test::io_test {
namespace {

const std::string quad_with_tail =
    "# a comment\r\nmtllib x.mtl\r\no thing\nv 0 0 0 1 0.5 0.5\nv 1e0\t+0 -0.0\n  v 1 1 .1\nv 0 1 0 1.0\nvt "
    "0 0\nvn 0 0 1\n"
    "usemtl m\ns off\nf 1/1/1 2//1 3/1 -1\nl 1 2\np 3\nf 1 \\\n 2 5 # the fifth comes later\nv 0.1 0.2 "
    "0.30000000000000004\n";

using IoObj = IoTest;

TEST_F(IoObj, KeepsOrderPolygonsAndDigits) {
  const AnimatedMesh mesh = load_animated_mesh({write("a.obj", quad_with_tail), "", "", 0});
  EXPECT_EQ(mesh.name, "a");
  EXPECT_EQ(mesh.vertex_count, 5u);
  EXPECT_EQ(mesh.primitive_offsets, (std::vector<std::uint32_t>{0, 4, 7}));
  EXPECT_EQ(mesh.primitive_vertices, (std::vector<std::uint32_t>{0, 1, 2, 3, 0, 1, 4}));
  EXPECT_EQ(mesh.positions,
            (std::vector<double>{0, 0, 0, 1, 0, 0, 1, 1, .1, 0, 1, 0, .1, .2, 0.30000000000000004}));
  EXPECT_FALSE(std::signbit(mesh.positions[5]));  // no negative zero
  EXPECT_EQ(mesh.keyframe_times, std::vector<double>{0});
}

TEST_F(IoObj, NamesLineAndValue) {
  const std::string v3 = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
  const std::vector<std::pair<std::string, std::vector<std::string>>> bad{
      {"", {"empty"}},
      {"# nothing\n", {"no vertices"}},
      {v3 + "l 1 2\n", {"no faces"}},
      {"v 0 0 nan\n", {"line 1", "z", "nan"}},
      {"v 0 0 0\nv -inf 0 0\n", {"line 2", "x", "-inf"}},
      {"v 0 0\n", {"line 1", "vertex 1", "no coordinate z"}},
      {"v 0 1,5 0\n", {"line 1", "y", "'1,5'"}},
      {"v 0 1e999 0\n", {"line 1", "y", "'1e999'"}},
      {v3 + "f 1 2\n", {"line 4", "2 vertices"}},
      {v3 + "f 1 2 x\n", {"line 4", "'x'"}},
      {v3 + "f 1 2 3/a\n", {"line 4", "'3/a'"}},
      {v3 + "f 0 1 2\n", {"line 4", "index 0"}},
      {v3 + "f 1 2 4\n", {"line 4", "4", "3 vertices"}},
      {v3 + "f 1 2 -4\n", {"line 4", "-4", "3 vertices"}},
      {v3 + "f 1 2 4294967297\n", {"line 4", "4294967297"}},
      {v3 + "f 1 2 99999999999999999999\n", {"line 4", "'99999999999999999999'"}},
      {"v 0 0 0\nv 1e31 0 0\nv 0 1 0\nf 1 2 3\n", {"vertex 1", "x", "1e+31", "1e+30"}},
      {std::string("\x01\x02\0\x7f", 4), {"line 1", "not text"}},
  };
  for (const auto& [text, words] : bad) {
    SCOPED_TRACE(text);
    std::vector<std::string> all = words;
    all.push_back("bad.obj");
    expect_words(error_of(write("bad.obj", text)), all);
  }
  expect_words(error_of(folder_ / "missing.obj"), {"missing.obj", "no such file"});
  expect_words(error_of(write("a.stl", "x")), {"a.stl", "'.stl'"});
  expect_words(error_of(LoadRequest{write("a.obj", triangle_obj), "", "walk", 0}), {"a.obj", "'walk'"});
  expect_words(error_of(LoadRequest{write("a.obj", triangle_obj), "", "", -2}), {"a.obj", "-2"});
  expect_words(error_of(LoadRequest{write("a.obj", triangle_obj), "", "", std::nan("")}), {"a.obj", "nan"});
}

TEST_F(IoObj, CountsAndKeepsDegenerateFaces) {
  const AnimatedMesh mesh = load_animated_mesh(
      {write("d.obj",
             "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 2 0 0\nv 0 0 0\nv 0.1 0.1 0.1\nv 0.3 0.3 0.3\nv 3 0 1e-300\n"
             "f 1 2 3\nf 1 1 2\nf 1 2 4\nf 1 5 3\nf 1 2 3 4 1\nf 1 6 7\nf 1 2 8\nf 2 4 1 3\n"),
       "", "", 0});
  EXPECT_EQ(mesh.primitive_count(), 8u);
  // 2 repeats a vertex, 3 is collinear, 4 has two equal points; 6 lies on a line whose doubles are multiples
  // of (1, 1, 1). 5 repeats a vertex but has an area, 7 is off the line by 1e-300, 8 has a flat corner.
  EXPECT_EQ(mesh.degenerate_primitives, 4u);
}

TEST_F(IoObj, ZeroAreaIsDecidedExactly) {
  const std::vector<std::uint32_t> corners{0, 1, 2};
  const double third = 1.0 / 3;
  // Collinear in reals, but 1/3 and 0.1 are not: the doubles are off the line by less than a rounding.
  EXPECT_FALSE(
      is_degenerate(corners.data(), 3, std::vector<double>{0, 0, 0, third, 0.1, 0, 1, 0.3, 0}.data()));
  EXPECT_TRUE(is_degenerate(corners.data(), 3,
                            std::vector<double>{0, 0, 0, third, 0.1, 0, 2 * third, 0.2, 0}.data()));
  EXPECT_TRUE(
      is_degenerate(corners.data(), 3, std::vector<double>{1e20, 1, 0, 1e20, 3, 0, 1e20, 7, 0}.data()));
  EXPECT_FALSE(is_degenerate(corners.data(), 3,
                             std::vector<double>{1, 1, 0, 2, 2, 0, 3, std::nextafter(3.0, 4.0), 0}.data()));
}

TEST(IoNumberText, NearestDoubleOrNothing) {
  EXPECT_EQ(parse_double("0.1"), 0.1);
  EXPECT_EQ(parse_double("+2.5e-3"), 2.5e-3);
  EXPECT_EQ(parse_double("1e-400"), 0.0);
  EXPECT_EQ(parse_double("4.9e-324"), 4.9e-324);
  for (const char* bad : {"", "+", "-", "1e", "1.0x", "0x10", "+-1", "1e400", "1e99999", "one", "1 2"}) {
    EXPECT_FALSE(parse_double(bad).has_value()) << bad;
  }
  EXPECT_FALSE(parse_integer("1.0").has_value());
  EXPECT_EQ(parse_integer("-17"), -17);
}

using IoPly = IoTest;

std::string ply(const std::string& format, const std::string& elements, const std::string& body) {
  return "ply\nformat " + format + " 1.0\ncomment made by hand\n" + elements + "end_header\n" + body;
}

const std::string ascii_elements =
    "element vertex 4\nproperty float nx\nproperty double x\nproperty list uchar int extra\nproperty float "
    "y\n"
    "property float z\nelement face 2\nproperty list uchar int vertex_indices\nproperty uchar red\n";
const std::string ascii_body =
    "9 0 2 7 7 0 0\n9 1 0 0 0\n9 1 1 8 1 0\n9 0 0 1 0.1\n4 0 1 2 3 255\n3 0 1 2 0\n";

TEST_F(IoPly, Ascii) {
  const AnimatedMesh mesh =
      load_animated_mesh({write("a.ply", ply("ascii", ascii_elements, ascii_body)), "", "", 0});
  EXPECT_EQ(mesh.vertex_count, 4u);
  EXPECT_EQ(mesh.primitive_offsets, (std::vector<std::uint32_t>{0, 4, 7}));
  EXPECT_EQ(mesh.primitive_vertices, (std::vector<std::uint32_t>{0, 1, 2, 3, 0, 1, 2}));
  EXPECT_EQ(mesh.positions, (std::vector<double>{0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0.1}));
}

TEST_F(IoPly, BinaryOfBothByteOrdersWithFacesFirst) {
  const std::string elements =
      "element face 1\nproperty list uint8 uint16 vertex_index\nelement junk 2\nproperty int16 a\nproperty "
      "list ushort "
      "double b\nelement empty 1000000000\nelement vertex 3\nproperty double x\nproperty float y\nproperty "
      "int8 z\n";
  std::string little, big;
  const auto put = [&](auto value) {
    const std::string raw = bytes_of(std::vector<decltype(value)>{value});
    little += raw;
    big.append(raw.rbegin(), raw.rend());
  };
  put(std::uint8_t{3});
  for (int i : {0, 2, 1}) put(static_cast<std::uint16_t>(i));
  for (int i = 0; i < 2; ++i) {
    put(std::int16_t{-5});
    put(std::uint16_t{2});
    put(1.5);
    put(2.5);
  }
  for (int i = 0; i < 3; ++i) {
    put(i + 0.1);
    put(static_cast<float>(i * i));
    put(static_cast<std::int8_t>(-i));
  }
  for (const auto& [format, body] :
       {std::pair{"binary_little_endian", little}, std::pair{"binary_big_endian", big}}) {
    const AnimatedMesh mesh = load_animated_mesh({write("b.ply", ply(format, elements, body)), "", "", 0});
    EXPECT_EQ(mesh.primitive_vertices, (std::vector<std::uint32_t>{0, 2, 1}));
    EXPECT_EQ(mesh.positions, (std::vector<double>{0.1, 0, 0, 1.1, 1, -1, 2.1, 4, -2}));
    expect_words(error_of(write("b.ply", ply(format, elements, body.substr(0, body.size() - 1)))),
                 {"b.ply", "vertex", "3", "13 bytes", "38"});
    expect_words(error_of(write("b.ply", ply(format, elements, body.substr(0, 7 + 2 + 2 + 12)))),
                 {"b.ply", "junk 0", "length 2", "12 bytes"});
  }
}

TEST_F(IoPly, Strips) {
  const AnimatedMesh mesh = load_animated_mesh(
      {write("s.ply", ply("ascii",
                          "element vertex 5\nproperty float x\nproperty float y\nproperty float z\n"
                          "element tristrips 1\nproperty list int int vertex_indices\n",
                          "0 0 0\n1 0 0\n0 1 0\n1 1 0\n0 2 0\n8 0 1 2 3 -1 2 3 4\n")),
       "", "", 0});
  EXPECT_EQ(mesh.primitive_vertices, (std::vector<std::uint32_t>{0, 1, 2, 2, 1, 3, 2, 3, 4}));
}

TEST_F(IoPly, NamesElementAndValue) {
  const std::string xyz = "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n";
  const std::string face = "element face 1\nproperty list uchar int vertex_indices\n";
  const std::string body = "0 0 0\n1 0 0\n0 1 0\n";
  const std::vector<std::pair<std::string, std::vector<std::string>>> bad{
      {"plx\n", {"line 1", "'plx"}},
      {"ply\nformat ascii 1.0\n", {"line 3", "end_header"}},
      {"ply\nend_header\n", {"line 2", "format"}},
      {"ply\nformat binary 1.0\nend_header\n", {"line 2", "'binary'"}},
      {"ply\nformat ascii 2.0\nend_header\n", {"line 2", "'2.0'"}},
      {"ply\nformat ascii 1.0\nproperty float x\n", {"line 3", "before the first element"}},
      {"ply\nformat ascii 1.0\nelement vertex -3\n", {"line 3", "'-3'"}},
      {"ply\nformat ascii 1.0\nelement vertex 3\nproperty quad x\n", {"line 4", "'quad'"}},
      {"ply\nformat ascii 1.0\nelement vertex 3\nproperty list float int x\n", {"line 4", "'float'"}},
      {"ply\nformat ascii 1.0\nhello\n", {"line 3", "'hello'"}},
      {ply("ascii", xyz + face, body + "3 0 1 3\n"), {"face 0", "3", "3 vertices"}},
      {ply("ascii", xyz + face, body + "3 0 1 -1\n"), {"line 14, face 0", "-1"}},
      {ply("ascii", xyz + face, body + "3 0 1 1.5\n"), {"line 14, face 0", "1.5"}},
      {ply("ascii", xyz + face, body + "2 0 1\n"), {"line 14, face 0", "2 vertices"}},
      {ply("ascii", xyz + face, body + "-1\n"), {"line 14, face 0", "-1"}},
      {ply("ascii", xyz + face, body + "4000000000 1\n"), {"line 14, face 0", "4000000000"}},
      {ply("ascii", xyz + face, body + "3 0 1\n"), {"face 0", "file ends"}},
      {ply("ascii", xyz + face, "0 0\n1 0 0\n0 1 0 0\n3 0 1 2\n"), {"line 11, vertex 0", "line ends before"}},
      {ply("ascii", xyz + face, "0 0 0 1\n1 0\n0 1 0\n3 0 1 2\n"), {"line 11, vertex 1", "too many values"}},
      {ply("ascii", xyz + face, body + "3 0 1 2\n3 0 1 2\n"),
       {"line 15, column 1", "behind the last element"}},
      {ply("ascii",
           xyz + "element face 1\nproperty list uchar int vertex_indices\nproperty list uchar int "
                 "vertex_index\n",
           body + "3 0 1 2 3 0 1 2\n"),
       {"element face", "two lists of vertex indices"}},
      {ply("ascii", xyz + face, "0 0 0\n1 nan 0\n0 1 0\n3 0 1 2\n"), {"line 12, vertex 1", "y", "nan"}},
      {ply("ascii", xyz + face, "0 0 0\n1 x 0\n0 1 0\n3 0 1 2\n"), {"line 12, vertex 1", "'x'"}},
      {ply("ascii", "element vertex 3\nproperty float x\nproperty float y\n" + face, body), {"property z"}},
      {ply("ascii", "element vertex 0\nproperty float x\nproperty float y\nproperty float z\n", ""),
       {"no vertices"}},
      {ply("ascii", xyz + "element face 1\nproperty int a\n", body + "1\n"),
       {"element face", "vertex_indices"}},
      {ply("binary_little_endian",
           "element vertex 4000000000\nproperty float x\nproperty float y\nproperty float z\n", body),
       {"element vertex", "4000000000", "12 bytes", "18 bytes"}},
      {ply("binary_little_endian", xyz + face,
           std::string(8, '\0') + bytes_of<float>({INFINITY}) + std::string(60, '\0')),
       {"vertex 0", "z", "inf"}},
  };
  for (const auto& [text, words] : bad) {
    SCOPED_TRACE(text);
    std::vector<std::string> all = words;
    all.push_back("bad.ply");
    expect_words(error_of(write("bad.ply", text)), all);
  }
}

using IoPc2 = IoTest;

TEST_F(IoPc2, TimesComeFromStartRateAndFramesPerSecond) {
  const fs::path mesh = write("m.obj", triangle_obj);
  const std::vector<float> numbers{0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 0, 1, 0, 1, 1};
  const AnimatedMesh a = load_animated_mesh({mesh, write("m.pc2", pc2_of(3, 2, numbers, 10, 0.5f)), "", 20});
  EXPECT_EQ(a.keyframe_times, (std::vector<double>{0.5, 0.525}));
  EXPECT_EQ(a.positions, std::vector<double>(numbers.begin(), numbers.end()));
  const AnimatedMesh b = load_animated_mesh({mesh, write("m.pc2", pc2_of(3, 2, numbers, 0, 0)), "", 0});
  EXPECT_EQ(b.keyframe_times, (std::vector<double>{0, 1.0 / 30}));
}

TEST_F(IoPc2, NamesSampleVertexAndValue) {
  const fs::path mesh = write("m.obj", triangle_obj);
  std::vector<float> numbers(18, 0.f);
  const std::string good = pc2_of(3, 2, numbers);
  const auto complain = [&](const std::string& bytes) { return error_of(mesh, write("m.pc2", bytes)); };
  expect_words(error_of(mesh, folder_ / "no.pc2"), {"no.pc2", "no such file"});
  expect_words(complain(""), {"m.pc2", "empty"});
  expect_words(complain("POINT"), {"m.pc2", "5 bytes", "32"});
  expect_words(complain(std::string(40, 'x')), {"m.pc2", "header", "'xxxxxxxxxxxx'", "POINTCACHE2"});
  expect_words(complain(pc2_of(3, 2, numbers, 0, 1, 7)), {"m.pc2", "version is 7"});
  expect_words(complain(pc2_of(4, 2, numbers)), {"m.pc2", "4 vertices", "m.obj", "3"});
  expect_words(complain(pc2_of(-3, 2, numbers)), {"m.pc2", "-3"});
  expect_words(complain(pc2_of(3, 0, {})), {"m.pc2", "no frames", "0 samples"});
  expect_words(complain(pc2_of(3, -2, {})), {"m.pc2", "-2"});
  expect_words(complain(pc2_of(3, 2000000000, numbers)),
               {"m.pc2", "2000000000 samples", "104 bytes", "2 whole samples"});
  expect_words(complain(good.substr(0, good.size() - 1)),
               {"m.pc2", "2 samples", "104 bytes", "103 bytes", "1 whole sample"});
  expect_words(complain(good + "x"), {"m.pc2", "2 samples", "105 bytes"});
  expect_words(complain(pc2_of(3, 2, numbers, NAN)), {"m.pc2", "start frame is nan"});
  expect_words(complain(pc2_of(3, 2, numbers, 0, -1)), {"m.pc2", "sample rate is -1"});
  expect_words(complain(pc2_of(3, 2, numbers, 0, INFINITY)), {"m.pc2", "sample rate is inf"});
  numbers[9 + 3 + 1] = NAN;
  expect_words(complain(pc2_of(3, 2, numbers)), {"m.pc2: sample 1, vertex 1: coordinate y is nan"});
  numbers[9 + 3 + 1] = 2e30f;
  expect_words(complain(pc2_of(3, 2, numbers)), {"m.pc2", "keyframe 1, vertex 1", "y", "2.00", "1e+30"});
  expect_words(error_of(LoadRequest{mesh, write("m.abc", good), "", 0}), {"m.abc", "'.abc'"});
}

TEST_F(IoPc2, EqualTimesMergeOnlyIfPositionsAreEqual) {
  const fs::path mesh = write("m.obj", triangle_obj);
  std::vector<float> numbers;
  for (int k = 0; k < 3; ++k) numbers.insert(numbers.end(), {0, 0, 0, 1, 0, 0, 0, 1, 0});
  // A start frame of 1e30 swallows a step of one frame: all times are equal.
  const AnimatedMesh merged =
      load_animated_mesh({mesh, write("m.pc2", pc2_of(3, 3, numbers, 1e30f, 1)), "", 0});
  EXPECT_EQ(merged.keyframe_times.size(), 1u);
  EXPECT_EQ(merged.merged_keyframes, 2u);
  EXPECT_EQ(merged.positions.size(), 9u);
  numbers[18 + 4] = 0.25f;
  expect_words(error_of(mesh, write("m.pc2", pc2_of(3, 3, numbers, 1e30f, 1))),
               {"m.pc2", "keyframe 2", "same time", "vertex 1", "y = 0.25 instead of 0"});
}

using IoFrames = IoTest;

TEST_F(IoFrames, NumericOrderAndTimes) {
  for (int i : {10, 2, 6})
    write("walk/frame_" + std::to_string(i) + ".obj",
          "v 0 0 " + std::to_string(i) + "\n" + "v 1 0 0\nv 0 1 0\nf 1 2 3\n");
  write("walk/notes.txt", "not a frame");
  const AnimatedMesh mesh = load_animated_mesh({folder_ / "walk", "", "", 10});
  EXPECT_EQ(mesh.name, "walk");
  EXPECT_EQ(mesh.keyframe_times, (std::vector<double>{0, 0.1, 0.2}));
  EXPECT_EQ(mesh.positions[2], 2);
  EXPECT_EQ(mesh.positions[9 + 2], 6);
  EXPECT_EQ(mesh.positions[18 + 2], 10);
}

TEST_F(IoFrames, NamesBothFiles) {
  fs::create_directories(folder_ / "f");
  expect_words(error_of(folder_ / "f"), {"f: no frames"});
  write("f/a_1.obj", triangle_obj);
  write("f/a_2.obj", triangle_obj);
  write("f/a_4.obj", triangle_obj);
  expect_words(error_of(folder_ / "f"), {"frame 3 is missing", "a_2.obj", "a_4.obj"});
  write("f/a_3.obj", std::string(triangle_obj) + "v 5 5 5\n");
  expect_words(error_of(folder_ / "f"), {"a_3.obj", "4 vertices", "a_1.obj", "3"});
  write("f/a_3.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 3 2\n");
  expect_words(error_of(folder_ / "f"), {"a_3.obj", "face 0", "(0, 2, 1)", "a_1.obj", "(0, 1, 2)"});
  write("f/a_3.obj", std::string(triangle_obj) + "f 1 3 2\n");
  expect_words(error_of(folder_ / "f"), {"a_3.obj", "2 faces", "a_1.obj", "1"});
  write("f/a_3.obj", "v 0 0 0\nv 1 0 2e30\nv 0 1 0\nf 1 2 3\n");
  expect_words(error_of(folder_ / "f"), {"a_3.obj", "vertex 1", "z", "2e+30"});
  write("f/a_3.obj", triangle_obj);
  write("f/a_03.obj", triangle_obj);
  expect_words(error_of(folder_ / "f"), {"a_3.obj", "a_03.obj", "both frame 3"});
  fs::remove(folder_ / "f/a_03.obj");
  write("f/b_5.obj", triangle_obj);
  expect_words(error_of(folder_ / "f"), {"a_4.obj", "b_5.obj"});
  fs::remove(folder_ / "f/b_5.obj");
  write("f/rest.ply", "ply");
  expect_words(error_of(folder_ / "f"), {"rest.ply", "no number"});
  expect_words(error_of(folder_ / "missing"), {"missing", "no such file or folder"});
}

AnimatedMesh sample_mesh() {
  AnimatedMesh mesh;
  mesh.name = "sample \"1\"";
  mesh.vertex_count = 5;
  mesh.primitive_offsets = {0, 3, 7};
  mesh.primitive_vertices = {0, 1, 2, 1, 2, 3, 4};
  for (int k = 0; k < 4; ++k) {
    mesh.keyframe_times.push_back(0.5 + k * 0.25);
    for (int i = 0; i < 15; ++i) mesh.positions.push_back(static_cast<float>(std::sin(k + 3.7 * i)));
  }
  return mesh;
}

void expect_equal(const AnimatedMesh& a, const AnimatedMesh& b) {
  EXPECT_EQ(a.vertex_count, b.vertex_count);
  EXPECT_EQ(a.primitive_offsets, b.primitive_offsets);
  EXPECT_EQ(a.primitive_vertices, b.primitive_vertices);
  EXPECT_EQ(a.keyframe_times, b.keyframe_times);
  EXPECT_EQ(a.positions, b.positions);
}

using IoSave = IoTest;

TEST_F(IoSave, ObjAndPc2RoundTrip) {
  const AnimatedMesh mesh = sample_mesh();
  save_obj(mesh, folder_ / "s.obj");
  save_pc2(mesh, folder_ / "s.pc2");
  expect_equal(load_animated_mesh({folder_ / "s.obj", folder_ / "s.pc2", "", 0}), mesh);

  AnimatedMesh exact = mesh;
  exact.positions = {0.1, 1.0 / 3, 1e-300, 1e29, -2.5, 3, 4, 5, 6, 7, 8, 9, 1, 2, 3};
  exact.keyframe_times = {0};
  save_obj(exact, folder_ / "e.obj");
  expect_equal(load_animated_mesh({folder_ / "e.obj", "", "", 0}), exact);

  AnimatedMesh uneven = mesh;
  uneven.keyframe_times[2] += 0.01;
  EXPECT_THROW(save_pc2(uneven, folder_ / "u.pc2"), InputError);
  EXPECT_FALSE(fs::exists(folder_ / "u.pc2"));
  EXPECT_THROW(save_obj(mesh, folder_ / "none" / "s.obj"), InputError);
}

TEST_F(IoSave, CacheRoundTrip) {
  std::vector<AnimatedMesh> meshes{sample_mesh(), sample_mesh()};
  meshes[0].merged_keyframes = 3;
  meshes[1].positions[7] = 0.1;  // not a float: this mesh is stored in doubles
  const fs::path file = folder_ / "c.kbvh";
  save_cache(meshes, file);
  const std::vector<AnimatedMesh> back = load_cache(file);
  ASSERT_EQ(back.size(), 2u);
  for (std::size_t i = 0; i < 2; ++i) expect_equal(back[i], meshes[i]);
  EXPECT_EQ(back[0].name, meshes[0].name);
  EXPECT_EQ(back[0].merged_keyframes, 3u);
  const std::uintmax_t mixed = fs::file_size(file);
  save_cache({sample_mesh(), sample_mesh()}, file);
  EXPECT_EQ(mixed - fs::file_size(file), 60u * 4);
  std::size_t files = 0;
  for ([[maybe_unused]] const auto& entry : fs::directory_iterator(folder_)) ++files;
  EXPECT_EQ(files, 1u);  // no temporary file is left
  save_cache({}, file);
  EXPECT_TRUE(load_cache(file).empty());
}

TEST_F(IoSave, DamagedCachesAreRefused) {
  save_cache({sample_mesh()}, folder_ / "c.kbvh");
  std::ifstream in(folder_ / "c.kbvh", std::ios::binary);
  const std::string good{std::istreambuf_iterator<char>(in), {}};
  const auto complain = [&](const std::string& bytes) -> std::string {
    try {
      load_cache(write("bad.kbvh", bytes));
    } catch (const InputError& error) {
      return error.what();
    }
    return "accepted";
  };
  for (std::size_t n = 0; n < good.size(); n += 3) expect_words(complain(good.substr(0, n)), {"bad.kbvh: "});
  for (std::size_t n = 0; n < good.size(); n += 3) {
    std::string bad = good;
    bad[n] = static_cast<char>(bad[n] ^ 0x10);
    expect_words(complain(bad), {"bad.kbvh: "});
  }
  std::string other = good;
  other[8] = 9;
  expect_words(complain(other), {"bad.kbvh", "version is 9", "only 1"});
  expect_words(complain(good + "x"),
               {"bad.kbvh", std::to_string(good.size() - 32), std::to_string(good.size() - 31)});
}

}  // namespace
}  // namespace kbvh::io::test::io_test
