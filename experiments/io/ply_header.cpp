#include "experiments/io/ply_header.hpp"

#include <algorithm>
#include <optional>

#include "experiments/io/bytes.hpp"
#include "experiments/io/number_text.hpp"

namespace kbvh::io::ply {
namespace {

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

class HeaderReader {
 public:
  HeaderReader(const std::filesystem::path& file, std::string_view bytes) : file_(file), bytes_(bytes) {}

  Header read() {
    std::size_t number = 0;
    bool has_format = false;
    if (bytes_.starts_with("\xEF\xBB\xBFply")) at_ = 3;  // a byte order mark
    if (at_ == 0 && !bytes_.starts_with("ply")) refuse_utf16(bytes_, file_.string());
    // The first line decides the line ends. The byte after the last header line may have any value: it is
    // data.
    const std::size_t first = bytes_.find_first_of("\r\n");
    if (first != std::string_view::npos && first + 1 < bytes_.size() && bytes_[first] == '\r' &&
        bytes_[first + 1] != '\n')
      header_.line_end = '\r';
    for (;;) {
      const std::size_t end = bytes_.find(header_.line_end, at_);
      const std::string place = "line " + std::to_string(++number);
      if (number == 1 && !bytes_.substr(at_).starts_with("ply")) {
        fail(file_, place, printable(bytes_.substr(0, std::min<std::size_t>(end, 8))) + " instead of 'ply'");
      }
      if (end == std::string::npos) fail(file_, place, "the header ends without 'end_header'");
      std::string_view line = bytes_.substr(at_, end - at_);
      at_ = end + 1;
      const std::string_view whole = line;
      const std::string_view inner = line.substr(0, line.find_last_not_of('\r') + 1);
      if (inner.find_first_of("\r\n") != std::string_view::npos)
        fail(file_, place, "holds a line end of another kind than the first line's");
      const std::string_view word = next_token(line);
      if (number == 1) {
        if (word != "ply") fail(file_, place, printable(word) + " instead of 'ply'");
        refuse_more(place, line);
        continue;
      }
      if (word == "end_header") {
        if (!has_format) fail(file_, place, "the header has no 'format' line");
        header_.body_at = at_;
        header_.body_line = number + 1;
        return std::move(header_);
      }
      if (word == "format") {
        const std::string_view name = next_token(line);
        if (has_format) fail(file_, place, "a second 'format' line");
        read_format(place, name, next_token(line));
        refuse_more(place, line);
        has_format = true;
      } else if (word == "element") {
        const std::string_view name = next_token(line), count_text = next_token(line);
        if (std::any_of(header_.elements.begin(), header_.elements.end(),
                        [&](const Element& e) { return e.name == name; }))
          fail(file_, place, "a second element " + printable(name));
        refuse_more(place, line);
        const std::optional<std::int64_t> count = parse_integer(count_text);
        if (!count || *count < 0)
          fail(file_, place, "element " + printable(name) + " has the count " + printable(count_text));
        header_.elements.push_back({std::string(name), static_cast<std::uint64_t>(*count), {}});
      } else if (word == "property") {
        if (header_.elements.empty())
          fail(file_, place, "a property before the first element: " + printable(whole));
        header_.elements.back().properties.push_back(read_property(place, line));
      } else if (!word.empty() && word != "comment" && word != "obj_info") {
        fail(file_, place,
             "unknown word " + printable(word) + " in the header (a remark begins with 'comment')");
      }
    }
  }

 private:
  void refuse_more(const std::string& place, std::string_view rest) const {
    if (const std::string_view more = next_token(rest); !more.empty())
      fail(file_, place, printable(more) + " behind the end of the statement");
  }

  void read_format(const std::string& place, std::string_view name, std::string_view version) {
    if (name == "ascii") {
      header_.format = Format::ascii;
    } else if (name == "binary_little_endian") {
      header_.format = Format::binary_little_endian;
    } else if (name == "binary_big_endian") {
      header_.format = Format::binary_big_endian;
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
    refuse_more(place, line);
    return property;
  }

  const std::filesystem::path& file_;
  std::string_view bytes_;
  std::size_t at_ = 0;
  Header header_;
};

}  // namespace

Header read_header(const std::filesystem::path& file, std::string_view bytes) {
  return HeaderReader(file, bytes).read();
}

}  // namespace kbvh::io::ply
