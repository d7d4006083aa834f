#pragma once
// Parts of the C++20 library that the libc++ of Emscripten 3.1 lacks: std::bit_cast, and std::from_chars and
// std::to_chars of floating-point numbers.
#include <charconv>
#include <string>
#include <type_traits>
#if !defined(__cpp_lib_to_chars)
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#endif

namespace kbvh {

/// Returns the number of type To that has the same bits; std::bit_cast.
template <class To, class From>
constexpr To bit_cast(const From& from) noexcept {
  static_assert(sizeof(To) == sizeof(From) && std::is_trivially_copyable_v<To> &&
                std::is_trivially_copyable_v<From>);
  return __builtin_bit_cast(To, from);
}

/// Parses the longest decimal number at the beginning of [first, last), as std::from_chars does: without
/// blanks, plus sign or hexadecimal digits, and the same in every locale.
template <class T>
std::from_chars_result parse_floating(const char* first, const char* last, T& value) {
  static_assert(std::is_floating_point_v<T>);
#if defined(__cpp_lib_to_chars)
  return std::from_chars(first, last, value);
#else
  const std::string text(first, last);
  const std::size_t digits = !text.empty() && text[0] == '-' ? 1 : 0;
  const auto at = [&](std::size_t i) { return i < text.size() ? text[i] : '\0'; };
  const bool hexadecimal = at(digits) == '0' && (at(digits + 1) == 'x' || at(digits + 1) == 'X');
  const bool begins = (at(digits) >= '0' && at(digits) <= '9') || at(digits) == '.' || at(digits) == 'i' ||
                      at(digits) == 'I' || at(digits) == 'n' || at(digits) == 'N';
  if (!begins) return {first, std::errc::invalid_argument};
  if (hexadecimal) {  // from_chars reads the zero alone
    value = digits == 1 ? -T(0) : T(0);
    return {first + digits + 1, std::errc()};
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
#endif
}

/// Returns the shortest text that reads back as the same number, as std::to_chars writes it: 1, 1e+15, 0.1.
inline std::string shortest_text(double number) {
#if defined(__cpp_lib_to_chars)
  char text[32];
  return {text, std::to_chars(text, text + sizeof text, number).ptr};
#else
  if (number != number) return "nan";
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
#endif
}

}  // namespace kbvh
