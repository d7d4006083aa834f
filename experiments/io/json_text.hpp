#pragma once
#include <cstddef>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

namespace kbvh::io {

/// The largest nesting depth of lists and objects in a JSON text. Values are copied, printed and compared by
/// recursion; deeper ones would overflow the stack. A plan nests 8 deep.
inline constexpr std::size_t deepest_json = 256;

/// Parses the JSON of a file, a plan or a request; all JSON from outside enters here. Throws InputError that
/// begins with `name`, line and column, if the text is not JSON in UTF-8, is nested deeper than
/// `deepest_json`, repeats a key of an object (the parser would silently drop all but the last), or if a
/// number is too large for a double.
nlohmann::json parse_json_text(std::string_view text, const std::string& name);

}  // namespace kbvh::io
