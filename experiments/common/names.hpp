#pragma once
#include <string>
#include <string_view>
#include <vector>

namespace kbvh::experiments {

/// Returns the length of the UTF-8 character that begins at `at`, or 0 if the bytes there are not UTF-8.
std::size_t utf8_length(std::string_view text, std::size_t at);

/// Escapes every byte that is not UTF-8 and every control character ("caf\xE9"): file names may be any bytes,
/// results are JSON, and names have one line. Other text stays unchanged.
std::string readable(std::string_view bytes);

/// Checks a name that a user gives to a scene or a body. Throws io::InputError that begins with `place` if
/// the name is not UTF-8, is longer than 1,000 bytes, contains control characters, or is "." or "..". All
/// other texts are names; `file_name` converts them to file names.
void check_name(const std::string& name, const std::string& place);

/// Converts a name to one that every file system accepts and that names only an entry of its folder: '/' and
/// other characters that some system forbids become '-', and so do leading dots; names of devices and
/// trailing dots and blanks get a '-' appended; a long name is cut to 100 bytes with its hash at the end.
std::string file_name(const std::string& name);

/// Composes the name of an unnamed scene: the names of its bodies, joined by '+'; of many bodies, the first
/// ones ("sphere-20+sphere-20+18 more").
std::string name_of_bodies(const std::vector<std::string>& names);

}  // namespace kbvh::experiments
