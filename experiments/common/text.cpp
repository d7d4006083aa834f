#include "experiments/common/text.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>

#include "experiments/io/bytes.hpp"

namespace kbvh::experiments {

std::vector<std::string> split(std::string_view text, char separator) {
  std::vector<std::string> parts;
  for (;;) {
    const std::size_t at = text.find(separator);
    parts.emplace_back(text.substr(0, at));
    if (at == std::string_view::npos) return parts;
    text.remove_prefix(at + 1);
  }
}

std::string joined(const std::vector<std::string>& words, std::string_view separator) {
  std::string text;
  for (const std::string& word : words) {
    if (!text.empty()) text += separator;
    text += word;
  }
  return text;
}

std::string counted(std::uint64_t count, const std::string& noun) {
  return std::to_string(count) + " " + (count == 1 ? noun : plural(noun));
}

std::string plural(const std::string& noun) {
  const auto ends = [&](std::string_view ending) { return noun.ends_with(ending); };
  const auto stem = [&](std::size_t without) { return noun.substr(0, noun.size() - without); };
  const bool vowel_before_y =
      noun.size() > 1 && std::string_view("aeiou").find(noun[noun.size() - 2]) != std::string_view::npos;
  if (ends("y") && !vowel_before_y) return stem(1) + "ies";
  if (ends("vertex")) return stem(2) + "ices";
  if (ends("s") || ends("x") || ends("ch") || ends("sh")) return noun + "es";
  return noun + "s";
}

std::optional<double> parse_number(std::string_view text) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value)) return {};
  return value;
}

std::optional<std::uint64_t> parse_whole(std::string_view text) {
  std::uint64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return {};
  return value;
}

std::optional<std::pair<std::string, std::string>> parse_assignment(std::string_view text) {
  const std::size_t at = text.find('=');
  if (at == std::string_view::npos || at == 0) return {};
  return std::pair{std::string(text.substr(0, at)), std::string(text.substr(at + 1))};
}

namespace {

std::string folded(std::string_view text) {
  std::string result(text);
  for (char& c : result) c = c == '-' ? '_' : c >= 'A' && c <= 'Z' ? char(c - 'A' + 'a') : c;
  return result;
}

/// Computes the optimal string alignment distance: three rows of the table at a time.
std::size_t edits_between(const std::string& a, const std::string& b) {
  std::vector<std::size_t> before(b.size() + 1), last(b.size() + 1), row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    before = std::move(last);
    last = std::move(row);
    row.assign(b.size() + 1, i);
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t changed = a[i - 1] == b[j - 1] ? 0 : 1;
      row[j] = std::min({last[j] + 1, row[j - 1] + 1, last[j - 1] + changed});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1])
        row[j] = std::min(row[j], before[j - 2] + 1);
    }
  }
  return row.back();
}

}  // namespace

std::optional<std::string> nearest_of(std::string_view word, const std::vector<std::string>& known) {
  constexpr std::size_t longest_name = 100;  // the table is as large as the product of both lengths
  if (word.empty() || word.size() > longest_name) return {};
  const std::string wanted = folded(word);
  const std::string* nearest = nullptr;
  const std::string* continued = nullptr;
  std::size_t fewest = std::max<std::size_t>(1, wanted.size() / 3) + 1, continuations = 0;
  for (const std::string& candidate : known) {
    if (candidate.size() > longest_name) continue;
    const std::string other = folded(candidate);
    const std::size_t edits = edits_between(wanted, other);
    // A word of one or two letters is not a misspelling of a word without a common letter.
    if (edits < fewest && edits < std::max(wanted.size(), other.size())) {
      fewest = edits;
      nearest = &candidate;
    }
    if (wanted.size() >= 3 && other.starts_with(wanted)) {
      ++continuations;
      continued = &candidate;
    }
  }
  if (nearest == nullptr && continuations == 1) nearest = continued;
  return nearest == nullptr ? std::nullopt : std::optional(*nearest);
}

std::string no_such(const std::string& kind, std::string_view word, const std::vector<std::string>& known,
                    const std::string& otherwise) {
  constexpr std::size_t line = 120;
  const std::string all = joined(known);
  const std::string begin = "there is no " + kind + " " + io::printable(word), end = suggestion(word, known);
  if (all.size() <= line || otherwise.empty()) return begin + "; known are " + all + end;
  return begin + (end.empty() ? "; " + otherwise : end);
}

std::string suggestion(std::string_view word, const std::vector<std::string>& known) {
  const std::optional<std::string> nearest = nearest_of(word, known);
  return nearest ? "; did you mean '" + *nearest + "'?" : "";
}

std::uint64_t hash_of(std::string_view text, std::uint64_t seed) {
  std::uint64_t state = 0xcbf29ce484222325ull ^ seed;
  for (const char c : text) state = (state ^ static_cast<unsigned char>(c)) * 0x100000001b3ull;
  state ^= state >> 31;
  state *= 0x9e3779b97f4a7c15ull;
  return state ^ (state >> 29);
}

std::string hexadecimal(std::uint64_t value) {
  char text[17];
  std::snprintf(text, sizeof text, "%016llx", static_cast<unsigned long long>(value));
  return text;
}

}  // namespace kbvh::experiments
