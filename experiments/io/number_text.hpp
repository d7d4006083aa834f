#pragma once
#include <cstdint>
#include <optional>
#include <string_view>

namespace kbvh::io {

/// The double nearest to the whole of `token` ("+1", "1e-3", "nan", "inf"), independent of the locale;
/// underflow gives the nearest, possibly 0. Nothing if the token is not a number or is too large for a
/// double.
std::optional<double> parse_double(std::string_view token);

/// The integer that the whole of `token` is, if it fits. A leading plus is allowed.
std::optional<std::int64_t> parse_integer(std::string_view token);

/// Cuts the next token that ends at a blank (space, tab, CR, vertical tab, form feed) off the front of
/// `line`; empty at its end.
std::string_view next_token(std::string_view& line);

}  // namespace kbvh::io
