// Polygons, points and control nets from files.

#include <gtest/gtest.h>

#include "experiments/io/obj.hpp"
#include "experiments/io/primitives.hpp"
#include "tests/unit/io_test_support.hpp"

namespace kbvh::io::test::io_primitives_test {
namespace {

using IoPrimitives = IoTest;
using Numbers = std::vector<std::uint32_t>;

AnimatedMesh loaded(const fs::path& file) {
  return load_animated_mesh({file, "", "", 0});
}

TEST_F(IoPrimitives, PolygonsStayWholeOrBecomeFans) {
  AnimatedMesh mesh =
      loaded(write("a.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv -1 .5 0\nf 1 2 3 4 5\nf 1 2 3\n"));
  EXPECT_EQ(mesh.kind, MeshKind::polygons);
  take_as(mesh, TakeAs::given);
  EXPECT_EQ(mesh.primitive_offsets, (Numbers{0, 5, 8}));
  take_as(mesh, TakeAs::triangles);
  EXPECT_EQ(mesh.primitive_offsets, (Numbers{0, 3, 6, 9, 12}));
  EXPECT_EQ(mesh.primitive_vertices, (Numbers{0, 1, 2, 0, 2, 3, 0, 3, 4, 0, 1, 2}));
  take_as(mesh, TakeAs::points);
  EXPECT_EQ(mesh.kind, MeshKind::points);
  EXPECT_EQ(mesh.primitive_vertices, (Numbers{0, 1, 2, 3, 4}));
  EXPECT_THROW(take_as(mesh, TakeAs::triangles), InputError);
}

TEST_F(IoPrimitives, FilesOfVerticesArePoints) {
  const std::string vertices = "v 0 0 0\nv 1 0 0\nv 0 1 0\n",
                    header =
                        "ply\nformat ascii 1.0\nelement vertex 3\n"
                        "property float x\nproperty float y\nproperty float z\n",
                    body = "0 0 0\n1 0 0\n0 1 0\n";
  for (const fs::path& file :
       {write("a.obj", vertices), write("b.obj", vertices + "p 1\np 2 3\n"),
        write("c.ply", header + "end_header\n" + body),
        write("d.ply",
              header + "element face 0\nproperty list uchar int vertex_indices\nend_header\n" + body)}) {
    const AnimatedMesh mesh = loaded(file);
    EXPECT_EQ(mesh.kind, MeshKind::points) << file;
    EXPECT_EQ(mesh.primitive_offsets, (Numbers{0, 1, 2, 3}));
    EXPECT_EQ(mesh.primitive_vertices, (Numbers{0, 1, 2}));
    EXPECT_EQ(mesh.degenerate_primitives, 0u);
  }
  const AnimatedMesh moving = load_animated_mesh(
      {write("m.obj", vertices), write("m.pc2", pc2_of(3, 2, std::vector<float>(18, 0.5f))), "", 0});
  EXPECT_EQ(moving.kind, MeshKind::points);
  EXPECT_EQ(moving.keyframe_times.size(), 2u);
  save_obj(moving, folder_ / "saved.obj");
  EXPECT_EQ(loaded(folder_ / "saved.obj").kind, MeshKind::points);
  expect_words(error_of(write("l.obj", vertices + "l 1 2\n")), {"l.obj", "lines", "no faces"});
}

/// Control points (i, j) of an nu x nv grid, with weights.
std::string grid(std::uint32_t nu, std::uint32_t nv, const std::string& weight = " 1.5") {
  std::string text;
  for (std::uint32_t j = 0; j < nv; ++j)
    for (std::uint32_t i = 0; i < nu; ++i)
      text += "v " + std::to_string(i) + " " + std::to_string(j) + " 0" + weight + "\n";
  return text;
}

std::string indices(std::uint32_t count) {
  std::string text;
  for (std::uint32_t i = 1; i <= count; ++i) text += " " + std::to_string(i);
  return text;
}

// Cubic in u with an inner knot, quadratic in v with a double one: 2 x 2 spans of positive length.
const std::string knots = "parm u 0 0 0 0 .5 1 1 1 1\nparm v 0 0 0 1 1 2 2 2\nend\n";

TEST_F(IoPrimitives, SurfacesGiveControlNets) {
  const std::string text =
      grid(5, 5) + "cstype rat bspline\ndeg 3 2\nsurf 0 1 0 2 \\\n" + indices(25) + "\n" + knots;
  const AnimatedMesh mesh = loaded(write("s.obj", text));
  EXPECT_EQ(mesh.kind, MeshKind::control_nets);
  EXPECT_EQ(mesh.vertex_count, 25u);
  EXPECT_EQ(mesh.primitive_offsets, (Numbers{0, 12, 24, 36, 48}));
  EXPECT_EQ(Numbers(mesh.primitive_vertices.begin(), mesh.primitive_vertices.begin() + 12),
            (Numbers{0, 1, 2, 3, 5, 6, 7, 8, 10, 11, 12, 13}));
  // The last: u is the second span, v begins two rows on, past the double knot.
  EXPECT_EQ(Numbers(mesh.primitive_vertices.begin() + 36, mesh.primitive_vertices.end()),
            (Numbers{11, 12, 13, 14, 16, 17, 18, 19, 21, 22, 23, 24}));
  EXPECT_THROW(save_obj(mesh, folder_ / "t.obj"), InputError);

  const auto part = loaded(
      write("p.obj", grid(5, 5, "") + "cstype bspline\ndeg 3 2\nsurf 0 .5 1 2" + indices(25) + "\n" + knots));
  EXPECT_EQ(part.primitive_count(), 1u);  // spans outside of the range are excluded
  const auto two = loaded(write("w.obj", grid(5, 5) + "cstype bspline\ndeg 3 2\nsurf 0 1 0 2" + indices(25) +
                                             "\n" + knots + "curv 0 1 1 2\nparm u 0 1\nend\nsurf 0 1 0 2" +
                                             indices(25) + "\n" + knots));
  EXPECT_EQ(two.primitive_count(), 8u);
}

TEST_F(IoPrimitives, SurfacesThatAreNotKnownAreRefused) {
  const std::string spline = "cstype rat bspline\ndeg 3 2\n", surf = "surf 0 1 0 2" + indices(25) + "\n",
                    points = grid(5, 5);
  const std::vector<std::pair<std::string, std::vector<std::string>>> bad{
      {points + "cstype bezier\ndeg 3 2\n" + surf + knots, {"line 28", "'bezier'", "bspline"}},
      {points + "deg 3 2\n" + surf + knots, {"line 27", "'none'"}},
      {points + "cstype bspline\n" + surf + knots, {"line 27", "degrees"}},
      {points + "cstype bspline\ndeg 3\n" + surf + knots, {"line 28", "degrees", "1"}},
      {points + "cstype bspline\ndeg 3 0\n" + surf + knots, {"line 27", "'0'"}},
      {points + spline + "surf 0 1 0 x 1\n" + knots, {"line 28", "'x'"}},
      {points + spline + "surf 0 1 0 2 1 0\n" + knots, {"line 28", "'0'"}},
      {points + spline + "surf 0 1 0 2" + indices(24) + "\n" + knots, {"line 28", "5 x 5", "24"}},
      {points + spline + "surf 0 1 0 2" + indices(24) + " 26\n" + knots, {"line 28", "26", "25 vertices"}},
      {points + spline + surf + "parm u 0 0 0 0 1 1 1\nend\n", {"line 30", "u", "7 knots"}},
      {points + spline + surf + "parm u 0 0 0 0 -1\n", {"line 29", "-1", "below"}},
      {points + spline + surf + "parm w 0 0\n", {"line 29", "'w'"}},
      {points + spline + surf + "parm u 0 nan\n", {"line 29", "'nan'"}},
      {points + spline + surf + "trim 0 1 1\n" + knots, {"line 29", "'trim'"}},
      {points + spline + surf + "scrv 0 1 1\n" + knots, {"line 29", "'scrv'"}},
      {points + spline + surf + knots + "con 1 0 1 1 2 0 1 1\n", {"line 32", "con"}},
      {points + spline + surf, {"line 28", "no end"}},
      {points + spline + surf + surf + knots, {"line 29", "before"}},
      {points + spline + "surf 5 6 0 2" + indices(25) + "\n" + knots, {"line 28", "no knot span"}},
      {points + "f 1 2 7\n" + spline + surf + knots, {"faces and surfaces"}},
      {grid(5, 5, " 0") + spline + surf + knots, {"line 28", "control point 1", "weight"}},
      {grid(5, 5, " -2") + spline + surf + knots, {"weight", "not positive"}},
  };
  for (const auto& [text, words] : bad) {
    SCOPED_TRACE(text.substr(text.size() - std::min<std::size_t>(text.size(), 120)));
    std::vector<std::string> all = words;
    all.push_back("s.obj");
    expect_words(error_of(write("s.obj", text)), all);
  }
  // Without "rat" weights are ignored.
  EXPECT_EQ(
      loaded(write("n.obj", grid(5, 5, " 0") + "cstype bspline\ndeg 3 2\n" + surf + knots)).primitive_count(),
      4u);
}

}  // namespace
}  // namespace kbvh::io::test::io_primitives_test
