#pragma once
#include <cstdint>
#include <optional>
#include <string_view>

namespace kbvh::io {

/// Parses the whole of `token` as the nearest double ("+1", "1e-3", "nan", "inf"), independent of the locale;
/// underflow gives the nearest, possibly 0. Returns nothing if the token is not a number or is too large for
/// a double.
std::optional<double> parse_double(std::string_view token);

/// Parses the whole of `token` as an integer, if it fits. A leading plus is allowed.
std::optional<std::int64_t> parse_integer(std::string_view token);

/// Parses the vertex index of a corner in OBJ: "7", "7/1", "7//2" or "7/1/2", where the indices of a texture
/// coordinate and a normal follow. Returns nothing if any of them is not an integer.
std::optional<std::int64_t> parse_corner(std::string_view token);

/// Removes the next token that ends at a blank (space, tab, CR, vertical tab, form feed) from the front of
/// `line` and returns it; empty at the end.
std::string_view next_token(std::string_view& line);

}  // namespace kbvh::io
