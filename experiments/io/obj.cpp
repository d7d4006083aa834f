#include "experiments/io/obj.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <string>
#include <vector>

#include "experiments/io/bytes.hpp"
#include "experiments/io/number_text.hpp"
#include "experiments/io/obj_surfaces.hpp"
#include "experiments/io/primitives.hpp"

namespace kbvh::io {
namespace {

/// Tests for statements whose arguments are numbers. Only these continue in the next line after a backslash:
/// a name may end in one.
bool has_numbers(std::string_view word) {
  static const std::set<std::string_view> words{"v",     "vt",   "vn",   "vp",   "p",    "l",    "f",
                                                "fo",    "curv", "surf", "parm", "trim", "hole", "scrv",
                                                "curv2", "sp",   "con",  "deg",  "bmat", "step"};
  return words.contains(word);
}

/// Tests for statements that do not affect the shape of polygons, or belong to curves.
bool may_be_skipped(std::string_view word) {
  static const std::set<std::string_view> words{
      "vt",       "vn",       "vp",     "g",     "s",          "o",         "mg",  "usemtl",
      "mtllib",   "usemap",   "maplib", "bevel", "shadow_obj", "trace_obj", "lod", "stech",
      "c_interp", "d_interp", "ctech",  "bmat",  "step",       "con",       "end"};
  return words.contains(word);
}

std::string_view without_comment(std::string_view line) {
  return line.substr(0, line.find('#'));
}

class ObjReader {
 public:
  explicit ObjReader(const std::filesystem::path& file)
      : file_(file), bytes_(read_text(file)), surfaces_(file) {}

  AnimatedMesh read() {
    std::string_view rest = bytes_;
    while (!rest.empty()) {
      line_ = next_line_;
      read_statement(next_statement(rest));
    }
    check_forward_indices();
    if (mesh_.vertex_count == 0) fail(file_, "", "holds no vertices (no 'v' line)");
    finish_primitives();
    mesh_.name = file_.stem().string();
    mesh_.keyframe_times = {0.0};
    return std::move(mesh_);
  }

 private:
  std::string_view cut_line(std::string_view& rest) {
    const std::size_t end = rest.find('\n');
    const std::string_view line = rest.substr(0, end);
    rest.remove_prefix(end == std::string_view::npos ? rest.size() : end + 1);
    ++next_line_;
    return line;
  }

  /// Removes the backslash that continues a line in the next one, and returns whether there was one. Comments
  /// do not continue.
  static bool take_backslash(std::string_view& line) {
    const std::size_t last = line.find_last_not_of(" \t\v\f");
    if (last == std::string_view::npos || line[last] != '\\' || line.find('#') != std::string_view::npos)
      return false;
    line = line.substr(0, last);
    return true;
  }

  /// Cuts off the next statement, without its comment: a line, and the lines in which its numbers continue.
  std::string_view next_statement(std::string_view& rest) {
    const std::string_view first = cut_line(rest);
    std::string_view line = first, words = first;
    if (!take_backslash(line)) return without_comment(first);
    words = line;
    if (!has_numbers(next_token(words))) return first;
    joined_.clear();
    bool goes_on = true;
    while (goes_on) {
      joined_.append(line).push_back(' ');
      if (rest.empty()) fail(file_, place(), "ends in '\\', but no line follows");
      const std::size_t here = next_line_;
      line = cut_line(rest);
      goes_on = take_backslash(line);
      line = without_comment(line);
      words = line;
      const std::string_view token = next_token(words);
      if (!token.empty() && std::string_view("0123456789+-.").find(token[0]) == std::string_view::npos)
        fail(file_, "line " + std::to_string(here),
             "begins with " + printable(token) +
                 ", but the line before it ends in '\\', so numbers go on here");
    }
    joined_.append(line);
    return joined_;
  }

  std::string place() const { return "line " + std::to_string(line_); }

  void read_statement(std::string_view line) {
    const std::string_view word = next_token(line);
    if (word == "v") {
      read_vertex(line);
    } else if (word == "f" || word == "fo") {
      read_face(line);
    } else if (word == "p") {
      read_points(line);
    } else if (word == "l") {
      ++lines_;
    } else if (word == "call") {
      fail(file_, place(), "'call' includes another file, which is not supported");
    } else if (!word.empty()) {
      if (word == "curv" || word == "curv2") ++curves_;
      if (!surfaces_.take(word, line, line_, mesh_.vertex_count) && !may_be_skipped(word)) skip_unknown(word);
    }
  }

  /// Skips a vendor's statement. A line that does not begin with a word of letters is no statement: it is
  /// damaged, or the file is of another kind.
  void skip_unknown(std::string_view word) {
    const auto is_control = [](char c) { return static_cast<unsigned char>(c) < 32 || c == 127; };
    const auto is_letter = [](char c) {
      return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_';
    };
    if (std::any_of(word.begin(), word.end(), is_control))
      fail(file_, place(), printable(word) + " is not text");
    if (!std::all_of(word.begin(), word.end(), is_letter))
      fail(file_, place(), "begins with " + printable(word) + ", which is not a statement of OBJ");
    if (unknown_++ == 0) first_unknown_ = printable(word) + " in " + place();
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
    std::size_t more = 0;
    double weight = 1;
    for (std::string_view token = next_token(line); !token.empty(); token = next_token(line), ++more) {
      const std::optional<double> value = parse_double(token);
      if (!value) fail(file_, place(), printable(token) + " behind the coordinates is not a number");
      if (more == 0) weight = *value;
    }
    if (more == 2 || more > 4)
      fail(file_, place(),
           "a vertex of " + std::to_string(3 + more) +
               " numbers (3 are a position, 4 have a weight, 6 or 7 a colour)");
    if (more == 1 && (!(weight > 0) || !std::isfinite(weight))) surfaces_.bad_weight(mesh_.vertex_count);
    ++mesh_.vertex_count;
  }

  /// Sets the primitives: faces, or surfaces, or points; without any, every vertex is a point.
  void finish_primitives() {
    const bool has_faces = mesh_.primitive_count() > 0;
    if (has_faces && !surfaces_.empty())
      fail(file_, "", "holds faces and surfaces; the primitives of a body are of one kind");
    if (!has_faces && surfaces_.empty() && points_.empty()) {
      if (lines_ > 0) fail(file_, "", "holds lines, but no faces (no 'f' line)");
      make_points(mesh_);
    } else if (!has_faces && surfaces_.empty()) {
      mesh_.kind = MeshKind::points;
      mesh_.primitive_vertices = std::move(points_);
      for (std::size_t p = 1; p <= mesh_.primitive_vertices.size(); ++p)
        mesh_.primitive_offsets.push_back(static_cast<std::uint32_t>(p));
    } else {
      if (!surfaces_.empty()) surfaces_.add_to(mesh_);
      note_skipped(points_.size(), "point", "p");
    }
    note_skipped(lines_, "polyline", "l");
    note_skipped(curves_, "curve", "curv");
    if (unknown_ > 0)
      mesh_.notes.push_back("skipped " + std::to_string(unknown_) + (unknown_ == 1 ? " line" : " lines") +
                            " of unknown statements, first " + first_unknown_);
  }

  void note_skipped(std::size_t count, const std::string& what, const std::string& word) {
    if (count == 0) return;
    mesh_.notes.push_back("skipped " + std::to_string(count) + " " + what + (count == 1 ? "" : "s") + " (" +
                          word + ")");
  }

  void read_points(std::string_view line) {
    std::size_t count = 0;
    for (std::string_view token = next_token(line); !token.empty(); token = next_token(line), ++count)
      points_.push_back(read_corner(token));
    if (count == 0) fail(file_, place(), "a 'p' statement without a vertex");
    if (points_.size() > std::numeric_limits<std::uint32_t>::max()) fail(file_, place(), "too many points");
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
    const std::optional<std::int64_t> index = parse_corner(token);
    if (!index) fail(file_, place(), printable(token) + " is not a vertex index");
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
  std::size_t line_ = 0, next_line_ = 1;  // of the current statement, of the next one
  std::string joined_;                    // a statement of several lines
  std::vector<Forward> forward_;          // indices of vertices that follow later: legal, checked at the end
  ObjSurfaces surfaces_;
  std::vector<std::uint32_t> points_;  // of 'p' statements
  std::size_t lines_ = 0, curves_ = 0, unknown_ = 0;
  std::string first_unknown_;
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
