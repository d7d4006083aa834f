// Names given by a user, and suggestions for unknown words.
#include "binary.hpp"
#include "experiments/common/json_reader.hpp"
#include "experiments/common/names.hpp"
#include "experiments/io/animated_mesh.hpp"
#include "experiments/study/plan.hpp"

namespace kbvh::experiments::input_test {
namespace {

std::string name_error(const std::string& name) {
  try {
    check_name(name, "p.json: scenes[0]: name");
  } catch (const io::InputError& problem) {
    return problem.what();
  }
  return "";
}

TEST(Names, AreTextOfOneLine) {
  for (const std::string name : {"cloth", "caf\xC3\xA9", "a/b", "CON", "a b", "...", "\xF0\x9F\x90\x8D"})
    EXPECT_EQ(name_error(name), "") << name;
  EXPECT_EQ(name_error(""), "");
  EXPECT_EQ(name_error(".."), "p.json: scenes[0]: name: the name '..' means a folder");
  EXPECT_EQ(name_error("caf\xE9"), "p.json: scenes[0]: name: the name 'caf?' is not UTF-8: byte 3 is 0xE9");
  for (const std::string& name :
       {std::string("a\nb"), std::string("a\0b", 3), std::string("\x1B[31m"), std::string("a\x7F")})
    EXPECT_NE(name_error(name).find("control character"), std::string::npos) << name;
  EXPECT_NE(name_error(std::string(1001, 'x')).find("1001 bytes"), std::string::npos);
  // Overlong sequences, halves of UTF-16 pairs, values beyond the last code point, truncated sequences.
  for (const char* name : {"\xC0\xAF", "\xE0\x80\xAF", "\xED\xA0\x80", "\xF4\x90\x80\x80", "\xC3", "\xFF"})
    EXPECT_NE(name_error(name).find("not UTF-8"), std::string::npos);
}

TEST(Names, AreSpeltOutWhereTheyAreNoText) {
  EXPECT_EQ(readable("cloth"), "cloth");
  EXPECT_EQ(readable("caf\xC3\xA9"), "caf\xC3\xA9");
  EXPECT_EQ(readable("caf\xE9 \xFF"), "caf\\xE9 \\xFF");
  EXPECT_EQ(readable("two\nlines\x7F"), "two\\x0Alines\\x7F");
}

/// Expects a file name that is an entry of its folder on every system.
void expect_file_name(const std::string& name) {
  const std::string file = file_name(name);
  EXPECT_FALSE(file.empty());
  EXPECT_LE(file.size(), 101u);
  EXPECT_EQ(readable(file), file);
  EXPECT_EQ(file.find_first_of("/\\:*?\"<>|"), std::string::npos) << file;
  for (const char c : file) EXPECT_TRUE(static_cast<unsigned char>(c) >= 32 && c != 127) << file;
  EXPECT_NE(file[0], '.');
  EXPECT_NE(file.back(), '.');
  EXPECT_NE(file.back(), ' ');
  EXPECT_EQ(std::filesystem::path(file).filename(), file);
}

TEST(Names, BecomeNamesOfFiles) {
  EXPECT_EQ(file_name("cloth-2k"), "cloth-2k");
  EXPECT_EQ(file_name("shirt and sphere"), "shirt and sphere");
  EXPECT_EQ(file_name("a/b"), "a-b");
  EXPECT_EQ(file_name(".."), "--");
  EXPECT_EQ(file_name("../../etc"), "---..-etc");
  EXPECT_EQ(file_name("caf\xC3\xA9"), "caf\xC3\xA9");
  EXPECT_EQ(file_name("nul.obj"), "nul.obj-");
  EXPECT_EQ(file_name("com1"), "com1-");
  EXPECT_NE(file_name(std::string(300, 'a')), file_name(std::string(301, 'a')));
  std::uint64_t state = 1;
  const auto next = [&] { return state = state * 6364136223846793005ull + 1442695040888963407ull; };
  for (int round = 0; round < 20000; ++round) {
    std::string name;
    for (std::uint64_t i = (next() >> 33) % (round % 10 == 0 ? 400 : 8); i > 0; --i) {
      constexpr const char* parts[] = {".", "/",        "\\",           "a",    "CON",
                                       " ", "\xC3\xA9", "\xE2\x82\xAC", "\xFF", "\n"};
      name += (next() >> 33) % 4 == 0 ? std::string(1, char(next() >> 40)) : parts[(next() >> 33) % 10];
    }
    expect_file_name(name);
  }
  for (const char* name : {"", ".", "..", "...", "con", "aux.txt", "LPT9", "a.", "a "})
    expect_file_name(name);
}

TEST(Names, OfManyBodiesAreShort) {
  EXPECT_EQ(name_of_bodies({"a", "b"}), "a+b");
  EXPECT_EQ(name_of_bodies({std::string(300, 'a'), "b"}), std::string(300, 'a') + "+1 more");
  EXPECT_EQ(name_of_bodies(std::vector<std::string>(400, "sphere-20")),
            "sphere-20+sphere-20+sphere-20+sphere-20+sphere-20+sphere-20+sphere-20+sphere-20+sphere-20+"
            "sphere-20+390 more");
}

TEST_F(Binary, ScenesOfAnyNameAreStoredWhereTheyBelong) {
  const std::string two = "--repetitions 1 --strategies bottom_up --out o/out ";
  std::string bodies;
  for (int i = 0; i < 20; ++i)
    bodies += "--body sphere:triangles=20,radius=0.1,keyframes=2,step=0.1:0:0,centre=" + std::to_string(i) +
              ":0:0 ";
  const Outcome many = kbvh("run " + bodies + two);
  EXPECT_EQ(many.code, 0) << many.err;
  const std::string one = "--body sphere:triangles=20,keyframes=2,step=0.1:0:0 --body sphere:triangles=20 ";
  int l = 2;  // a different configuration each time: names do not distinguish them
  for (const std::string& name :
       {std::string(300, 'n'), std::string("a/b"), std::string("../../x"), std::string("CON")}) {
    const Outcome run = kbvh("run " + one + two + "--name '" + name + "' --l " + std::to_string(++l));
    EXPECT_EQ(run.code, 0) << name << run.err;
    EXPECT_EQ(records("o/out/results.jsonl").back().at("scene").at("name"), name);
  }
  for (const std::string name : {"..", ".", "caf\xE9", "a\nb"}) {
    const Outcome run = kbvh("run " + one + two + "--name '" + name + "'");
    EXPECT_EQ(run.code, 2) << name << run.err;
    EXPECT_NE(run.err.find("name: the name"), std::string::npos) << run.err;
  }
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder_ / "o"), {}), 1);
  // A file may have any name that the system allows.
  write_text(folder_ / "caf\xE9.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  const Outcome latin =
      kbvh("run --body sphere:triangles=20,keyframes=2,step=0.1:0:0 --body caf\xE9.obj " + two);
  EXPECT_EQ(latin.code, 0) << latin.err;
  EXPECT_EQ(records("o/out/results.jsonl").back().at("scene").at("bodies")[1].at("name"), "caf\\xE9");
}

TEST_F(Binary, AnAxisOfAnyLengthTurnsTheSame) {
  std::string first;
  for (const char* axis : {"1:0:0", "1e200:0:0", "1e-170:0:0", "1e308:1e-308:0"}) {
    const Outcome run =
        kbvh(std::string("run --body box:triangles=20,keyframes=2,step=0.1:0:0,rotate=") + axis +
             ":30 --body sphere:triangles=20 --repetitions 1 --strategies bottom_up --out o" + axis);
    EXPECT_EQ(run.code, 0) << axis << run.err;
    const std::string hash = records(std::string("o") + axis + "/results.jsonl").at(0).at("scene").at("hash");
    if (first.empty()) first = hash;
    EXPECT_EQ(hash, first) << axis;
  }
}

TEST_F(Binary, AMisspeltShapeIsNoFile) {
  const std::pair<std::string, std::string> cases[] = {
      {"shpere", "no shape 'shpere'; shapes are sphere, "},
      {"shpere", "nurbs; did you mean 'sphere'?"},
      {"shpere:triangles=20", "nurbs; did you mean 'sphere'?"},
      {"nothing_like_it", "no shape 'nothing_like_it'; shapes are sphere"},
      {"sphere:triangels=20", "turns; did you mean 'triangles'?"},
      {"missing.obj", "missing.obj: no such file"},
      {"folder/missing.obj", "folder/missing.obj: no such file"},
  };
  for (const auto& [body, said] : cases) {
    const Outcome run = kbvh("run --body sphere:triangles=20 --body " + body);
    EXPECT_EQ(run.code, 2) << run.err;
    EXPECT_NE(run.err.find(said), std::string::npos) << run.err;
  }
}

TEST_F(Binary, JsonFromOutsideIsCheckedInOnePlace) {
  const std::string deep = std::string(100000, '[') + std::string(100000, ']');
  const std::string twice = R"({"scenes": "tablecloth", "l": 1, "l": 2})";
  write_text(folder_ / "deep.json", R"({"scenes": )" + deep + "}");
  write_text(folder_ / "twice.json", twice);
  write_text(folder_ / "deep_script.json", R"({"steps": )" + deep + "}");
  write_text(folder_ / "deep_repro.json", R"({"kind": "kbvh stress scene", "frames": )" + deep + "}");
  write_text(folder_ / "deep.gltf", R"({"asset": {"version": "2.0"}, "extras": )" + deep + "}");
  const std::string body = "--body sphere:triangles=20 ";
  for (const char* arguments :
       {"run --plan deep.json", "run --plan deep.json --print-plan", "bench --plan deep.json",
        "run --scene waving_sheet --triangles 20 --script deep_script.json", "stress --repro deep_repro.json",
        "run --body sphere:triangles=20 --body deep.gltf"}) {
    const Outcome run = kbvh(arguments);
    EXPECT_EQ(run.code, 2) << arguments << run.err;
    EXPECT_NE(run.err.find("nested deeper than 256 levels"), std::string::npos) << arguments << run.err;
  }
  const Outcome run = kbvh("run --plan twice.json");
  EXPECT_EQ(run.code, 2);
  EXPECT_NE(run.err.find("twice.json: line 1, column 34: the key 'l' is given twice"), std::string::npos)
      << run.err;
}

TEST_F(Binary, PolygonsOfManyCornersAreInputErrors) {
  std::string text, corners;
  for (int i = 0; i < 70000; ++i) {
    text += "v " + std::to_string(i % 300) + " " + std::to_string(i / 300) + " 0\n";
    corners += " " + std::to_string(i + 1);
  }
  write_text(folder_ / "large.obj", text + "f" + corners + "\n");
  const Outcome run =
      kbvh("run --body large.obj --body sphere:triangles=20 --l 1 --strategies bottom_up,kinetic_aabb");
  EXPECT_EQ(run.code, 2) << run.err;
  EXPECT_NE(
      run.err.find("large.obj: polygon 0 has 70000 corners; at most 4095 are possible, as=triangles cuts"),
      std::string::npos)
      << run.err;
}

}  // namespace
}  // namespace kbvh::experiments::input_test
