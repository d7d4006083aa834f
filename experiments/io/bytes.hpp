#pragma once
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <string>
#include <string_view>
#include <utility>

namespace kbvh::io {

/// Throws InputError with the one sentence "file: place: what" (place may be empty). Every message of the
/// readers is composed here, so that all have one form.
[[noreturn]] void fail(const std::filesystem::path& file, std::string_view place, std::string_view what);

/// Formats a piece of a file for a message: printable, in quotes, at most 40 characters.
std::string printable(std::string_view text);

/// Returns the shortest text that reads back as the same double ("nan" and "inf" for non-finite values).
std::string text_of(double value);

/// Returns all bytes of a regular file. Throws InputError if it is missing, not a regular file, empty or
/// unreadable.
std::string read_file(const std::filesystem::path& file);

/// Returns the text of a file: like `read_file`, without a byte order mark, every line ending in '\n' (files
/// of old Macs end lines with '\r', those of Windows with both). Throws InputError on UTF-16 and UTF-32.
std::string read_text(const std::filesystem::path& file);

/// Throws InputError that begins with `name` if the bytes begin like UTF-16 or UTF-32 text: with its byte
/// order mark, or with an ASCII character in two or four bytes.
void refuse_utf16(std::string_view bytes, const std::string& name);

/// Ends every line with '\n': "\r\n" and a single '\r' become one.
void unify_line_ends(std::string& text);

/// Returns the place of the byte at `at`, "line 3, column 14", counted from 1; lines may end in any of the
/// three ways.
std::string place_in_text(std::string_view text, std::size_t at);

/// Formats the byte at `at` as "0xE9".
std::string byte_text(std::string_view text, std::size_t at);

/// Writes a file under a temporary name next to it and renames it: readers of `file` see all of it or
/// nothing. Throws InputError if the folder is missing or not writable, or the disk is full.
void write_file_atomically(const std::filesystem::path& file, std::string_view bytes);

/// Returns the number of type T stored little-endian at `at`, which needs no alignment.
template <class T>
T load_little_endian(const char* at) {
  unsigned char raw[sizeof(T)];
  std::memcpy(raw, at, sizeof(T));
  if constexpr (std::endian::native == std::endian::big) {
    for (std::size_t i = 0; i < sizeof(T) / 2; ++i) std::swap(raw[i], raw[sizeof(T) - 1 - i]);
  }
  T value;
  std::memcpy(&value, raw, sizeof(T));
  return value;
}

/// Does the same for a number stored big-endian.
template <class T>
T load_big_endian(const char* at) {
  char raw[sizeof(T)];
  for (std::size_t i = 0; i < sizeof(T); ++i) raw[i] = at[sizeof(T) - 1 - i];
  return load_little_endian<T>(raw);
}

/// Appends a number, little-endian.
template <class T>
void append_little_endian(std::string& out, T value) {
  char raw[sizeof(T)];
  std::memcpy(raw, &value, sizeof(T));
  if constexpr (std::endian::native == std::endian::big) {
    for (std::size_t i = 0; i < sizeof(T) / 2; ++i) std::swap(raw[i], raw[sizeof(T) - 1 - i]);
  }
  out.append(raw, sizeof(T));
}

}  // namespace kbvh::io
