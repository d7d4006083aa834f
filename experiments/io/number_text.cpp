#include "experiments/io/number_text.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>

#include "core/base/library_gaps.hpp"

namespace kbvh::io {
namespace {

constexpr std::string_view blanks = " \t\r\v\f";

std::string_view without_plus(std::string_view token) {
  if (token.size() > 1 && token[0] == '+' && token[1] != '-' && token[1] != '+') token.remove_prefix(1);
  return token;
}

template <class T>
std::errc parse_all(std::string_view token, T& value) {
  std::from_chars_result read{};
  if constexpr (std::is_floating_point_v<T>)
    read = parse_floating(token.data(), token.data() + token.size(), value);
  else
    read = std::from_chars(token.data(), token.data() + token.size(), value);
  return read.ptr == token.data() + token.size() ? read.ec : std::errc::invalid_argument;
}

}  // namespace

std::optional<double> parse_double(std::string_view token) {
  token = without_plus(token);
  double value = 0;
  const std::errc error = parse_all(token, value);
  if (error == std::errc{}) return value;
  if (error != std::errc::result_out_of_range) return std::nullopt;
  // from_chars does not tell overflow from underflow; a long double has a larger range in both directions.
  long double wide = 0;
  if (parse_all(token, wide) != std::errc{} || std::abs(wide) > 1) return std::nullopt;
  return static_cast<double>(wide);
}

std::optional<std::int64_t> parse_integer(std::string_view token) {
  std::int64_t value = 0;
  if (parse_all(without_plus(token), value) != std::errc{}) return std::nullopt;
  return value;
}

std::optional<std::int64_t> parse_corner(std::string_view token) {
  const std::optional<std::int64_t> index = parse_integer(token.substr(0, token.find('/')));
  token.remove_prefix(std::min(token.find('/'), token.size()));
  for (int more = 0; !token.empty(); ++more) {
    token.remove_prefix(1);  // the slash
    const std::string_view part = token.substr(0, token.find('/'));
    if (more == 2 || (!part.empty() && !parse_integer(part))) return std::nullopt;
    token.remove_prefix(part.size());
  }
  return index;
}

std::string_view next_token(std::string_view& line) {
  const std::size_t begin = line.find_first_not_of(blanks);
  if (begin == std::string_view::npos) {
    line = {};
    return {};
  }
  line.remove_prefix(begin);
  const std::string_view token = line.substr(0, line.find_first_of(blanks));
  line.remove_prefix(token.size());
  return token;
}

}  // namespace kbvh::io
