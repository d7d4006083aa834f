#pragma once
#include <cstddef>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

namespace kbvh::io {

/// How deep lists and objects of a JSON text may be nested. Values are copied, printed and compared by
/// recursion: deeper ones would overflow the stack. A plan nests 8 deep.
inline constexpr std::size_t deepest_json = 256;

/// Parses the JSON of a file, a plan or a request: the one place where JSON from outside enters. Throws
/// InputError that begins with `name`, line and column, if the text is not JSON in UTF-8, is nested deeper
/// than `deepest_json`, or says a key of an object twice (of which all but the last would be lost without a
/// word); and if a number is too large for a double.
nlohmann::json parse_json_text(std::string_view text, const std::string& name);

}  // namespace kbvh::io
