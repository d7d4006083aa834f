#include "experiments/common/names.hpp"

#include <algorithm>

#include "experiments/common/text.hpp"
#include "experiments/io/animated_mesh.hpp"
#include "experiments/io/bytes.hpp"

namespace kbvh::experiments {

std::size_t utf8_length(std::string_view text, std::size_t at) {
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  if (at >= text.size()) return 0;
  const unsigned first = byte(at);
  if (first < 0x80) return 1;
  const std::size_t length = first >= 0xF0 ? 4 : first >= 0xE0 ? 3 : 2;
  if (first < 0xC2 || first > 0xF4 || at + length > text.size()) return 0;
  for (std::size_t i = 1; i < length; ++i)
    if ((byte(at + i) & 0xC0) != 0x80) return 0;
  // Overlong sequences, halves of UTF-16 pairs, and values beyond the last code point.
  const unsigned second = byte(at + 1);
  const bool wrong = (first == 0xE0 && second < 0xA0) || (first == 0xED && second > 0x9F) ||
                     (first == 0xF0 && second < 0x90) || (first == 0xF4 && second > 0x8F);
  return wrong ? 0 : length;
}

std::string readable(std::string_view bytes) {
  std::string text;
  for (std::size_t at = 0; at < bytes.size();) {
    const std::size_t length = utf8_length(bytes, at);
    const auto byte = static_cast<unsigned char>(bytes[at]);
    if (length > 1 || (length == 1 && byte >= 32 && byte != 127))
      text += bytes.substr(at, length);
    else
      text += "\\x" + io::byte_text(bytes, at).substr(2);
    at += std::max<std::size_t>(length, 1);
  }
  return text;
}

void check_name(const std::string& name, const std::string& place) {
  constexpr std::size_t longest = 1000;
  const auto refuse = [&](const std::string& what) {
    throw io::InputError(place + ": the name " + io::printable(name) + " " + what);
  };
  if (name.size() > longest)
    refuse("has " + std::to_string(name.size()) + " bytes; at most " + std::to_string(longest) +
           " are possible");
  for (std::size_t at = 0; at < name.size();) {
    const std::size_t length = utf8_length(name, at);
    if (length == 0) refuse("is not UTF-8: byte " + std::to_string(at) + " is " + io::byte_text(name, at));
    const auto byte = static_cast<unsigned char>(name[at]);
    if (byte < 32 || byte == 127)
      refuse("has a control character in it: byte " + std::to_string(at) + " is " + io::byte_text(name, at));
    at += length;
  }
  if (name == "." || name == "..") refuse("means a folder");
}

namespace {

/// Names that mean devices on Windows, with any extension.
bool names_a_device(const std::string& name) {
  std::string stem = name.substr(0, name.find('.'));
  for (char& c : stem) c = c >= 'a' && c <= 'z' ? char(c - 'a' + 'A') : c;
  if (stem.size() == 4 && (stem.starts_with("COM") || stem.starts_with("LPT")))
    return stem[3] >= '0' && stem[3] <= '9';
  return stem == "CON" || stem == "PRN" || stem == "AUX" || stem == "NUL";
}

}  // namespace

std::string file_name(const std::string& name) {
  constexpr std::size_t longest = 100;
  std::string file;
  for (std::size_t at = 0; at < name.size();) {
    const std::size_t length = utf8_length(name, at);
    const char c = name[at];
    const bool plain = length > 1 || (length == 1 && static_cast<unsigned char>(c) >= 32 && c != 127 &&
                                      std::string_view("/\\:*?\"<>|").find(c) == std::string_view::npos);
    if (plain)
      file.append(name, at, length);
    else
      file += '-';
    at += std::max<std::size_t>(length, 1);
  }
  for (std::size_t i = 0; i < file.size() && file[i] == '.'; ++i) file[i] = '-';
  if (file.size() > longest) {
    std::size_t end = 0;  // a character is not cut in two
    while (end + utf8_length(file, end) <= longest - 17) end += utf8_length(file, end);
    file = file.substr(0, end) + "-" + hexadecimal(hash_of(name));
  }
  if (file.empty() || file.back() == '.' || file.back() == ' ' || names_a_device(file)) file += '-';
  return file;
}

std::string name_of_bodies(const std::vector<std::string>& names) {
  constexpr std::size_t longest = 100;
  std::string all;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const std::size_t left = names.size() - i;
    if (i > 0 && all.size() + 1 + names[i].size() > longest)
      return all + "+" + std::to_string(left) + " more";
    all += (i > 0 ? "+" : "") + names[i];
  }
  return all;
}

}  // namespace kbvh::experiments
