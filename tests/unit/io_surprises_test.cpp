// Files that are valid but unusual, and files that are nearly valid: each surprise in OBJ, PLY and PC2 is
// read as the format requires, noted, or refused with its place.
#include "io_test_support.hpp"

namespace kbvh::io::test::io_surprises_test {
namespace {

using IoSurprises = IoTest;
using Ids = std::vector<std::uint32_t>;

const std::string v3 = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

std::string joined(const std::vector<std::string>& notes) {
  std::string text;
  for (const std::string& note : notes) text += note + "; ";
  return text;
}

class Text : public IoTest {
 protected:
  AnimatedMesh load(const std::string& name, const std::string& text) const {
    return load_animated_mesh({write(name, text), "", "", 0});
  }
  void expect_refused(const std::string& name, const std::string& text,
                      std::vector<std::string> words) const {
    SCOPED_TRACE(text);
    words.push_back(name);
    expect_words(error_of(write(name, text)), words);
  }
};

class ObjSurprises : public Text {
 protected:
  AnimatedMesh obj(const std::string& text) const { return load("a.obj", text); }
  void refused(const std::string& text, const std::vector<std::string>& words) const {
    expect_refused("bad.obj", text, words);
  }
};

TEST_F(ObjSurprises, CommentsAndNamesEndWithTheirLine) {
  const AnimatedMesh plain = obj(v3 + "f 1 2 3\n");
  for (const std::string line :
       {"# a\\b\\", "g a\\b\\", "o C:\\", "usemtl m\\", "mtllib C:\\x y\\", "s off\\", "# \\ ", "foo x\\"})
    for (const std::string& text : {line + "\n" + v3 + "f 1 2 3\n", v3 + line + "\nf 1 2 3\n"}) {
      SCOPED_TRACE(text);
      const AnimatedMesh mesh = obj(text);
      EXPECT_EQ(mesh.positions, plain.positions);
      EXPECT_EQ(mesh.primitive_vertices, plain.primitive_vertices);
      EXPECT_EQ(mesh.notes.empty(), line[0] != 'f') << joined(mesh.notes);
    }
  // A comment at the end of a face, and on the last line of a face that continues.
  EXPECT_EQ(obj(v3 + "f 1 2 3 # a\\b\\\nf 3 2 1\n").primitive_vertices, (Ids{0, 1, 2, 2, 1, 0}));
  EXPECT_EQ(obj(v3 + "f 1 \\\n2 3 # a\\\nf 3 2 1\n").primitive_vertices, (Ids{0, 1, 2, 2, 1, 0}));
}

TEST_F(ObjSurprises, OnlyNumbersGoOn) {
  EXPECT_EQ(obj("v 0 \\\n0 \\\n\\\n 0\nv 1 0 0\\ \t\n\nv 0 1 0\nf\\\n1/1\\\n2//1 3\n").primitive_vertices,
            (Ids{0, 1, 2}));
  refused("v 0 0 0 \\\n" + v3 + "f 1 2 3\n", {"line 2", "'v'", "numbers go on"});
  refused("vn 0 0 1 \\\n" + v3 + "f 1 2 3\n", {"line 2", "'v'", "numbers go on"});
  refused(v3 + "f 1 2 \\\nf 1 2 3\n", {"line 5", "'f'", "numbers go on"});
  refused(v3 + "f 1 2 3 \\\n", {"line 4", "no line follows"});
  refused(v3 + "f 1 2 \\\n\n3\n", {"line 4", "2 vertices"});
  refused(v3 + "f 1 2 3\n4 5\n", {"line 5", "'4'", "not a statement"});
}

TEST_F(ObjSurprises, NumbersOfAVertexAreCounted) {
  for (const char* tail : {"", " 1", " 0.5 0.5 0.5", " 1 0.5 0.5 0.5"})
    EXPECT_EQ(obj("v 0 0 0" + std::string(tail) + "\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").vertex_count, 3u);
  refused("v 0 0 0 1 1\n", {"line 1", "5 numbers"});
  refused("v 0 0 0 1 1 1 1 1\n", {"line 1", "8 numbers"});
  refused("v 0 0 0 v 1 0 0\n", {"line 1", "'v'", "not a number"});
  refused("v 0 0 0 red\n", {"line 1", "'red'"});
}

TEST_F(ObjSurprises, CornersHaveThreePartsAtMost) {
  EXPECT_EQ(obj(v3 + "f 1/ 2// 3/-1/+1\n").primitive_vertices, (Ids{0, 1, 2}));
  refused(v3 + "f 1/1/1/1 2 3\n", {"line 4", "'1/1/1/1'"});
  refused(v3 + "f 1/-/+ 2 3\n", {"line 4", "'1/-/+'"});
  refused(v3 + "f 1,2,3\n", {"line 4", "'1,2,3'"});
}

TEST_F(ObjSurprises, LinesBeginWithAWord) {
  const AnimatedMesh mesh = obj(v3 + "foo 1\nV 1 2 3\nf 1 2 3\n");
  ASSERT_EQ(mesh.notes.size(), 1u);
  expect_words(mesh.notes[0], {"2 lines", "unknown", "'foo' in line 4"});
  refused("v0 0 0\n" + v3, {"line 1", "'v0'"});
  refused(v3 + "f1 2 3\n", {"line 4", "'f1'"});
  refused(v3 + "\xEF\xBB\xBFv 1 1 1\n", {"line 4", "not a statement"});
  refused(v3 + "v\xC2\xA0"
               "1 1 1\n",
          {"line 4", "not a statement"});
  refused(v3 + std::string("f 1 2 3\0\n", 9), {"line 4"});
  refused(v3 + "call part.obj\n", {"line 4", "includes another file"});
  // Every statement that does not concern polygons is known.
  EXPECT_TRUE(
      obj("mtllib a b.mtl\nusemap x\nmaplib y\nshadow_obj z\ntrace_obj z\nlod 3\nbevel on\nc_interp on\n"
          "d_interp on\nctech cparm 1\nstech cparma 1 2\no \xC3\xA9\ng a b\ns 1\nmg 1 0.5\nvt 0 0\nvn 0 0 1\n"
          "vp 0 0\nbmat u 1 0\nstep 1 1\n" +
          v3 + "f 1 2 3\n")
          .notes.empty());
}

TEST_F(ObjSurprises, PointsAreThoseOfTheFile) {
  const AnimatedMesh cloud = obj(v3 + "p 3 -3\np 2\n");
  EXPECT_EQ(cloud.kind, MeshKind::points);
  EXPECT_EQ(cloud.vertex_count, 3u);
  EXPECT_EQ(cloud.primitive_vertices, (Ids{2, 0, 1}));
  EXPECT_EQ(obj(v3 + "p 2\n").primitive_vertices, (Ids{1}));
  EXPECT_EQ(obj(v3).primitive_vertices, (Ids{0, 1, 2}));
  refused(v3 + "p\n", {"line 4", "without a vertex"});
  refused(v3 + "p 4\n", {"line 4", "4", "3 vertices"});
  const AnimatedMesh mesh = obj(v3 + "p 1 2\nl 1 2\nl 2 3\ncurv 0 1 1 2\nend\nf 1 2 3\n");
  EXPECT_EQ(mesh.kind, MeshKind::polygons);
  expect_words(joined(mesh.notes),
               {"skipped 2 points (p)", "skipped 2 polylines (l)", "skipped 1 curve (curv)"});
}

class PlySurprises : public Text {
 protected:
  static std::string ply(const std::string& elements, const std::string& body,
                         const std::string& format = "ascii") {
    return "ply\nformat " + format + " 1.0\n" + elements + "end_header\n" + body;
  }
  void refused(const std::string& text, const std::vector<std::string>& words) const {
    expect_refused("bad.ply", text, words);
  }
};

const std::string xyz = "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n",
                  face = "element face 1\nproperty list uchar int vertex_indices\n",
                  edge = "element edge 1\nproperty int vertex1\nproperty int vertex2\n",
                  body3 = "0 0 0\n1 0 0\n0 1 0\n";

TEST_F(PlySurprises, AnElementMayGoOnInTheNextLines) {
  for (const std::string body : {"0 0\n0\n1 0 0\n0 1 0\n3 0 1 2\n", "0\n0\n0\n1 0 0\n0 1 0\n3\n0 1 2\n",
                                 "0 0 0\n1 0 0\n0 1 0\n3 0\n1\n\n2"}) {
    SCOPED_TRACE(body);
    const AnimatedMesh mesh = load("a.ply", ply(xyz + face, body));
    EXPECT_EQ(mesh.positions, (std::vector<double>{0, 0, 0, 1, 0, 0, 0, 1, 0}));
    EXPECT_EQ(mesh.primitive_vertices, (Ids{0, 1, 2}));
    expect_words(joined(mesh.notes), {"written over several lines"});
  }
  EXPECT_TRUE(load("a.ply", ply(xyz + face, body3 + "3 0 1 2\n")).notes.empty());
  // A missing value does not shift the others, at any place.
  refused(ply(xyz + face, "0 0 0\n1 0\n0 1 0 5\n3 0 1 2\n"),
          {"line 11, vertex 1", "ends before all its values", "line 12"});
  refused(ply(xyz + face, "0 0 0\n1\n0 0 0 1 0\n3 0 1 2\n"), {"line 11, vertex 1", "ends before"});
  refused(ply(xyz + face, "0 0 0\n1 0 0\n0 1\n3 0 1 2 0\n"), {"line 12, vertex 2", "ends before"});
  refused(ply(xyz + face + edge, body3 + "3 0 1\n2 0 1\n"), {"line 16, face 0", "ends before"});
  refused(ply(xyz + edge + face, body3 + "0\n1 3 0 1 2\n"), {"line 16, edge 0", "ends before"});
  refused(ply(xyz + edge + face, body3 + "0 1 3 0 1 2\n"), {"line 16, face 0", "too many values"});
}

TEST_F(PlySurprises, HeadersSayWhatTheyMean) {
  refused(ply("made by hand\n" + xyz + face, body3), {"line 3", "'made'", "'comment'"});
  refused(ply(xyz + "element vertex 3\nproperty float w\n" + face, body3),
          {"line 7", "second element", "'vertex'"});
  refused(ply(xyz + face + face, body3), {"line 9", "second element", "'face'"});
  refused(ply("element vertex 3 4\n", body3), {"line 3", "'4'"});
  refused(ply("element vertex 3\nproperty float x y z\n", body3), {"line 4", "'y'"});
  refused("ply\nformat ascii 1.0 utf8\n", {"line 2", "'utf8'"});
  refused(ply("comment a\rproperty float x\n" + xyz + face, body3), {"line 3", "line end of another kind"});
  refused(ply(xyz + "element face 1\nproperty uchar n\nproperty int a\nproperty int b\nproperty int c\n",
              body3 + "3 0 1 2\n"),
          {"element face", "vertex_indices", "the number n, the number a, the number b, the number c"});
}

TEST_F(PlySurprises, OtherElementsAreNamed) {
  const AnimatedMesh mesh = load("a.ply", ply(xyz + face + edge + "element camera 1\nproperty float view\n",
                                              body3 + "3 0 1 2\n0 1\n7\n"));
  expect_words(joined(mesh.notes),
               {"1 of its elements 'edge' skipped", "1 of its elements 'camera' skipped"});
  refused(ply(xyz + edge, body3 + "0 1\n"), {"edges", "no face"});
  const std::string strips = "element tristrips 1\nproperty list int int vertex_indices\n";
  refused(ply(xyz + strips, body3 + "2 0 1\n"), {"tristrips 0", "2 vertices"});
  refused(ply(xyz + strips, body3 + "6 0 1 2 -1 0 1\n"), {"tristrips 0", "2 vertices"});
  refused(ply(xyz + strips, body3 + "0\n"), {"tristrips", "no face"});
  const AnimatedMesh odd =
      load("b.ply", ply("element vertex 3\nproperty int x\nproperty uchar y\nproperty float z\n" + face,
                        "0.5 0 0\n1 0 0\n0 -1 0\n3 0 1 2\n"));
  EXPECT_EQ(odd.positions, (std::vector<double>{0.5, 0, 0, 1, 0, 0, 0, -1, 0}));
  expect_words(joined(odd.notes), {"2 of its numbers do not fit the types"});
}

TEST_F(IoSurprises, PointCachesThatDoNotMove) {
  const fs::path mesh = write("m.obj", triangle_obj);
  const std::vector<float> one{0, 0, 0, 1, 0, 0, 0, 1, 0};
  std::vector<float> two = one;
  two.insert(two.end(), {0, 0, 1, 1, 0, 1, 0, 1, 1});
  EXPECT_TRUE(load_animated_mesh({mesh, write("m.pc2", pc2_of(3, 2, two)), "", 0}).notes.empty());
  expect_words(joined(load_animated_mesh({mesh, write("m.pc2", pc2_of(3, 1, one)), "", 0}).notes),
               {"one sample", "nothing moves"});
  expect_words(joined(load_animated_mesh({mesh, write("m.pc2", pc2_of(3, 2, two, 0, 0)), "", 0}).notes),
               {"sample rate is 0"});
}

TEST_F(IoSurprises, NotesOfFramesNameTheirFile) {
  write("f/a_1.obj", triangle_obj);
  write("f/a_2.obj", "l 1 2\n" + std::string(triangle_obj));
  write("f/a_3.obj", "l 1 2\n" + std::string(triangle_obj));
  expect_words(joined(load_animated_mesh({folder_ / "f", "", "", 0}).notes),
               {"a_2.obj: skipped 1 polyline (l); "});
}

}  // namespace
}  // namespace kbvh::io::test::io_surprises_test
