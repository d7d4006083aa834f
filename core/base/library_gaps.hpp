#pragma once
// Parts of the C++20 library that the libc++ of Emscripten 3.1 lacks: std::bit_cast, and std::from_chars and
// std::to_chars of floating-point numbers.
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <type_traits>

namespace kbvh {

/// Returns the number of type To that has the same bits; std::bit_cast.
template <class To, class From>
constexpr To bit_cast(const From& from) noexcept {
  static_assert(sizeof(To) == sizeof(From) && std::is_trivially_copyable_v<To> &&
                std::is_trivially_copyable_v<From>);
  return __builtin_bit_cast(To, from);
}

namespace detail {

/// std::from_chars by the functions of C, in whose locale the point has to be the decimal point.
template <class T>
std::from_chars_result from_chars_by_c(const char* first, const char* last, T& value) {
  const std::string text(first, last);
  const std::size_t sign = !text.empty() && text[0] == '-' ? 1 : 0;
  // C also reads blanks, a plus sign and hexadecimal digits.
  const char begin = sign < text.size() ? text[sign] : '\0';
  if (begin == '\0' || std::string("0123456789.iInN").find(begin) == std::string::npos)
    return {first, std::errc::invalid_argument};
  if (begin == '0' && sign + 1 < text.size() && (text[sign + 1] == 'x' || text[sign + 1] == 'X')) {
    value = sign == 1 ? -T(0) : T(0);
    return {first + sign + 1, std::errc()};
  }
  char* end = nullptr;
  errno = 0;
  T number = 0;
  if constexpr (std::is_same_v<T, float>)
    number = std::strtof(text.c_str(), &end);
  else if constexpr (std::is_same_v<T, double>)
    number = std::strtod(text.c_str(), &end);
  else
    number = std::strtold(text.c_str(), &end);
  if (end == text.c_str()) return {first, std::errc::invalid_argument};
  const char* const stop = first + (end - text.c_str());
  // A subnormal number may set ERANGE, too, but is a value.
  if (errno == ERANGE && (number == 0 || number - number != 0)) return {stop, std::errc::result_out_of_range};
  value = number;
  return {stop, std::errc()};
}

/// std::to_chars by the functions of C.
inline std::string to_chars_by_c(double number) {
  if (number != number) return std::signbit(number) ? "-nan" : "nan";
  if (number - number != 0) return number < 0 ? "-inf" : "inf";
  char text[40];
  int digits = 1;
  do {
    std::snprintf(text, sizeof text, "%.*e", digits - 1, number);
  } while (std::strtod(text, nullptr) != number && ++digits <= 17);
  const std::string scientific = text;
  const int exponent = std::atoi(scientific.c_str() + scientific.find('e') + 1);
  const int decimals = digits - 1 > exponent ? digits - 1 - exponent : 0;
  const int length = std::snprintf(nullptr, 0, "%.*f", decimals, number);
  if (length < 0 || std::size_t(length) > scientific.size()) return scientific;
  std::snprintf(text, sizeof text, "%.*f", decimals, number);
  return text;
}

}  // namespace detail

/// Parses the longest decimal number at the beginning of [first, last), as std::from_chars does.
template <class T>
std::from_chars_result parse_floating(const char* first, const char* last, T& value) {
  static_assert(std::is_floating_point_v<T>);
#if defined(__cpp_lib_to_chars)
  return std::from_chars(first, last, value);
#else
  return detail::from_chars_by_c(first, last, value);
#endif
}

/// Returns the shortest text that reads back as the same number, as std::to_chars writes it: 1, 1e+15, 0.1.
inline std::string shortest_text(double number) {
#if defined(__cpp_lib_to_chars)
  char text[32];
  return {text, std::to_chars(text, text + sizeof text, number).ptr};
#else
  return detail::to_chars_by_c(number);
#endif
}

}  // namespace kbvh
