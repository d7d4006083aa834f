#include "experiments/io/obj.hpp"

#include <charconv>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "experiments/io/bytes.hpp"
#include "experiments/io/number_text.hpp"
#include "experiments/io/obj_surfaces.hpp"
#include "experiments/io/primitives.hpp"

namespace kbvh::io {
namespace {

class ObjReader {
 public:
  explicit ObjReader(const std::filesystem::path& file)
      : file_(file), bytes_(read_text(file)), surfaces_(file) {}

  AnimatedMesh read() {
    std::string_view rest = bytes_;
    std::size_t next_line = 1;
    std::string joined;
    while (!rest.empty()) {
      line_ = next_line;
      std::string_view line = cut_line(rest, next_line);
      if (ends_in_backslash(line)) {
        joined.clear();
        while (ends_in_backslash(line)) {
          line.remove_suffix(1);
          joined.append(line).push_back(' ');
          line = cut_line(rest, next_line);
        }
        joined.append(line);
        line = joined;
      }
      read_statement(line.substr(0, line.find('#')));
    }
    check_forward_indices();
    if (mesh_.vertex_count == 0) fail(file_, "", "holds no vertices (no 'v' line)");
    finish_primitives();
    mesh_.name = file_.stem().string();
    mesh_.keyframe_times = {0.0};
    return std::move(mesh_);
  }

 private:
  static std::string_view cut_line(std::string_view& rest, std::size_t& line_number) {
    const std::size_t end = rest.find('\n');
    const std::string_view line = rest.substr(0, end);
    rest.remove_prefix(end == std::string_view::npos ? rest.size() : end + 1);
    ++line_number;
    return line;
  }

  static bool ends_in_backslash(std::string_view line) { return line.ends_with('\\'); }

  std::string place() const { return "line " + std::to_string(line_); }

  void read_statement(std::string_view line) {
    const std::string_view word = next_token(line);
    if (word == "v") {
      read_vertex(line);
    } else if (word == "f" || word == "fo") {
      read_face(line);
    } else if (word == "l") {
      has_lines_ = true;
    } else if (!surfaces_.take(word, line, line_, mesh_.vertex_count)) {
      // Any other word is skipped, so that vendors' statements do no harm; a word that is not text means that
      // this is not an OBJ file.
      for (char c : word) {
        if (static_cast<unsigned char>(c) < 32 || c == 127)
          fail(file_, place(), printable(word) + " is not text");
      }
    }
  }

  void read_vertex(std::string_view line) {
    if (mesh_.vertex_count == std::numeric_limits<std::uint32_t>::max())
      fail(file_, place(), "too many vertices");
    for (char name : {'x', 'y', 'z'}) {
      const std::string_view token = next_token(line);
      const std::string what = std::string("coordinate ") + name;
      if (token.empty())
        fail(file_, place(), "vertex " + std::to_string(mesh_.vertex_count + 1) + " has no " + what);
      const std::optional<double> value = parse_double(token);
      if (!value)
        fail(file_, place(), what + " is " + printable(token) + ", not a number that a double can hold");
      if (!std::isfinite(*value)) fail(file_, place(), what + " is " + text_of(*value));
      mesh_.positions.push_back(*value);
    }
    // A fourth number alone is a weight; three or four more are a colour.
    const std::string_view weight = next_token(line);
    if (!weight.empty() && next_token(line).empty()) {
      const std::optional<double> value = parse_double(weight);
      if (!value || !(*value > 0) || !std::isfinite(*value)) surfaces_.bad_weight(mesh_.vertex_count);
    }
    ++mesh_.vertex_count;
  }

  /// Sets the primitives: faces, or surfaces, or, without both, a cloud of points.
  void finish_primitives() {
    if (!surfaces_.empty()) {
      if (mesh_.primitive_count() > 0)
        fail(file_, "", "holds faces and surfaces; the primitives of a body are of one kind");
      surfaces_.add_to(mesh_);
    } else if (mesh_.primitive_count() == 0) {
      if (has_lines_) fail(file_, "", "holds lines, but no faces (no 'f' line)");
      make_points(mesh_);
    }
  }

  void read_face(std::string_view line) {
    std::size_t corners = 0;
    for (std::string_view token = next_token(line); !token.empty(); token = next_token(line), ++corners) {
      mesh_.primitive_vertices.push_back(read_corner(token));
    }
    if (corners < 3)
      fail(file_, place(), "a face of " + std::to_string(corners) + " vertices (3 are needed)");
    if (mesh_.primitive_vertices.size() > std::numeric_limits<std::uint32_t>::max()) {
      fail(file_, place(), "too many face corners");
    }
    mesh_.primitive_offsets.push_back(static_cast<std::uint32_t>(mesh_.primitive_vertices.size()));
  }

  std::uint32_t read_corner(std::string_view token) {
    const std::size_t slash = token.find('/');
    const std::optional<std::int64_t> index = parse_integer(token.substr(0, slash));
    if (!index || (slash != std::string_view::npos &&
                   token.substr(slash).find_first_not_of("/+-0123456789") != std::string_view::npos)) {
      fail(file_, place(), printable(token) + " is not a vertex index");
    }
    if (*index == 0) fail(file_, place(), "vertex index 0 (they count from 1)");
    const std::int64_t known = mesh_.vertex_count;
    if (*index < -known || *index > std::numeric_limits<std::uint32_t>::max()) out_of_range(line_, *index);
    if (*index > known) forward_.push_back({line_, *index});
    return static_cast<std::uint32_t>(*index < 0 ? known + *index : *index - 1);
  }

  void check_forward_indices() const {
    for (const Forward& f : forward_) {
      if (f.index > mesh_.vertex_count) out_of_range(f.line, f.index);
    }
  }

  [[noreturn]] void out_of_range(std::size_t line, std::int64_t index) const {
    fail(file_, "line " + std::to_string(line),
         "vertex index " + std::to_string(index) + " is out of range (" + std::to_string(mesh_.vertex_count) +
             " vertices)");
  }

  struct Forward {
    std::size_t line;
    std::int64_t index;
  };

  std::filesystem::path file_;
  std::string bytes_;
  std::size_t line_ = 0;
  std::vector<Forward> forward_;  // indices of vertices that follow later: legal, checked at the end
  ObjSurfaces surfaces_;
  bool has_lines_ = false;
  AnimatedMesh mesh_;
};

}  // namespace

AnimatedMesh read_obj(const std::filesystem::path& file) {
  return ObjReader(file).read();
}

void save_obj(const AnimatedMesh& mesh, const std::filesystem::path& file) {
  if (mesh.kind == MeshKind::control_nets) fail(file, "", "control nets are not written");
  std::string out;
  for (std::size_t v = 0; v < mesh.vertex_count; ++v) {
    out += 'v';
    for (std::size_t axis = 0; axis < 3; ++axis) out += ' ' + text_of(mesh.positions[3 * v + axis]);
    out += '\n';
  }
  for (std::size_t p = 0; p < mesh.primitive_count(); ++p) {
    out += mesh.kind == MeshKind::points ? 'p' : 'f';
    for (std::size_t c = mesh.primitive_offsets[p]; c < mesh.primitive_offsets[p + 1]; ++c) {
      out += ' ' + std::to_string(std::uint64_t{mesh.primitive_vertices[c]} + 1);
    }
    out += '\n';
  }
  write_file_atomically(file, out);
}

}  // namespace kbvh::io
