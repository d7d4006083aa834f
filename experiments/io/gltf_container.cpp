#include "experiments/io/gltf_container.hpp"

#include <array>
#include <charconv>

#include "experiments/io/bytes.hpp"

namespace kbvh::io::gltf {
namespace {

std::string decode_base64(const std::filesystem::path& file, const std::string& place,
                          std::string_view text) {
  constexpr std::string_view alphabet = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::array<std::int8_t, 256> value_of;
  value_of.fill(-1);
  for (std::size_t i = 0; i < alphabet.size(); ++i) {
    value_of[static_cast<unsigned char>(alphabet[i])] = static_cast<std::int8_t>(i);
  }
  const std::size_t all = text.size();
  while (text.ends_with('=') && all - text.size() < 2) text.remove_suffix(1);
  std::string out;
  out.reserve(text.size() / 4 * 3 + 2);
  std::uint32_t bits = 0;
  int have = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const std::int8_t value = value_of[static_cast<unsigned char>(text[i])];
    if (value < 0) {
      fail(file, place,
           "character " + std::to_string(i) + " of the base64 data is " + printable(text.substr(i, 1)));
    }
    bits = bits << 6 | static_cast<std::uint32_t>(value);
    have += 6;
    if (have >= 8) {
      have -= 8;
      out.push_back(static_cast<char>(bits >> have & 0xff));
    }
  }
  return out;
}

std::string decode_percent(const std::filesystem::path& file, const std::string& place,
                           const std::string& uri) {
  std::string out;
  for (std::size_t i = 0; i < uri.size(); ++i) {
    if (uri[i] != '%') {
      out += uri[i];
      continue;
    }
    unsigned code = 0;
    const char* first = uri.data() + i + 1;
    if (i + 2 >= uri.size() || std::from_chars(first, first + 2, code, 16).ptr != first + 2 || code == 0) {
      fail(file, place, "a broken %-escape in " + printable(uri));
    }
    out += static_cast<char>(code);
    i += 2;
  }
  return out;
}

}  // namespace

Container read_container(const std::filesystem::path& file) {
  std::string bytes = read_file(file);
  if (!bytes.starts_with("glTF")) return {std::move(bytes), "", false, 0};

  const auto complain = [&](const std::string& place, const std::string& what) { fail(file, place, what); };
  const std::string size_text = std::to_string(bytes.size());
  if (bytes.size() < 20) complain("header", "the file ends after " + size_text + " bytes");
  const auto version = load_little_endian<std::uint32_t>(&bytes[4]);
  const auto length = load_little_endian<std::uint32_t>(&bytes[8]);
  if (version != 2) complain("header", "version is " + std::to_string(version) + ", only 2 is known");
  if (length > bytes.size() || length < 20) {
    complain("header", "the length is " + std::to_string(length) + " bytes, but the file has " + size_text);
  }
  Container container;
  container.bytes_behind = bytes.size() - length;
  std::size_t at = 12;
  for (int chunk = 0; at < length; ++chunk) {
    const std::string place = "chunk " + std::to_string(chunk);
    if (length - at < 8) complain(place, "its header is cut off at byte " + std::to_string(at));
    const auto size = load_little_endian<std::uint32_t>(&bytes[at]);
    const std::string type = bytes.substr(at + 4, 4);
    at += 8;
    if (size > length - at) {
      complain(place, "its length is " + std::to_string(size) + " bytes, but only " +
                          std::to_string(length - at) + " are left");
    }
    if (chunk == 0) {
      if (type != "JSON") complain(place, "its type is " + printable(type) + " instead of 'JSON'");
      // Some writers fill the chunk up with NUL bytes; glTF 2.0 (GLB, structured JSON content) requires
      // blanks.
      container.json = bytes.substr(at, size);
      container.json.erase(container.json.find_last_not_of('\0') + 1);
    } else if (chunk == 1 && type == std::string("BIN\0", 4)) {
      container.binary = bytes.substr(at, size);
      container.has_binary = true;
    }
    at += size;
  }
  return container;
}

std::string read_uri(const std::filesystem::path& file, const std::string& place, const std::string& uri) {
  if (uri.starts_with("data:")) {
    const std::size_t comma = uri.find(',');
    if (comma == std::string::npos || !std::string_view(uri).substr(0, comma).ends_with(";base64")) {
      fail(file, place, "data that is not base64: " + printable(uri));
    }
    return decode_base64(file, place, std::string_view(uri).substr(comma + 1));
  }
  const std::filesystem::path relative = decode_percent(file, place, uri);
  bool leaves = relative.is_absolute() || relative.empty() ||
                relative.string().find_first_of(":\\") != std::string::npos;
  for (const auto& part : relative) leaves = leaves || part == "..";
  if (leaves) fail(file, place, printable(uri) + " is not a file in or below the folder of the glTF file");
  std::error_code error;
  const std::filesystem::path target = file.parent_path() / relative;
  if (!std::filesystem::is_regular_file(target, error)) {
    fail(file, place, printable(uri) + ": no such file next to the glTF file");
  }
  return read_file(target);
}

}  // namespace kbvh::io::gltf
