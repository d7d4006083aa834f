#include "experiments/io/ply.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "experiments/io/bytes.hpp"
#include "experiments/io/number_text.hpp"
#include "experiments/io/primitives.hpp"

namespace kbvh::io {
namespace {

enum class Format { ascii, binary_little_endian, binary_big_endian };
enum class Type { int8, uint8, int16, uint16, int32, uint32, float32, float64 };

constexpr std::array<std::size_t, 8> type_bytes{1, 1, 2, 2, 4, 4, 4, 8};

struct Property {
  std::string name;
  Type type = Type::float32;
  bool is_list = false;
  Type count_type = Type::uint8;  // of lists
};

struct Element {
  std::string name;
  std::uint64_t count = 0;
  std::vector<Property> properties;
};

std::optional<Type> type_named(std::string_view name) {
  static constexpr std::array<std::array<std::string_view, 2>, 8> names{{{"char", "int8"},
                                                                         {"uchar", "uint8"},
                                                                         {"short", "int16"},
                                                                         {"ushort", "uint16"},
                                                                         {"int", "int32"},
                                                                         {"uint", "uint32"},
                                                                         {"float", "float32"},
                                                                         {"double", "float64"}}};
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (name == names[i][0] || name == names[i][1]) return static_cast<Type>(i);
  }
  return std::nullopt;
}

class PlyReader {
 public:
  explicit PlyReader(const std::filesystem::path& file) : file_(file), bytes_(read_file(file)) {}

  AnimatedMesh read() {
    read_header();
    for (const Element& element : elements_) read_element(element);
    check_end();
    if (mesh_.vertex_count == 0) fail(file_, "", "holds no vertices");
    if (mesh_.primitive_count() == 0) make_points(mesh_);
    check_indices();
    mesh_.name = file_.stem().string();
    mesh_.keyframe_times = {0.0};
    return std::move(mesh_);
  }

 private:
  // ---- header

  void read_header() {
    std::size_t number = 0;
    bool has_format = false;
    if (bytes_.starts_with("\xEF\xBB\xBFply")) at_ = 3;  // a byte order mark
    if (at_ == 0 && !bytes_.starts_with("ply")) refuse_utf16(bytes_, file_.string());
    // The first line decides the line ends. The byte after the last header line may be any: it is data.
    const std::size_t after = at_ + 3;
    if (after + 1 < bytes_.size() && bytes_[after] == '\r' && bytes_[after + 1] != '\n') line_end_ = '\r';
    for (;;) {
      const std::size_t end = bytes_.find(line_end_, at_);
      const std::string place = "line " + std::to_string(++number);
      if (number == 1 && !std::string_view(bytes_).substr(at_).starts_with("ply")) {
        fail(file_, place,
             printable(std::string_view(bytes_).substr(0, std::min<std::size_t>(end, 8))) +
                 " instead of 'ply'");
      }
      if (end == std::string::npos) fail(file_, place, "the header ends without 'end_header'");
      std::string_view line = std::string_view(bytes_).substr(at_, end - at_);
      at_ = end + 1;
      const std::string_view whole = line;
      const std::string_view word = next_token(line);
      if (word == "end_header") {
        if (!has_format) fail(file_, place, "the header has no 'format' line");
        line_ = number + 1;
        return;
      }
      if (word == "format") {
        const std::string_view name = next_token(line);
        if (has_format) fail(file_, place, "a second 'format' line");
        read_format(place, name, next_token(line));
        has_format = true;
      } else if (word == "element") {
        const std::string_view name = next_token(line), count_text = next_token(line);
        const std::optional<std::int64_t> count = parse_integer(count_text);
        if (!count || *count < 0)
          fail(file_, place, "element " + printable(name) + " has the count " + printable(count_text));
        elements_.push_back({std::string(name), static_cast<std::uint64_t>(*count), {}});
      } else if (word == "property") {
        if (elements_.empty()) fail(file_, place, "a property before the first element: " + printable(whole));
        elements_.back().properties.push_back(read_property(place, line));
      } else if (!word.empty() && word != "ply" && word != "comment" && word != "obj_info") {
        fail(file_, place, "unknown word " + printable(word) + " in the header");
      }
    }
  }

  void read_format(const std::string& place, std::string_view name, std::string_view version) {
    if (name == "ascii") {
      format_ = Format::ascii;
    } else if (name == "binary_little_endian") {
      format_ = Format::binary_little_endian;
    } else if (name == "binary_big_endian") {
      format_ = Format::binary_big_endian;
    } else {
      fail(file_, place, "unknown format " + printable(name));
    }
    if (version != "1.0")
      fail(file_, place, "format version is " + printable(version) + ", only 1.0 is known");
  }

  Property read_property(const std::string& place, std::string_view line) const {
    const auto type_of = [&](std::string_view name) {
      const std::optional<Type> type = type_named(name);
      if (!type) fail(file_, place, "unknown type " + printable(name));
      return *type;
    };
    Property property;
    std::string_view word = next_token(line);
    if (word == "list") {
      property.is_list = true;
      const std::string_view count_name = next_token(line);
      property.count_type = type_of(count_name);
      if (property.count_type >= Type::float32)
        fail(file_, place, "a list counted in " + printable(count_name));
      word = next_token(line);
    }
    property.type = type_of(word);
    property.name = next_token(line);
    if (property.name.empty()) fail(file_, place, "a property without a name");
    return property;
  }

  // ---- body

  std::string place_of(const Element& element, std::uint64_t i) const {
    const std::string place = element.name + " " + std::to_string(i);
    return format_ == Format::ascii ? "line " + std::to_string(line_) + ", " + place : place;
  }

  void check_room(const Element& element) const {
    // Checked before any allocation: the elements promised by the header need at least this many bytes.
    std::uint64_t least = 0;
    for (const Property& p : element.properties) {
      least += format_ == Format::ascii
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
      begin_row();
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

  bool is_index_list(const Property& p) const {
    return p.is_list && (p.name == "vertex_indices" || p.name == "vertex_index");
  }

  /// Calls use(element number, list) for each element's list of vertex indices.
  template <class Use>
  void read_lists(const Element& element, Use use) {
    const auto lists = std::count_if(element.properties.begin(), element.properties.end(),
                                     [&](const Property& p) { return is_index_list(p); });
    if (lists > 1) fail(file_, "element " + element.name, "has two lists of vertex indices");
    if (lists == 0 && element.count > 0) fail(file_, "element " + element.name, "has no list vertex_indices");
    std::vector<std::int64_t> list;
    for (std::uint64_t i = 0; i < element.count; ++i) {
      begin_row();
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
      for (std::size_t k = 0; k < list.size(); ++k) {
        if (list[k] == -1) start = k + 1;
        if (k < start + 2 || list[k] == -1) continue;
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
    fail(file_, format_ == Format::ascii ? place_in_text(bytes_, more) : "byte " + std::to_string(more),
         "data behind the last element that the header counts");
  }

  // ---- numbers

  /// In text a vertex or a face is a line: missing or additional values would shift all following ones.
  void begin_row() {
    last_row_ = row_;
    row_ = 0;
  }
  void check_row(const Element& element, std::uint64_t i) {
    if (element.name != "vertex" && element.name != "face") return;
    if (row_ == 0 && line_ == last_row_)
      fail(file_, place_of(element, i), "begins on the line of the one before it, which has too many values");
    if (row_ != 0 && line_ != row_) {
      line_ = row_;
      fail(file_, place_of(element, i), "the line ends before all its values");
    }
    row_ = line_;
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
      if (bytes_[at_++] == line_end_) ++line_;
    }
    if (at_ == bytes_.size()) truncated(element, i);
    check_row(element, i);
    const std::size_t begin = at_;
    while (at_ < bytes_.size() && blanks.find(bytes_[at_]) == std::string_view::npos) ++at_;
    return std::string_view(bytes_).substr(begin, at_ - begin);
  }

  template <class T>
  double binary(const Element& element, std::uint64_t i) {
    const char* raw = take(sizeof(T), element, i);
    return static_cast<double>(format_ == Format::binary_big_endian ? load_big_endian<T>(raw)
                                                                    : load_little_endian<T>(raw));
  }

  double read_number(Type type, const Element& element, std::uint64_t i) {
    if (format_ == Format::ascii) {
      const std::string_view token = take_token(element, i);
      const std::optional<double> value = parse_double(token);
      if (!value)
        fail(file_, place_of(element, i), printable(token) + " is not a number that a double can hold");
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
        format_ == Format::ascii ? 1 : type_bytes[static_cast<std::size_t>(property.type)];
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
    if (format_ == Format::ascii) {
      for (std::size_t k = 0; k < n; ++k) take_token(element, i);
    } else {
      take(n * type_bytes[static_cast<std::size_t>(property.type)], element, i);
    }
  }

  std::filesystem::path file_;
  std::string bytes_;
  std::size_t at_ = 0;
  char line_end_ = '\n';                // of "\r\n" the second character
  std::size_t line_ = 1;                // of ascii bodies
  std::size_t row_ = 0, last_row_ = 0;  // lines of the current element, and of the preceding one; 0: none
  Format format_ = Format::ascii;
  std::vector<Element> elements_;
  AnimatedMesh mesh_;
};

}  // namespace

AnimatedMesh read_ply(const std::filesystem::path& file) {
  return PlyReader(file).read();
}

}  // namespace kbvh::io
