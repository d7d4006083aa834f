#pragma once
#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

/// The header of a PLY file as plain data.
namespace kbvh::io::ply {

enum class Format { ascii, binary_little_endian, binary_big_endian };
enum class Type { int8, uint8, int16, uint16, int32, uint32, float32, float64 };

inline constexpr std::array<std::size_t, 8> type_bytes{1, 1, 2, 2, 4, 4, 4, 8};

/// A number of every element, or a list of numbers with its length in front.
struct Property {
  std::string name;
  Type type = Type::float32;
  bool is_list = false;
  Type count_type = Type::uint8;  // of lists
};

/// A kind of element, of which the body holds `count`.
struct Element {
  std::string name;
  std::uint64_t count = 0;
  std::vector<Property> properties;
};

struct Header {
  Format format = Format::ascii;
  std::vector<Element> elements;  ///< in the order of the body; no two of one name
  std::size_t body_at = 0;        ///< byte after the header
  std::size_t body_line = 1;      ///< its line, from 1
  char line_end = '\n';           ///< of "\r\n" the second character
};

/// Reads and checks the header of a file's `bytes`. Throws InputError with the line and the word.
Header read_header(const std::filesystem::path& file, std::string_view bytes);

}  // namespace kbvh::io::ply
