// Small studies by the kbvh binary that ask for more than pairs at frames: contacts between keyframes,
// changes, and pairs within bodies.
#include <array>

#include "binary.hpp"

namespace kbvh::experiments::questions_test {
namespace {

TEST_F(Binary, ContactsBetweenKeyframesAreMeasuredAndKept) {
  const std::string command =
      "run --scene waving_sheet --triangles 200 --keyframes 4 --repetitions 2 --continuous "
      "--self --out out";
  const Outcome first = kbvh(command);
  EXPECT_EQ(first.code, 0) << first.err;
  EXPECT_NE(first.out.find("3 intervals,"), std::string::npos) << first.out;
  const auto found = records();
  ASSERT_GE(found.size(), 3u);
  for (const json& record : found) {
    EXPECT_EQ(record.at("scene").at("continuous"), true);
    EXPECT_EQ(record.at("scene").at("frames"), 3);
    EXPECT_TRUE(record.at("verified").at("holds"));
    EXPECT_EQ(record.at("verified").at("pairs"), found[0].at("verified").at("pairs"));
    EXPECT_GT(record.at("verified").at("pairs"), 0);
    EXPECT_EQ(record.at("times").at("repetitions").size(), 2u);
    const json& impacts = record.at("impacts");
    EXPECT_EQ(impacts.at("tests").get<int>(),
              impacts.at("filtered").get<int>() + impacts.at("exact").get<int>());
    EXPECT_GT(impacts.at("tests"), 0);
  }
  // Not measured again; but frames are a different measurement.
  EXPECT_EQ(kbvh(command).code, 0);
  EXPECT_EQ(records().size(), found.size());
  EXPECT_EQ(kbvh("run " + tiny + "--strategies bottom_up --out out").code, 0);
  EXPECT_EQ(records().size(), found.size() + 1);
}

TEST_F(Binary, ChangesAreMeasuredAndKept) {
  const std::string command = "run --scene waving_sheet --triangles 200 --keyframes 4 --repetitions 2 --l 5 ";
  const std::string who = "--strategies bottom_up,interval_join,kinetic_separation_list,auto --out out ";
  const Outcome first = kbvh(command + who + "--changes pairs");
  EXPECT_EQ(first.code, 0) << first.err;
  EXPECT_NE(first.out.find("(changes of pairs), l = 5"), std::string::npos) << first.out;
  const auto found = records();
  ASSERT_EQ(found.size(), 4u);
  for (const json& record : found) {
    EXPECT_EQ(record.at("scene").at("changes"), "pairs");
    EXPECT_TRUE(record.at("verified").at("holds")) << record.at("verified").dump();
    EXPECT_EQ(record.at("changes"), found[0].at("changes"));
    EXPECT_GT(record.at("changes").at("begun"), 0);
    for (const json& repetition : record.at("times").at("repetitions")) {
      EXPECT_GT(repetition.at("traversal"), 0);
      EXPECT_EQ(repetition.at("triangle_tests"), 0);
    }
  }
  // Not measured again; but the other answer is a different measurement.
  EXPECT_EQ(kbvh(command + who + "--changes pairs").code, 0);
  EXPECT_EQ(records().size(), 4u);
  EXPECT_EQ(kbvh(command + who + "--changes candidates").code, 0);
  EXPECT_EQ(records().size(), 8u);
  EXPECT_EQ(kbvh(command + who).code, 0);
  EXPECT_EQ(records().size(), 12u);
  const Outcome wrong = kbvh(command + who + "--changes contacts");
  EXPECT_EQ(wrong.code, 2);
  EXPECT_NE(wrong.err.find("expected candidates, pairs or none, got 'contacts'"), std::string::npos)
      << wrong.err;
}

TEST_F(Binary, ContactsAreMeasuredWherePlansChange) {
  const Outcome run = kbvh(
      "run --scene reversing_spheres --triangles 160 --repetitions 1 --continuous --strategies "
      "bottom_up,interval_join,kinetic_separation_list,kinetic_aabb --out out");
  EXPECT_EQ(run.code, 0) << run.err;
  EXPECT_NE(run.out.find("plans change while it runs"), std::string::npos) << run.out;
  EXPECT_NE(run.err.find("kinetic_aabb is left out"), std::string::npos) << run.err;
  const auto found = records();
  ASSERT_EQ(found.size(), 3u);
  for (const json& record : found) {
    EXPECT_TRUE(record.at("verified").at("holds")) << record.at("verified").dump();
    EXPECT_GT(record.at("verified").at("pairs"), 0);
    EXPECT_GT(record.at("scene").at("script").at("changes"), 0);
  }
}

// Intervals of contacts also end at the keyframes of bodies, for any frames of a script.
TEST_F(Binary, ContactsOfAScriptWithFramesOfItsOwn) {
  write_text(folder_ / "script.json",
             R"({"frames": 10, "rate": 7, "steps": [
                  {"time": 0.1, "changes": [{"body": 0, "vertex": 0, "velocity": [0, 0, 1]}]}]})");
  const Outcome run = kbvh(
      "run --scene random_soups --triangles 20 --obstacle 20 --keyframes 6 --script script.json --continuous "
      "--repetitions 1 --strategies brute_force,interval_join,kinetic_separation_list --out out");
  EXPECT_EQ(run.code, 0) << run.err;
  const auto found = records();
  ASSERT_EQ(found.size(), 3u);
  for (const json& record : found) EXPECT_TRUE(record.at("verified").at("holds")) << record.at("verified");
}

TEST_F(Binary, PairsWithinBodiesAreCountedWhereTheyAreAskedFor) {
  // Two squares of one body that form a tent in which each side passes through the other.
  write_text(folder_ / "tent.obj",
             "v 0 0 0\nv 1 0 1\nv 0 1 0\nv 1 0 0\nv 0 0 1\nv 1 1 0\nf 1 2 3\nf 4 5 6\n");
  const std::string bodies =
      "--body tent.obj,translate=0:0:9 --l 1 --repetitions 1 --strategies bottom_up,hybrid ";
  const auto pairs = [&](const std::string& more, const std::string& out) {
    const Outcome run = kbvh("run " + bodies + more + "--out " + out);
    EXPECT_EQ(run.code, 0) << run.err;
    const auto found = records(out + "/results.jsonl");
    EXPECT_FALSE(found.empty()) << run.err;
    return found.empty() ? json() : found[0];
  };
  const json without = pairs("--body sphere:triangles=100 ", "without");
  EXPECT_EQ(without.at("verified").at("pairs"), 0);
  const json with = pairs("--body sphere:triangles=100 --self ", "with");
  EXPECT_GT(with.at("verified").at("pairs"), 0);
  EXPECT_EQ(with.at("scene").at("bodies").at(0).at("self"), true);
  EXPECT_NE(with.at("key"), without.at("key"));
  // Strategies that cannot do this are left out.
  EXPECT_EQ(records("with/results.jsonl").size(), 1u);
  EXPECT_EQ(records("without/results.jsonl").size(), 2u);
  const json one = pairs("--body sphere:triangles=100,self=true ", "one");
  EXPECT_EQ(one.at("verified").at("pairs"), 0);
  EXPECT_EQ(one.at("scene").at("bodies").at(0).at("self"), false);
  EXPECT_EQ(one.at("scene").at("bodies").at(1).at("self"), true);
}

// A cube whose sides have four vertices each, as exporters write it for the sake of normals.
TEST_F(Binary, NeighboursAtASeamAreNoPair) {
  std::string vertices, ply_vertices, obj_faces, ply_faces;
  for (int side = 0; side < 6; ++side) {
    for (int i = 0; i < 4; ++i) {
      int p[3];
      p[side / 2] = side % 2;
      p[(side / 2 + 1) % 3] = i % 2;
      p[(side / 2 + 2) % 3] = i / 2;
      const std::string text =
          std::to_string(p[0]) + " " + std::to_string(p[1]) + " " + std::to_string(p[2]) + "\n";
      vertices += "v " + text;
      ply_vertices += text;
    }
    for (const std::array<int, 3> f : {std::array{0, 1, 2}, std::array{2, 1, 3}}) {
      obj_faces += "f";
      ply_faces += "3";
      for (const int i : f) {
        obj_faces += " " + std::to_string(4 * side + i + 1);
        ply_faces += " " + std::to_string(4 * side + i);
      }
      obj_faces += "\n";
      ply_faces += "\n";
    }
  }
  write_text(folder_ / "cube.obj", vertices + obj_faces);
  write_text(
      folder_ / "cube.ply",
      "ply\nformat ascii 1.0\nelement vertex 24\nproperty float x\nproperty float y\nproperty float z\n"
      "element face 12\nproperty list uchar int vertex_indices\nend_header\n" +
          ply_vertices + ply_faces);
  write_text(folder_ / "script.json",
             R"([{"time": 0.01, "changes": [{"vertex": 3, "velocity": [0, 0, 1]}]}])");
  int number = 0;
  const auto pairs = [&](const std::string& body, const std::string& note, const std::string& more = "") {
    const std::string out = "out" + std::to_string(++number);
    const Outcome run = kbvh("run --body " + body +
                             " --body sphere:triangles=20,keyframes=2,step=0:0:0.1,centre=9:9:9 "
                             "--self --l 1 --repetitions 1 --strategies bottom_up --out " +
                             out + more);
    EXPECT_EQ(run.code, 0) << run.err;
    EXPECT_NE(run.err.find(note), std::string::npos) << run.err;
    const auto found = records(out + "/results.jsonl");
    EXPECT_EQ(found.size(), 1u);
    return found.empty() ? json() : found[0].at("verified").at("pairs");
  };
  for (const std::string file : {"cube.obj", "cube.ply"}) {
    EXPECT_EQ(pairs(file, "note: " + file + ": welded 16 vertices"), 0);
    EXPECT_GT(pairs(file + ",weld=false", "16 of its vertices"), 0);
    // A script moves vertices by their numbers in the file, including copies.
    EXPECT_GT(pairs(file, "16 of its vertices", " --script script.json"), 0);
    EXPECT_EQ(pairs(file + ",weld=true", "welded 16 vertices", " --script script.json"), 0);
  }
  write_text(folder_ / "a.gltf", "{}");
  const Outcome refused = kbvh("run --self --body a.gltf,weld=false");
  EXPECT_EQ(refused.code, 2);
  EXPECT_NE(refused.err.find("glTF files are always welded"), std::string::npos) << refused.err;
}

TEST_F(Binary, ContactsAtASeamAreFoundOnce) {
  // A plate of two triangles, once with the vertices of their common edge stored twice.
  write_text(folder_ / "seam.obj",
             "v -1 -1 0\nv 1 -1 0\nv -1 1 0\nv 1 -1 0\nv -1 1 0\nv 1 1 0\nf 1 2 3\nf 4 6 5\n");
  write_text(folder_ / "plain.obj", "v -1 -1 0\nv 1 -1 0\nv -1 1 0\nv 1 1 0\nf 1 2 3\nf 2 4 3\n");
  const auto contacts = [&](const std::string& body) {
    const Outcome run =
        kbvh("run --body " + body +
             " --body sphere:triangles=80,keyframes=2,step=0:0:-2,"
             "centre=0.1:0.07:1.5,radius=0.6 --continuous --repetitions 1 --strategies bottom_up --out " +
             body + ".out");
    EXPECT_EQ(run.code, 0) << run.err;
    const auto found = records(body + ".out/results.jsonl");
    EXPECT_EQ(found.size(), 1u);
    return found.empty() ? 0 : found[0].at("verified").at("pairs").get<int>();
  };
  const int plain = contacts("plain.obj");
  EXPECT_GT(plain, 0);
  EXPECT_EQ(contacts("seam.obj"), plain);
  EXPECT_GT(contacts("seam.obj,weld=false"), plain);
}

}  // namespace
}  // namespace kbvh::experiments::questions_test
