#include "experiments/study/impact_queries.hpp"

#include <algorithm>
#include <boost/multiprecision/cpp_int.hpp>
#include <cmath>

#include "core/contract/registry.hpp"
#include "core/motion/admissible.hpp"
#include "experiments/common/json_reader.hpp"
#include "experiments/common/names.hpp"
#include "experiments/common/text.hpp"
#include "experiments/io/bytes.hpp"
#include "experiments/io/ply.hpp"
#include "experiments/io/validate.hpp"

namespace kbvh::experiments {

namespace fs = std::filesystem;
using boost::multiprecision::cpp_int;

namespace {

std::optional<Contact::Kind> kind_named(const std::string& name) {
  // Matches a whole word of the name, not letters within one: sheets and knees are no edges.
  const auto has = [&](const std::string& word) {
    const auto letter = [&](std::size_t at) {
      return at < name.size() && std::isalpha(static_cast<unsigned char>(name[at])) != 0;
    };
    for (std::size_t at = name.find(word); at != std::string::npos; at = name.find(word, at + 1))
      if ((at == 0 || !letter(at - 1)) && !letter(at + word.size())) return true;
    return false;
  };
  if (has("vertex-face") || has("vf")) return Contact::Kind::vertex_face;
  if (has("edge-edge") || has("ee")) return Contact::Kind::edge_edge;
  return {};
}

const char* kind_word(Contact::Kind kind) {
  return kind == Contact::Kind::vertex_face ? "vertex-face" : "edge-edge";
}

bool is_integer(const std::string& text) {
  const std::size_t digits = text.starts_with('-') ? 1 : 0;
  return text.size() > digits && text.size() < 2000 &&
         std::all_of(text.begin() + std::ptrdiff_t(digits), text.end(),
                     [](char c) { return c >= '0' && c <= '9'; });
}

/// Returns a quotient that is exactly a double; nothing otherwise.
std::optional<double> exact_quotient(const std::string& top, const std::string& bottom) {
  if (!is_integer(top) || !is_integer(bottom)) return {};
  // A number with a leading zero would be read as octal.
  const auto decimal = [](const std::string& text) {
    const bool negative = text.starts_with('-');
    const std::size_t first = std::min(text.find_first_not_of('0', negative ? 1 : 0), text.size() - 1);
    const cpp_int value(text.substr(first));
    return negative ? cpp_int(-value) : value;
  };
  const cpp_int numerator = decimal(top), denominator = decimal(bottom);
  if (denominator <= 0) return {};
  const cpp_int divisor = gcd(numerator, denominator);
  cpp_int odd = numerator / divisor, power = denominator / divisor;
  if (odd == 0) return 0.0;
  const int down = int(lsb(power));
  if (power != cpp_int(1) << unsigned(down)) return {};
  const int up = int(lsb(abs(odd)));
  odd /= cpp_int(1) << unsigned(up);
  if (msb(abs(odd)) >= 53) return {};
  const double value = std::ldexp(odd.convert_to<double>(), up - down);
  // Too small or too large for its exponent: it would have been rounded.
  if (!std::isfinite(value) || std::ldexp(value, down - up) != odd.convert_to<double>()) return {};
  return value;
}

std::vector<fs::path> files_in(const fs::path& folder, const std::string& extension) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(folder))
    if (std::error_code error; entry.is_regular_file(error) && entry.path().extension() == extension)
      files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  return files;
}

/// Returns the file of a kind, by the part of its name before `suffix`.
fs::path file_of_kind(const fs::path& folder, const std::string& ending) {
  for (const fs::path& file : files_in(folder, ".json"))
    if (file.filename().string().ends_with(ending)) return file;
  io::fail(folder, "", "has no file *" + ending);
}

}  // namespace

ImpactQueries read_impact_queries(const fs::path& file) {
  std::optional<Contact::Kind> kind = kind_named(file.parent_path().filename().string());
  if (const auto own = kind_named(file.stem().string())) kind = own;
  if (!kind)
    io::fail(file, "", "neither its name nor its folder's name contains vertex-face (vf) or edge-edge (ee)");
  ImpactQueries result{readable(file.stem().string()), {}};
  const std::string text = io::read_text(file);
  std::uint64_t rows = 0, line = 0;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    std::string row = text.substr(begin, end - begin);
    begin = end + 1;
    ++line;
    while (!row.empty() && (row.back() == '\r' || row.back() == ' ')) row.pop_back();
    if (row.empty()) continue;
    const std::string place = "line " + std::to_string(line);
    const std::vector<std::string> cells = split(row, ',');
    if (cells.size() != 6 && cells.size() != 7)
      io::fail(file, place, "expected 6 or 7 columns, got " + std::to_string(cells.size()));
    if (rows % 8 == 0) {
      result.queries.emplace_back();
      result.queries.back().kind = *kind;
    }
    ImpactQuery& query = result.queries.back();
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto value = exact_quotient(cells[2 * axis], cells[2 * axis + 1]);
      if (!value)
        io::fail(
            file, place,
            io::printable(cells[2 * axis]) + " / " + io::printable(cells[2 * axis + 1]) + " is not a double");
      if (std::abs(*value) > admissible_magnitude<double>)
        io::fail(file, place, number_text(*value) + " is beyond the limit of 1e+100");
      query.points[rows % 8 / 4][rows % 4][axis] = *value;
    }
    if (cells.size() == 7) {
      if (cells[6] != "0" && cells[6] != "1") io::fail(file, place, "the verdict is neither 0 nor 1");
      if (rows % 8 != 0 && query.truth != (cells[6] == "1"))
        io::fail(file, place, "the verdict differs from that of the query's first row");
      query.truth = cells[6] == "1";
    }
    ++rows;
  }
  if (rows % 8 != 0)
    io::fail(file, "", "has " + std::to_string(rows) + " rows, which is not a multiple of 8");
  return result;
}

bool is_frame_pair(const fs::path& folder) {
  return fs::is_directory(folder / "frames") && fs::is_directory(folder / "boxes") &&
         fs::is_directory(folder / "mma_bool");
}

FramePair read_frame_pair(const fs::path& folder) {
  FramePair pair;
  pair.name = readable(folder.filename().string());
  const std::vector<fs::path> frames = files_in(folder / "frames", ".ply");
  if (frames.size() != 2) io::fail(folder / "frames", "", "expected two PLY files");
  for (int end = 0; end < 2; ++end) {
    const fs::path& file = frames[std::size_t(end)];
    io::AnimatedMesh mesh = io::read_ply(file);
    io::finish(mesh, file);
    pair.positions[end] = std::move(mesh.positions);
    if (end == 1) continue;
    for (std::size_t p = 0; p < mesh.primitive_count(); ++p) {
      const std::size_t first = mesh.primitive_offsets[p];
      if (mesh.primitive_offsets[p + 1] != first + 3)
        io::fail(frames[0], "", "has a face that is not a triangle");
      pair.faces.push_back({mesh.primitive_vertices[first], mesh.primitive_vertices[first + 1],
                            mesh.primitive_vertices[first + 2]});
    }
  }
  if (pair.positions[0].size() != pair.positions[1].size())
    io::fail(folder / "frames", "", "the two frames have different numbers of vertices");
  for (const auto& face : pair.faces)
    for (std::size_t i = 0; i < 3; ++i) {
      const std::uint32_t a = face[i], b = face[(i + 1) % 3];
      pair.edges.push_back({std::min(a, b), std::max(a, b)});
    }
  std::sort(pair.edges.begin(), pair.edges.end(),
            [](const auto& a, const auto& b) { return std::pair(a[1], a[0]) < std::pair(b[1], b[0]); });
  pair.edges.erase(std::unique(pair.edges.begin(), pair.edges.end()), pair.edges.end());
  const std::uint64_t vertices = pair.positions[0].size() / 3, edges = pair.edges.size();
  for (const Contact::Kind kind : {Contact::Kind::vertex_face, Contact::Kind::edge_edge}) {
    const bool faces = kind == Contact::Kind::vertex_face;
    const std::string ending = faces ? "vf" : "ee";
    const fs::path boxes = file_of_kind(folder / "boxes", ending + ".json");
    const fs::path verdicts = file_of_kind(folder / "mma_bool", ending + "_mma_bool.json");
    const auto ids = parse_json(io::read_file(boxes), boxes.string());
    const auto touch = parse_json(io::read_file(verdicts), verdicts.string());
    if (!ids.is_array() || !touch.is_array() || ids.size() != touch.size())
      io::fail(boxes, "", "is not a list with as many pairs as " + verdicts.string() + " has verdicts");
    for (std::size_t i = 0; i < ids.size(); ++i) {
      const std::string place = "pair " + std::to_string(i);
      if (!ids[i].is_array() || ids[i].size() != 2 || !ids[i][0].is_number_unsigned() ||
          !ids[i][1].is_number_unsigned() || !touch[i].is_boolean())
        io::fail(boxes, place, "is not a pair of ids with a verdict");
      const std::uint64_t a = ids[i][0].get<std::uint64_t>(), b = ids[i][1].get<std::uint64_t>();
      const std::uint64_t offset_a = faces ? 0 : vertices, offset_b = faces ? vertices + edges : vertices;
      const std::uint64_t count_a = faces ? vertices : edges, count_b = faces ? pair.faces.size() : edges;
      if (a < offset_a || a - offset_a >= count_a || b < offset_b || b - offset_b >= count_b)
        io::fail(boxes, place, std::string("has an id that is none of a ") + kind_word(kind) + " pair");
      pair.listed.push_back(
          {kind, std::uint32_t(a - offset_a), std::uint32_t(b - offset_b), touch[i].get<bool>()});
    }
  }
  return pair;
}

ImpactQuery FramePair::query(const Listed& pair) const {
  const std::array<std::uint32_t, 4> vertices = corners(pair.kind, pair.first, pair.second);
  ImpactQuery query;
  query.kind = pair.kind;
  query.truth = pair.touches;
  for (std::size_t end = 0; end < 2; ++end)
    for (std::size_t i = 0; i < 4; ++i)
      std::copy_n(positions[end].begin() + std::ptrdiff_t(3) * vertices[i], 3, query.points[end][i]);
  return query;
}

namespace {

/// Like `find_impact_queries`; `above` are the folders that contain `path`, so that a link to one of them
/// does not recurse.
std::vector<ImpactQueries> find_below(const fs::path& path, std::vector<fs::path>& above) {
  std::vector<ImpactQueries> found;
  std::error_code problem;
  const fs::file_status status = fs::status(path, problem);
  if (!fs::exists(status))
    io::fail(path, "", status.type() == fs::file_type::none ? problem.message() : "does not exist");
  if (fs::is_directory(status) && is_frame_pair(path)) {
    const FramePair pair = read_frame_pair(path);
    for (const Contact::Kind kind : {Contact::Kind::vertex_face, Contact::Kind::edge_edge}) {
      found.push_back({pair.name + "/" + kind_word(kind), {}});
      for (const auto& listed : pair.listed)
        if (listed.kind == kind) found.back().queries.push_back(pair.query(listed));
    }
  } else if (fs::is_directory(status)) {
    std::error_code error;  // of a dangling link, which is not a folder
    std::vector<fs::path> inside;
    for (const auto& entry : fs::directory_iterator(path))
      if (entry.is_directory(error) || entry.path().extension() == ".csv") inside.push_back(entry.path());
    above.push_back(fs::canonical(path));
    std::sort(inside.begin(), inside.end());
    for (const fs::path& next : inside) {
      if (std::find(above.begin(), above.end(), fs::canonical(next)) != above.end()) continue;
      for (ImpactQueries& queries : find_below(next, above)) {
        queries.name = path.filename().string() + "/" + queries.name;
        found.push_back(std::move(queries));
      }
    }
    above.pop_back();
  } else {
    found.push_back(read_impact_queries(path));
  }
  return found;
}

}  // namespace

std::vector<ImpactQueries> find_impact_queries(const fs::path& path) {
  std::vector<fs::path> above;
  try {
    return find_below(path, above);
  } catch (const fs::filesystem_error& problem) {
    io::fail(problem.path1(), "", problem.code().message());
  }
}

std::vector<ImpactPeer> impact_peers() {
  std::vector<ImpactPeer> found;
  for (const StrategyEntry& entry : registry())
    if (entry.info.own_impact != nullptr) found.push_back({entry.info.id, entry.info.own_impact});
  return found;
}

}  // namespace kbvh::experiments
