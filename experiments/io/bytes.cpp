#include "experiments/io/bytes.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <fstream>
#include <system_error>

#include "core/base/library_gaps.hpp"
#include "experiments/io/animated_mesh.hpp"

namespace kbvh::io {

namespace fs = std::filesystem;

void fail(const fs::path& file, std::string_view place, std::string_view what) {
  std::string text = file.string();
  text += ": ";
  if (!place.empty()) {
    text += place;
    text += ": ";
  }
  text += what;
  throw InputError(text);
}

std::string printable(std::string_view text) {
  constexpr std::size_t longest = 40;
  std::string out = "'";
  for (char c : text.substr(0, longest)) out += (c >= 32 && c < 127) ? c : '?';
  out += text.size() > longest ? "...'" : "'";
  return out;
}

std::string text_of(double value) {
  if (std::isnan(value)) return "nan";
  return shortest_text(value);
}

std::string read_file(const fs::path& file) {
  std::error_code error;
  const fs::file_status status = fs::status(file, error);
  if (!fs::exists(status)) fail(file, "", "no such file");
  if (fs::is_directory(status)) fail(file, "", "is a folder where a file is expected");
  if (!fs::is_regular_file(status)) fail(file, "", "is not a regular file");  // a pipe could block forever
  const std::uintmax_t size = fs::file_size(file, error);
  if (error) fail(file, "", "cannot be read: " + error.message());
  if (size == 0) fail(file, "", "is empty (0 bytes)");
  std::ifstream in(file, std::ios::binary);
  if (!in) fail(file, "", "cannot be opened: " + std::system_category().message(errno));
  std::string bytes(size, '\0');
  in.read(bytes.data(), static_cast<std::streamsize>(size));
  if (static_cast<std::uintmax_t>(in.gcount()) != size) {
    fail(file, "",
         "only " + std::to_string(in.gcount()) + " of " + std::to_string(size) + " bytes could be read");
  }
  return bytes;
}

void refuse_utf16(std::string_view bytes, const std::string& name) {
  const auto begins = [&](std::initializer_list<int> pattern) {  // -1: any byte but 0
    if (bytes.size() < pattern.size()) return false;
    std::size_t i = 0;
    for (const int wanted : pattern) {
      const int byte = static_cast<unsigned char>(bytes[i++]);
      if (wanted < 0 ? byte == 0 || byte >= 128 : byte != wanted) return false;
    }
    return true;
  };
  if (begins({0xFF, 0xFE}) || begins({0xFE, 0xFF}) || begins({0, 0, 0xFE, 0xFF}) || begins({-1, 0, -1, 0}) ||
      begins({0, -1, 0, -1}) || begins({-1, 0, 0, 0}) || begins({0, 0, 0, -1}))
    fail(name, "", "is text in UTF-16 or UTF-32, which is not supported; save it as UTF-8");
}

void unify_line_ends(std::string& text) {
  std::size_t from = text.find('\r');
  if (from == std::string::npos) return;
  std::size_t to = from;
  for (; from < text.size(); ++from) {
    const bool ends = text[from] == '\r';
    if (ends && from + 1 < text.size() && text[from + 1] == '\n') continue;
    text[to++] = ends ? '\n' : text[from];
  }
  text.resize(to);
}

std::string read_text(const fs::path& file) {
  std::string text = read_file(file);
  refuse_utf16(text, file.string());
  if (text.starts_with("\xEF\xBB\xBF")) text.erase(0, 3);
  unify_line_ends(text);
  return text;
}

std::string place_in_text(std::string_view text, std::size_t at) {
  std::size_t line = 1, begin = 0;
  for (std::size_t i = 0; i < std::min(at, text.size()); ++i) {
    const bool ends = text[i] == '\n' || (text[i] == '\r' && (i + 1 == text.size() || text[i + 1] != '\n'));
    if (!ends) continue;
    ++line;
    begin = i + 1;
  }
  return "line " + std::to_string(line) + ", column " + std::to_string(at - begin + 1);
}

std::string byte_text(std::string_view text, std::size_t at) {
  constexpr std::string_view digits = "0123456789ABCDEF";
  const unsigned char byte = at < text.size() ? static_cast<unsigned char>(text[at]) : 0;
  return {'0', 'x', digits[byte >> 4], digits[byte & 15]};
}

void write_file_atomically(const fs::path& file, std::string_view bytes) {
  std::string temporary;
  int descriptor = -1;
  for (int attempt = 0; attempt < 100 && descriptor < 0; ++attempt) {
    temporary = file.string() + ".tmp-" + std::to_string(getpid()) + "-" + std::to_string(attempt);
    descriptor = open(temporary.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (descriptor < 0 && errno != EEXIST) break;
  }
  if (descriptor < 0) fail(file, "", "cannot be written: " + std::system_category().message(errno));
  const auto give_up = [&](int reason) {
    unlink(temporary.c_str());
    fail(file, "", "cannot be written: " + std::system_category().message(reason));
  };
  std::size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t n = write(descriptor, bytes.data() + done, bytes.size() - done);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) {
      const int reason = errno;
      close(descriptor);
      give_up(reason);
    }
    done += static_cast<std::size_t>(n);
  }
  // Without fsync a crash can leave the new name without content, which the rename must prevent.
  const int synced = fsync(descriptor) == 0 ? 0 : errno;
  const int closed = close(descriptor) == 0 ? 0 : errno;
  if (synced != 0 || closed != 0) give_up(synced != 0 ? synced : closed);
  if (rename(temporary.c_str(), file.c_str()) != 0) give_up(errno);
}

}  // namespace kbvh::io
