#include "experiments/io/json_text.hpp"

#include <algorithm>
#include <set>
#include <vector>

#include "experiments/io/bytes.hpp"

namespace kbvh::io {
namespace {

using nlohmann::json;

[[noreturn]] void refuse(std::string_view text, const std::string& name, std::size_t at,
                         const std::string& what) {
  fail(name, place_in_text(text, at), what);
}

/// Returns the position after the string that begins at `at` with its quotation mark.
std::size_t end_of_string(std::string_view text, std::size_t at) {
  for (++at; at < text.size() && text[at] != '"'; ++at)
    if (text[at] == '\\') ++at;
  return std::min(at + 1, text.size());
}

/// Decodes a key for comparison: "\u0061" and "a" are the same.
std::string key_of(std::string_view token) {
  if (token.find('\\') == std::string_view::npos) return std::string(token.substr(1, token.size() - 2));
  const json key = json::parse(token, nullptr, false);
  return key.is_string() ? key.get<std::string>() : std::string(token);
}

/// Refuses excessive nesting before any value is built, and a NUL byte between values: the parser takes it
/// for the end of the text and would lose the rest.
void check_depth_and_end(std::string_view text, const std::string& name) {
  std::size_t depth = 0;
  for (std::size_t at = 0; at < text.size(); ++at) {
    switch (text[at]) {
      case '"':
        at = end_of_string(text, at) - 1;
        break;
      case '{':
      case '[':
        if (++depth > deepest_json)
          refuse(text, name, at,
                 "the JSON is nested deeper than " + std::to_string(deepest_json) + " levels");
        break;
      case '}':
      case ']':
        if (depth > 0) --depth;
        break;
      case '\0':
        refuse(text, name, at, "this is not JSON: a NUL byte");
      default:
        break;
    }
  }
}

/// Refuses a repeated key in an object. `text` is JSON.
void check_keys(std::string_view text, const std::string& name) {
  struct Level {
    bool is_object;
    std::set<std::string> keys{};
  };
  std::vector<Level> levels;
  bool key_follows = false;
  for (std::size_t at = 0; at < text.size(); ++at) {
    switch (text[at]) {
      case '"': {
        const std::size_t end = end_of_string(text, at);
        if (key_follows) {
          const std::string key = key_of(text.substr(at, end - at));
          if (!levels.back().keys.insert(key).second)
            refuse(text, name, at, "the key " + printable(key) + " is given twice");
        }
        key_follows = false;
        at = end - 1;
        break;
      }
      case '{':
      case '[':
        levels.push_back({text[at] == '{'});
        key_follows = levels.back().is_object;
        break;
      case '}':
      case ']':
        levels.pop_back();
        key_follows = false;
        break;
      case ',':
        key_follows = levels.back().is_object;
        break;
      default:
        break;
    }
  }
}

}  // namespace

json parse_json_text(std::string_view text, const std::string& name) {
  refuse_utf16(text, name);
  check_depth_and_end(text, name);
  json value;
  try {
    value = json::parse(text);
  } catch (const json::parse_error& error) {
    std::size_t at = std::min(error.byte > 0 ? error.byte - 1 : 0, text.size());
    const bool is_utf8 = std::string_view(error.what()).find("UTF-8") == std::string_view::npos;
    // A truncated sequence is detected at the byte after it.
    while (!is_utf8 && at > 0 && (at == text.size() || static_cast<unsigned char>(text[at]) < 0x80)) --at;
    refuse(
        text, name, at,
        is_utf8 ? "this is not JSON" : "this is not JSON: the byte " + byte_text(text, at) + " is not UTF-8");
  } catch (const json::out_of_range& error) {
    // "... number overflow parsing '1e999'"
    const std::string said = error.what();
    const std::size_t begin = std::min(said.find('\''), said.size());
    const std::string number = said.substr(begin, 60);
    const std::string bare = number.size() > 2 ? number.substr(1, number.size() - 2) : "";
    const std::size_t at = bare.empty() ? std::string_view::npos : text.find(bare);
    refuse(text, name, at == std::string_view::npos ? 0 : at,
           "the JSON holds a number that is too large for a double: " + number);
  }
  check_keys(text, name);
  return value;
}

}  // namespace kbvh::io
