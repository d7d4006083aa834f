// Text files as other systems write them: line ends, byte order marks, UTF-16; JSON that is nested too deep
// or repeats a key.
#include <random>

#include "experiments/io/bytes.hpp"
#include "experiments/io/json_text.hpp"
#include "io_gltf_fixture.hpp"

namespace kbvh::io::test::io_text_test {
namespace {

using IoText = IoTest;

const std::string quad = "# a quad\nv 0 0 0\nv 1 0 0\n\nv 1 1 0\nv 0 1 0\nf 1 2 \\\n 3\nf 1 3 4\n";
const std::string ascii_ply =
    "ply\nformat ascii 1.0\ncomment x\nelement vertex 3\nproperty float x\nproperty float y\nproperty float "
    "z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";

std::string with_line_ends(const std::string& text, const std::string& end) {
  std::string result;
  for (const char c : text) result += c == '\n' ? end : std::string(1, c);
  return result;
}

std::string utf16(const std::string& text, bool big_endian) {
  std::string result;
  for (const char c : text) result += big_endian ? std::string{'\0', c} : std::string{c, '\0'};
  return result;
}

TEST_F(IoText, LinesEndInAnyOfThreeWays) {
  const AnimatedMesh mesh = load_animated_mesh({write("a.obj", quad), "", "", 0});
  ASSERT_EQ(mesh.primitive_count(), 2u);
  const AnimatedMesh face = load_animated_mesh({write("a.ply", ascii_ply), "", "", 0});
  ASSERT_EQ(face.primitive_count(), 1u);
  for (const std::string end : {"\r", "\r\n"})
    for (const std::string mark : {"", "\xEF\xBB\xBF"}) {
      const AnimatedMesh obj =
          load_animated_mesh({write("b.obj", mark + with_line_ends(quad, end)), "", "", 0});
      EXPECT_EQ(obj.kind, MeshKind::polygons);
      EXPECT_EQ(obj.positions, mesh.positions);
      EXPECT_EQ(obj.primitive_vertices, mesh.primitive_vertices);
      const AnimatedMesh ply =
          load_animated_mesh({write("b.ply", mark + with_line_ends(ascii_ply, end)), "", "", 0});
      EXPECT_EQ(ply.positions, face.positions);
      EXPECT_EQ(ply.primitive_vertices, face.primitive_vertices);
    }
  // Lines are counted the same way, even if one file has several kinds of them.
  expect_words(error_of(write("c.obj", "v 0 0 0\rv 1 0 0\r\nv 0 1 0\nf 1 2 9\r")), {"c.obj", "line 4", "9"});
  expect_words(
      error_of(write("c.ply", with_line_ends(ascii_ply, "\r").replace(ascii_ply.size() - 2, 1, "x"))),
      {"c.ply", "line 14", "'x'"});
}

TEST_F(IoText, ABinaryPlyMayBeginWithAByteThatLooksLikeALineEnd) {
  std::string header = ascii_ply.substr(0, ascii_ply.find("end_header"));
  header.replace(header.find("ascii"), 5, "binary_little_endian");
  header.replace(header.find("float x"), 7, "uchar x");
  for (const std::string end : {"\n", "\r", "\r\n"}) {
    std::string file = with_line_ends(header + "end_header\n", end);
    file += "\n" + bytes_of<float>({0, 0}) + "\r" + bytes_of<float>({1, 0}) + "\n" + bytes_of<float>({0, 1}) +
            "\x03" + bytes_of<std::int32_t>({0, 1, 2});
    const AnimatedMesh mesh = load_animated_mesh({write("d.ply", file), "", "", 0});
    EXPECT_EQ(mesh.positions, (std::vector<double>{10, 0, 0, 13, 1, 0, 10, 0, 1})) << end.size();
  }
}

TEST_F(IoText, Utf16IsNamedAsSuch) {
  const BendingStrip strip;
  for (const bool big : {false, true})
    for (const std::string mark : {"", big ? "\xFE\xFF" : "\xFF\xFE"})
      for (const auto& [name, text] : std::vector<std::pair<std::string, std::string>>{
               {"a.obj", quad}, {"a.ply", ascii_ply}, {"a.gltf", strip.builder.json(strip.body)}})
        expect_words(error_of(write(name, mark + utf16(text, big))), {name, "UTF-16", "save it as UTF-8"});
}

// --- JSON ---------------------------------------------------------------------------------------------

std::string json_error(const std::string& text) {
  try {
    parse_json_text(text, "a.json");
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

std::string nested(std::size_t depth, const std::string& inner) {
  std::string text = inner;
  for (std::size_t i = 0; i < depth; ++i) text = i % 2 == 0 ? "[" + text + "]" : "{\"k\": " + text + "}";
  return text;
}

TEST(IoJson, DepthIsLimited) {
  EXPECT_EQ(json_error(nested(deepest_json, "1")), "");
  EXPECT_EQ(json_error("\"" + std::string(100000, '[') + "\""), "");
  EXPECT_EQ(json_error(R"(["\"[[", "\\", [[["]"]]]])"), "");
  for (const std::size_t depth : {deepest_json + 1, std::size_t(100000), std::size_t(1000000)})
    expect_words(json_error(std::string(depth, '[') + std::string(depth, ']')),
                 {"a.json: line 1, column 257", "nested deeper than 256 levels"});
  expect_words(json_error(std::string(1000000, '[')), {"a.json", "nested deeper"});
  expect_words(json_error("{\"a\":\n" + nested(300, "1") + "}"), {"a.json: line 2", "nested deeper"});
}

TEST(IoJson, KeysAreGivenOnce) {
  EXPECT_EQ(json_error(R"({"a": {"a": 1}, "b": [{"a": 1}, {"a": "a"}], "c": "a", "d": ["a", "a"]})"), "");
  EXPECT_EQ(json_error("{\n  \"a\": 1,\n  \"b\": [],\n  \"a\": 2}"),
            "a.json: line 4, column 3: the key 'a' is given twice");
  expect_words(json_error(R"([1, {"b": {"x": 1, "y": {"x": 2}, "x": 3}}])"), {"column 35", "'x'"});
  expect_words(json_error(R"({"a\"": 1, "\u0061\u0022": 2})"), {"column 12", "given twice"});
  expect_words(json_error(R"({"": 1, "": 2})"), {"''"});
}

TEST(IoJson, ErrorsNameThePlace) {
  EXPECT_EQ(json_error("{\n  \"scenes\": ]\n}"), "a.json: line 2, column 13: this is not JSON");
  EXPECT_EQ(json_error("{\r  \"scenes\": ]\r}"), "a.json: line 2, column 13: this is not JSON");
  EXPECT_EQ(json_error("{\"a\": \"caf\xE9\"}"),
            "a.json: line 1, column 11: this is not JSON: the byte 0xE9 is not UTF-8");
  EXPECT_EQ(json_error("\xEF\xBB\xBF{}"), "");
  expect_words(json_error("[1e999]"), {"a.json", "too large for a double"});
  EXPECT_EQ(json_error(std::string("1\0", 2)), "a.json: line 1, column 2: this is not JSON: a NUL byte");
  EXPECT_EQ(json_error(std::string("{}\n\0, ]", 7)),
            "a.json: line 2, column 1: this is not JSON: a NUL byte");
  expect_words(json_error(std::string("[\"a\0\"]", 6)), {"a.json: line 1", "not JSON"});
  expect_words(json_error(utf16("{}", false)), {"a.json", "UTF-16"});
}

// Written texts are read back unchanged; damaged ones are refused in one sentence.
TEST(IoJson, RandomTextsAreReadOrRefused) {
  std::mt19937 random(1);
  const auto below = [&](unsigned n) { return unsigned(random()) % n; };
  for (int round = 0; round < 2000; ++round) {
    std::string text;
    for (unsigned i = 0, n = 1 + below(60); i < n; ++i) {
      constexpr const char* parts[] = {"{",         "}", "[",  "]",  ",",  ":", "\"a\"",
                                       "\"b\\\"\"", "1", "\"", "\\", "\n", "\0"};
      const unsigned part = below(13);
      text.append(parts[part], part == 12 ? 1 : std::string_view(parts[part]).size());
    }
    const std::string said = json_error(text);
    EXPECT_EQ(said.find('\n'), std::string::npos) << text;
    const bool says_twice = said.find("given twice") != std::string::npos;
    const bool is_json = nlohmann::json::accept(text) && text.find('\0') == std::string::npos;
    EXPECT_EQ(said.empty() || says_twice, is_json) << text;
  }
}

}  // namespace
}  // namespace kbvh::io::test::io_text_test
