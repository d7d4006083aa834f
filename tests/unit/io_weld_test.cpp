// Vertices that a file stores once per normal or texture coordinate become one vertex, by one rule for all
// formats.
#include <set>

#include "io_gltf_fixture.hpp"

namespace kbvh::io::test::io_weld_test {
namespace {

using IoWeld = IoTest;
using Ids = std::vector<std::uint32_t>;

/// The six sides of a cube, each with its own four vertices: 24 for 8 corners.
struct TexturedBox {
  std::vector<float> positions;
  Ids corners;  // of 12 triangles

  TexturedBox() {
    for (int side = 0; side < 6; ++side) {
      const int axis = side / 2;
      for (int i = 0; i < 4; ++i) {
        float p[3];
        p[axis] = float(side % 2);
        p[(axis + 1) % 3] = float(i % 2);
        p[(axis + 2) % 3] = float(i / 2);
        positions.insert(positions.end(), p, p + 3);
      }
      const std::uint32_t base = std::uint32_t(4 * side);
      for (const std::uint32_t i : {0u, 1u, 2u, 2u, 1u, 3u}) corners.push_back(base + i);
    }
  }

  std::string obj() const {
    std::string text;
    for (std::size_t i = 0; i < positions.size(); i += 3)
      text += "v " + std::to_string(int(positions[i])) + " " + std::to_string(int(positions[i + 1])) + " " +
              std::to_string(int(positions[i + 2])) + "\nvt " + std::to_string(i / 3 % 2) + " " +
              std::to_string(i / 6 % 2) + "\n";
    for (std::size_t i = 0; i < corners.size(); i += 3) {
      text += "f";
      for (std::size_t c = i; c < i + 3; ++c)
        text += " " + std::to_string(corners[c] + 1) + "/" + std::to_string(corners[c] + 1);
      text += "\n";
    }
    return text;
  }

  std::string ply() const {
    std::string text =
        "ply\nformat binary_little_endian 1.0\nelement vertex 24\nproperty float x\nproperty float y\n"
        "property float z\nproperty float s\nelement face 12\nproperty list uchar uint vertex_indices\n"
        "end_header\n";
    for (std::size_t i = 0; i < positions.size(); i += 3)
      text += bytes_of<float>({positions[i], positions[i + 1], positions[i + 2], float(i)});
    for (std::size_t i = 0; i < corners.size(); i += 3)
      text += '\x03' + bytes_of<std::uint32_t>({corners[i], corners[i + 1], corners[i + 2]});
    return text;
  }

  std::string gltf() const {
    GltfBuilder b;
    b.add<float>("VEC3", positions);
    b.add<std::uint32_t>("SCALAR", corners);
    return b.json(
        R"("nodes":[{"mesh":0}],"meshes":[{"primitives":[{"attributes":{"POSITION":0},"indices":1}]}])");
  }
};

std::size_t distinct(const Ids& ids) {
  return std::set<std::uint32_t>(ids.begin(), ids.end()).size();
}

/// The corners' positions at the first keyframe, face by face.
std::vector<double> corner_positions(const AnimatedMesh& mesh) {
  std::vector<double> out;
  for (const std::uint32_t v : mesh.primitive_vertices)
    out.insert(out.end(), &mesh.positions[3 * v], &mesh.positions[3 * v] + 3);
  return out;
}

TEST_F(IoWeld, ATexturedBoxHasEightCornersInEveryFormat) {
  const TexturedBox box;
  const AnimatedMesh gltf = load_animated_mesh({write("a.gltf", box.gltf()), "", "", 0});
  EXPECT_EQ(gltf.vertex_count, 8u);
  EXPECT_EQ(gltf.welded_vertices, 16u);
  write("frames/a_1.obj", box.obj());
  write("frames/a_2.obj", box.obj());
  for (const fs::path& file : {write("a.obj", box.obj()), write("a.ply", box.ply()), folder_ / "frames"}) {
    SCOPED_TRACE(file);
    const AnimatedMesh mesh = load_animated_mesh({file, "", "", 0});
    EXPECT_EQ(distinct(mesh.primitive_vertices), 8u);
    EXPECT_EQ(mesh.welded_vertices, 16u);
    EXPECT_EQ(mesh.vertex_count, 24u);  // each keeps its number
    EXPECT_EQ(corner_positions(mesh), corner_positions(gltf));
    const AnimatedMesh apart = load_animated_mesh({file, "", "", 0, LoadRequest::Seams::keep_apart});
    EXPECT_EQ(apart.primitive_vertices, box.corners);
    EXPECT_EQ(apart.welded_vertices, 0u);
    ASSERT_EQ(apart.notes.size(), 1u);
    expect_words(apart.notes[0], {"16 of its vertices", "not welded"});
    EXPECT_EQ(apart.positions, mesh.positions);
  }
}

TEST_F(IoWeld, OnlyWhatIsTogetherAtRestAndAtEveryKeyframe) {
  // Two triangles with two edges at the same place: vertices 1, 2 and their copies 3, 4.
  const std::string obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 4 6 5\n";
  std::vector<float> numbers;
  for (const float z : {0.f, 1.f, 2.f})
    numbers.insert(numbers.end(), {0, 0, z, 1, 0, z, 0, 1, z, 1, 0, z, 0, 1, z, 1, 1, z});
  const auto load = [&](const std::string& mesh) {
    return load_animated_mesh({write("a.obj", mesh), write("a.pc2", pc2_of(6, 3, numbers)), "", 0});
  };
  EXPECT_EQ(load(obj).primitive_vertices, (Ids{0, 1, 2, 1, 5, 2}));
  EXPECT_EQ(load(obj).positions, std::vector<double>(numbers.begin(), numbers.end()));  // the cache's order
  numbers[18 + 3 * 3] = 1.5f;  // at the second keyframe vertex 3 leaves vertex 1
  EXPECT_EQ(load(obj).primitive_vertices, (Ids{0, 1, 2, 3, 5, 2}));
  EXPECT_EQ(load(obj).welded_vertices, 1u);
  // The mesh file holds them apart.
  EXPECT_EQ(
      load("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 0 0\nv 0 1 9\nv 1 1 0\nf 1 2 3\nf 4 6 5\n").primitive_vertices,
      (Ids{0, 1, 2, 3, 5, 4}));
  // Zeros of either sign are equal.
  EXPECT_EQ(
      load_animated_mesh(
          {write("z.obj", "v -0 0 0\nv 1 0 0\nv 0 1 0\nv 0 -0 0\nv 2 2 2\nf 1 2 3\nf 4 5 3\n"), "", "", 0})
          .primitive_vertices,
      (Ids{0, 1, 2, 0, 4, 2}));
}

TEST_F(IoWeld, UnusedVerticesAndPointsStay) {
  // Vertex 0 is at the same place as 1, but no face uses it: the faces still use 1.
  const std::string vertices = "v 0 0 0\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 0\nv 1 1 0\n";
  const AnimatedMesh mesh = load_animated_mesh({write("a.obj", vertices + "f 2 3 4\nf 5 3 6\n"), "", "", 0});
  EXPECT_EQ(mesh.primitive_vertices, (Ids{1, 2, 3, 1, 2, 5}));
  EXPECT_EQ(mesh.welded_vertices, 1u);
  const AnimatedMesh points = load_animated_mesh({write("p.obj", vertices), "", "", 0});
  EXPECT_EQ(points.primitive_vertices, (Ids{0, 1, 2, 3, 4, 5}));
  EXPECT_EQ(points.welded_vertices, 0u);
}

}  // namespace
}  // namespace kbvh::io::test::io_weld_test
