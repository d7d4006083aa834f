// The same file with other line ends, other comments and names, and numbers continued in the next line is the
// same mesh: random texts of OBJ and ASCII PLY, seeded.
#include <random>

#include "io_test_support.hpp"

namespace kbvh::io::test::io_line_ends_test {
namespace {

class Writer {
 public:
  explicit Writer(unsigned seed) : random_(seed) {}

  unsigned below(unsigned n) { return unsigned(random_()) % n; }
  bool sometimes() { return below(4) == 0; }

  /// The statements of a mesh, one a string, without line ends.
  std::vector<std::string> obj() {
    std::vector<std::string> lines;
    unsigned vertices = 0;
    for (unsigned i = 0, n = 4 + below(12); i < n; ++i) {
      if (vertices < 3 || below(2) == 0) {
        lines.push_back("v " + number() + " " + number() + " " + number() + (sometimes() ? " 1" : ""));
        ++vertices;
        continue;
      }
      std::string face = "f";
      for (unsigned c = 0, corners = 3 + below(3); c < corners; ++c)
        face += " " +
                (below(2) == 0 ? std::to_string(1 + below(vertices))
                               : "-" + std::to_string(1 + below(vertices))) +
                (sometimes() ? "/1" : "");
      lines.push_back(face);
    }
    if (vertices >= 3) lines.push_back("f 1 2 3");
    return lines;
  }

  /// The same statements, as another program might write them.
  std::string varied(const std::vector<std::string>& lines) {
    constexpr const char* between[] = {"# a\\b\\",    "#",     "g one\\two\\", "usemtl m\\",
                                       "o C:\\",      "",      "\t",           "vn 0 0 1",
                                       "vt 0 \\\n 1", "s off", "# v 7 7 7",    "vn 0 \\\n0 1"};
    std::string text = sometimes() ? "\xEF\xBB\xBF" : "";
    for (const std::string& line : lines) {
      while (sometimes()) text += std::string(between[below(std::size(between))]) + "\n";
      for (const char c : line) {
        text += c;
        if (c != ' ') continue;
        if (sometimes()) text += "\t ";
        if (below(6) == 0) text += "\\\n";
      }
      text += sometimes() ? " # tail \\\n" : "\n";
    }
    return text;
  }

  /// The text with line ends of one kind, or of any.
  std::string ended(const std::string& text, bool mixed) {
    constexpr const char* ends[] = {"\n", "\r\n", "\r"};
    const unsigned kind = below(3);
    std::string out;
    for (const char c : text) out += c == '\n' ? ends[mixed ? below(3) : kind] : std::string(1, c);
    const auto last = out.find_last_not_of("\r\n");
    if (sometimes() && last != std::string::npos && out[last] != '\\') out.resize(last + 1);
    return out;
  }

  std::string number() {
    constexpr const char* numbers[] = {"0", "1", "-2.5", "+3e-2", ".5", "1e5", "0.1", "7"};
    return numbers[below(std::size(numbers))];
  }

 private:
  std::mt19937 random_;
};

class IoLineEnds : public IoTest {
 protected:
  AnimatedMesh load(const std::string& name, const std::string& text) const {
    return load_animated_mesh({write(name, text), "", "", 0});
  }
};

void expect_same(const AnimatedMesh& a, const AnimatedMesh& b) {
  EXPECT_EQ(a.positions, b.positions);
  EXPECT_EQ(a.primitive_offsets, b.primitive_offsets);
  EXPECT_EQ(a.primitive_vertices, b.primitive_vertices);
}

TEST_F(IoLineEnds, Obj) {
  for (unsigned seed = 0; seed < 400; ++seed) {
    Writer writer(seed);
    const auto lines = writer.obj();
    std::string plain;
    for (const std::string& line : lines) plain += line + "\n";
    const AnimatedMesh mesh = load("plain.obj", plain);
    for (int variant = 0; variant < 3; ++variant) {
      const std::string text = writer.ended(writer.varied(lines), variant == 2);
      SCOPED_TRACE("seed " + std::to_string(seed) + ":\n" + text);
      const AnimatedMesh other = load("other.obj", text);
      expect_same(mesh, other);
      EXPECT_TRUE(other.notes.empty());
      if (HasFailure()) return;
    }
  }
}

TEST_F(IoLineEnds, Ply) {
  for (unsigned seed = 0; seed < 300; ++seed) {
    Writer writer(seed);
    const unsigned vertices = 3 + writer.below(5), faces = 1 + writer.below(4);
    const std::string header = "ply\nformat ascii 1.0\nelement vertex " + std::to_string(vertices) +
                               "\nproperty float x\nproperty double y\nproperty list uchar int w\n"
                               "property float z\nelement face " +
                               std::to_string(faces) +
                               "\nproperty list uchar int vertex_indices\nend_header\n";
    std::vector<std::string> rows;
    for (unsigned v = 0; v < vertices; ++v)
      rows.push_back(writer.number() + " " + writer.number() + (writer.sometimes() ? " 2 7 7 " : " 0 ") +
                     writer.number());
    for (unsigned f = 0; f < faces; ++f) {
      const unsigned corners = 3 + writer.below(3);
      std::string row = std::to_string(corners);
      for (unsigned c = 0; c < corners; ++c) row += " " + std::to_string(writer.below(vertices));
      rows.push_back(row);
    }
    std::string plain = header, varied = header;
    std::size_t over_several = 0;
    for (const std::string& row : rows) {
      plain += row + "\n";
      bool several = false;
      for (const char c : row) {
        const bool breaks = c == ' ' && writer.below(6) == 0;
        several = several || breaks;
        varied += breaks ? '\n' : c;
      }
      varied += writer.sometimes() ? " \t\n\n" : "\n";
      over_several += several ? 1 : 0;
    }
    const std::string text = writer.ended(varied, false);
    SCOPED_TRACE("seed " + std::to_string(seed) + ":\n" + text);
    const AnimatedMesh other = load("other.ply", text);
    expect_same(load("plain.ply", plain), other);
    ASSERT_EQ(other.notes.size(), over_several > 0 ? 1u : 0u);
    if (over_several > 0) expect_words(other.notes[0], {std::to_string(over_several) + " of its elements"});
    if (HasFailure()) return;
    // One value less on one line of the body and one more on another: never accepted, because values would
    // shift.
    std::vector<std::string> bad = rows;
    const std::size_t at = writer.below(vertices - 1);
    bad[at].resize(bad[at].find_last_of(' '));
    bad[at + 1] += " 0";
    std::string shifted = header;
    for (const std::string& row : bad) shifted += row + "\n";
    expect_words(error_of(write("shifted.ply", shifted)), {"vertex " + std::to_string(at)});
  }
}

}  // namespace
}  // namespace kbvh::io::test::io_line_ends_test
