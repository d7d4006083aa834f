#include "experiments/io/ply.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "experiments/io/bytes.hpp"
#include "experiments/io/number_text.hpp"
#include "experiments/io/ply_header.hpp"
#include "experiments/io/primitives.hpp"

namespace kbvh::io {
namespace {

using namespace ply;

bool fits(Type type, double value) {
  if (type >= Type::float32) return true;
  const bool is_signed = type == Type::int8 || type == Type::int16 || type == Type::int32;
  const int bits = 8 * int(type_bytes[static_cast<std::size_t>(type)]) - (is_signed ? 1 : 0);
  const double end = std::ldexp(1.0, bits);
  return value == std::floor(value) && value < end && value >= (is_signed ? -end : 0);
}

class PlyReader {
 public:
  explicit PlyReader(const std::filesystem::path& file)
      : file_(file), bytes_(read_file(file)), header_(read_header(file, bytes_)) {}

  AnimatedMesh read() {
    for (const Element& element : header_.elements) read_element(element);
    check_end();
    if (mesh_.vertex_count == 0) fail(file_, "", "holds no vertices");
    if (mesh_.primitive_count() == 0) {
      for (const Element& e : header_.elements)
        if (e.count > 0 && (e.name == "edge" || e.name == "tristrips"))
          fail(file_, "", "holds " + e.name + (e.name == "edge" ? "s" : "") + ", but no face");
      make_points(mesh_);
    }
    check_indices();
    add_notes();
    mesh_.name = file_.stem().string();
    mesh_.keyframe_times = {0.0};
    return std::move(mesh_);
  }

 private:
  // ---- body

  std::string place_of(const Element& element, std::uint64_t i) const {
    const std::string place = element.name + " " + std::to_string(i);
    return header_.format == Format::ascii ? "line " + std::to_string(line_) + ", " + place : place;
  }

  void check_room(const Element& element) const {
    // Checked before any allocation: the elements promised by the header need at least this many bytes.
    std::uint64_t least = 0;
    for (const Property& p : element.properties) {
      least += header_.format == Format::ascii
                   ? 1
                   : type_bytes[static_cast<std::size_t>(p.is_list ? p.count_type : p.type)];
    }
    const std::uint64_t left = bytes_.size() - at_;
    if (least > 0 && element.count > left / least) {
      fail(file_, "element " + element.name,
           "the header says " + std::to_string(element.count) + ", which take at least " +
               std::to_string(least) + " bytes each, but only " + std::to_string(left) + " bytes are left");
    }
    if (element.count > std::numeric_limits<std::uint32_t>::max()) {
      fail(file_, "element " + element.name, "a count of " + std::to_string(element.count) + " is too large");
    }
  }

  void read_element(const Element& element) {
    check_room(element);
    if (element.name == "vertex") {
      read_vertices(element);
    } else if (element.name == "face") {
      read_polygons(element);
    } else if (element.name == "tristrips") {
      read_strips(element);
    } else if (!element.properties.empty()) {
      for (std::uint64_t i = 0; i < element.count; ++i) {
        begin_row(element, i);
        for (const Property& p : element.properties) skip(p, element, i);
      }
    }
  }

  void read_vertices(const Element& element) {
    std::vector<int> axis_of;
    std::array<bool, 3> seen{};
    for (const Property& p : element.properties) {
      const int axis =
          !p.is_list && p.name.size() == 1 && p.name[0] >= 'x' && p.name[0] <= 'z' ? p.name[0] - 'x' : -1;
      if (axis >= 0 && seen[static_cast<std::size_t>(axis)])
        fail(file_, "element vertex", "has two properties " + p.name);
      if (axis >= 0) seen[static_cast<std::size_t>(axis)] = true;
      axis_of.push_back(axis);
    }
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (!seen[axis]) fail(file_, "element vertex", std::string("has no property ") + "xyz"[axis]);
    }
    if (mesh_.vertex_count > 0) fail(file_, "element vertex", "occurs twice");
    mesh_.vertex_count = static_cast<std::uint32_t>(element.count);
    mesh_.positions.resize(3 * element.count);
    for (std::uint64_t i = 0; i < element.count; ++i) {
      begin_row(element, i);
      for (std::size_t p = 0; p < axis_of.size(); ++p) {
        const Property& property = element.properties[p];
        if (axis_of[p] < 0) {
          skip(property, element, i);
          continue;
        }
        const double value = read_number(property.type, element, i);
        if (!std::isfinite(value))
          fail(file_, place_of(element, i), "coordinate " + property.name + " is " + text_of(value));
        mesh_.positions[3 * i + static_cast<std::size_t>(axis_of[p])] = value;
      }
    }
  }

  static std::string names_of(const std::vector<Property>& properties) {
    if (properties.empty()) return "nothing";
    std::string names;
    for (const Property& p : properties)
      names += (names.empty() ? "" : ", ") + std::string(p.is_list ? "the list " : "the number ") + p.name;
    return names;
  }

  bool is_index_list(const Property& p) const {
    return p.is_list && (p.name == "vertex_indices" || p.name == "vertex_index");
  }

  /// Calls use(element number, list) for each element's list of vertex indices.
  template <class Use>
  void read_lists(const Element& element, Use use) {
    const auto lists = std::count_if(element.properties.begin(), element.properties.end(),
                                     [&](const Property& p) { return is_index_list(p); });
    if (lists > 1) fail(file_, "element " + element.name, "has two lists of vertex indices");
    if (lists == 0 && element.count > 0)
      fail(file_, "element " + element.name,
           "has no list vertex_indices, only " + names_of(element.properties));
    std::vector<std::int64_t> list;
    for (std::uint64_t i = 0; i < element.count; ++i) {
      begin_row(element, i);
      for (const Property& p : element.properties) {
        if (!is_index_list(p)) {
          skip(p, element, i);
          continue;
        }
        list.resize(read_count(p, element, i));
        for (std::int64_t& index : list) index = read_integer(p.type, element, i);
        use(i, list);
      }
    }
  }

  void read_polygons(const Element& element) {
    read_lists(element, [&](std::uint64_t i, const std::vector<std::int64_t>& list) {
      if (list.size() < 3) {
        fail(file_, place_of(element, i),
             "a face of " + std::to_string(list.size()) + " vertices (3 are needed)");
      }
      for (std::int64_t index : list) push_corner(element, i, index);
      end_primitive(element, i);
    });
  }

  void read_strips(const Element& element) {
    read_lists(element, [&](std::uint64_t i, const std::vector<std::int64_t>& list) {
      std::size_t start = 0;
      for (std::size_t k = 0; k <= list.size(); ++k) {
        if (k == list.size() || list[k] == -1) {
          if (k > start && k < start + 3)
            fail(file_, place_of(element, i),
                 "a strip of " + std::to_string(k - start) + " vertices (3 are needed)");
          start = k + 1;
          continue;
        }
        if (k < start + 2) continue;
        const bool odd = (k - start) % 2 == 1;  // every second triangle of a strip has reversed orientation
        push_corner(element, i, list[odd ? k - 1 : k - 2]);
        push_corner(element, i, list[odd ? k - 2 : k - 1]);
        push_corner(element, i, list[k]);
        end_primitive(element, i);
      }
    });
  }

  void push_corner(const Element& element, std::uint64_t i, std::int64_t index) {
    // Compared with the number of vertices at the end: faces may come first.
    if (index < 0 || index > std::numeric_limits<std::uint32_t>::max()) {
      fail(file_, place_of(element, i), "vertex index " + std::to_string(index) + " is out of range");
    }
    mesh_.primitive_vertices.push_back(static_cast<std::uint32_t>(index));
  }

  void end_primitive(const Element& element, std::uint64_t i) {
    if (mesh_.primitive_vertices.size() > std::numeric_limits<std::uint32_t>::max()) {
      fail(file_, place_of(element, i), "too many face corners");
    }
    mesh_.primitive_offsets.push_back(static_cast<std::uint32_t>(mesh_.primitive_vertices.size()));
  }

  void check_indices() const {
    for (std::size_t p = 0; p < mesh_.primitive_count(); ++p) {
      for (std::size_t c = mesh_.primitive_offsets[p]; c < mesh_.primitive_offsets[p + 1]; ++c) {
        if (mesh_.primitive_vertices[c] >= mesh_.vertex_count) {
          fail(file_, "face " + std::to_string(p),
               "vertex index " + std::to_string(mesh_.primitive_vertices[c]) + " is out of range (" +
                   std::to_string(mesh_.vertex_count) + " vertices)");
        }
      }
    }
  }

  /// Refuses data after the last element: then the header's counts are too small.
  void check_end() const {
    const std::string_view blanks(" \t\r\n\v\f\0", 7);
    const std::size_t more = bytes_.find_first_not_of(blanks, at_);
    if (more == std::string::npos) return;
    fail(file_,
         header_.format == Format::ascii ? place_in_text(bytes_, more) : "byte " + std::to_string(more),
         "data behind the last element that the header counts");
  }

  void add_notes() {
    const auto note = [&](std::uint64_t count, const std::string& what) {
      if (count > 0) mesh_.notes.push_back(std::to_string(count) + " " + what);
    };
    for (const Element& e : header_.elements)
      if (e.name != "vertex" && e.name != "face" && e.name != "tristrips" && !e.properties.empty())
        note(e.count, "of its elements " + printable(e.name) + " skipped");
    note(several_lines_, "of its elements written over several lines");
    note(misfits_, "of its numbers do not fit the types that its header declares; read as written");
  }

  // ---- numbers

  /// In text an element begins on a line of its own. It may continue in the next lines, but nothing may
  /// follow it on its last line: that would mean a missing or an extra value somewhere, and all following
  /// values would shift.
  void begin_row(const Element& element, std::uint64_t i) {
    if (row_.last_line > 0) before_ = row_;
    row_ = {&element, i, 0, 0};
  }
  void check_row() {
    if (row_.last_line == 0) {
      row_.first_line = line_;
      if (line_ == before_.last_line && before_.first_line == before_.last_line)
        fail(file_, place_of(*row_.element, row_.i),
             "begins on the line of the one before it, which has too many values");
      if (line_ == before_.last_line) {
        line_ = before_.first_line;
        fail(file_, place_of(*before_.element, before_.i),
             "the line ends before all its values, and line " + std::to_string(before_.last_line) +
                 " has more than the rest of them");
      }
    } else if (line_ != row_.last_line && row_.first_line == row_.last_line) {
      ++several_lines_;
    }
    row_.last_line = line_;
  }

  [[noreturn]] void truncated(const Element& element, std::uint64_t i) const {
    fail(file_, place_of(element, i),
         "the file ends here, after " + std::to_string(i) + " of " + std::to_string(element.count) +
             " elements " + printable(element.name));
  }

  const char* take(std::size_t size, const Element& element, std::uint64_t i) {
    if (bytes_.size() - at_ < size) truncated(element, i);
    at_ += size;
    return bytes_.data() + (at_ - size);
  }

  std::string_view take_token(const Element& element, std::uint64_t i) {
    constexpr std::string_view blanks = " \t\r\n\v\f";
    while (at_ < bytes_.size() && blanks.find(bytes_[at_]) != std::string_view::npos) {
      if (bytes_[at_++] == header_.line_end) ++line_;
    }
    if (at_ == bytes_.size()) truncated(element, i);
    check_row();
    const std::size_t begin = at_;
    while (at_ < bytes_.size() && blanks.find(bytes_[at_]) == std::string_view::npos) ++at_;
    return std::string_view(bytes_).substr(begin, at_ - begin);
  }

  template <class T>
  double binary(const Element& element, std::uint64_t i) {
    const char* raw = take(sizeof(T), element, i);
    return static_cast<double>(header_.format == Format::binary_big_endian ? load_big_endian<T>(raw)
                                                                           : load_little_endian<T>(raw));
  }

  double read_number(Type type, const Element& element, std::uint64_t i) {
    if (header_.format == Format::ascii) {
      const std::string_view token = take_token(element, i);
      const std::optional<double> value = parse_double(token);
      if (!value)
        fail(file_, place_of(element, i), printable(token) + " is not a number that a double can hold");
      if (!fits(type, *value)) ++misfits_;
      return *value;
    }
    switch (type) {
      case Type::int8:
        return binary<std::int8_t>(element, i);
      case Type::uint8:
        return binary<std::uint8_t>(element, i);
      case Type::int16:
        return binary<std::int16_t>(element, i);
      case Type::uint16:
        return binary<std::uint16_t>(element, i);
      case Type::int32:
        return binary<std::int32_t>(element, i);
      case Type::uint32:
        return binary<std::uint32_t>(element, i);
      case Type::float32:
        return binary<float>(element, i);
      case Type::float64:
        break;
    }
    return binary<double>(element, i);
  }

  std::int64_t read_integer(Type type, const Element& element, std::uint64_t i) {
    const double value = read_number(type, element, i);  // all integers of the format fit a double
    if (!(std::abs(value) < 1e15) || value != std::floor(value)) {
      fail(file_, place_of(element, i), text_of(value) + " is not a vertex index");
    }
    return static_cast<std::int64_t>(value);
  }

  std::size_t read_count(const Property& property, const Element& element, std::uint64_t i) {
    const double count = read_number(property.count_type, element, i);
    const std::size_t each =
        header_.format == Format::ascii ? 1 : type_bytes[static_cast<std::size_t>(property.type)];
    if (!(count >= 0) || count != std::floor(count)) {
      fail(file_, place_of(element, i), "the list " + property.name + " has the length " + text_of(count));
    }
    if (count > 1e18)
      fail(file_, place_of(element, i), "the list " + property.name + " has the length " + text_of(count));
    if (count > static_cast<double>((bytes_.size() - at_) / each)) {
      fail(file_, place_of(element, i),
           "the list " + property.name + " has the length " +
               std::to_string(static_cast<std::uint64_t>(count)) + ", but only " +
               std::to_string(bytes_.size() - at_) + " bytes are left");
    }
    return static_cast<std::size_t>(count);
  }

  void skip(const Property& property, const Element& element, std::uint64_t i) {
    const std::size_t n = property.is_list ? read_count(property, element, i) : 1;
    if (header_.format == Format::ascii) {
      for (std::size_t k = 0; k < n; ++k) take_token(element, i);
    } else {
      take(n * type_bytes[static_cast<std::size_t>(property.type)], element, i);
    }
  }

  std::filesystem::path file_;
  std::string bytes_;
  Header header_;
  std::size_t at_ = header_.body_at;
  std::size_t line_ = header_.body_line;  // of ascii bodies
  struct Row {
    const Element* element = nullptr;
    std::uint64_t i = 0;
    std::size_t first_line = 0, last_line = 0;  // of its values so far; 0: none
  } row_, before_;                              // of the current element, and of the last one that has values
  std::uint64_t several_lines_ = 0, misfits_ = 0;  // counts of elements and of numbers, for notes
  AnimatedMesh mesh_;
};

}  // namespace

AnimatedMesh read_ply(const std::filesystem::path& file) {
  return PlyReader(file).read();
}

}  // namespace kbvh::io
